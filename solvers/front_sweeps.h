/// \file front_sweeps.h
/// Right-hand sides on their way through the fronts of a factor, forwards and back.
#pragma once
#include <algorithm>
#include <cstddef>
#include <span>
#include <vector>

#include "solvers/dense_front.h"
#include "solvers/front_tree.h"

namespace tessera {

/// Right-hand sides as dense_front.h wants them: few in columns, many in rows of a multiple of kWideSolve.
[[nodiscard]] constexpr std::size_t sweep_width(int width) {
  const auto w = static_cast<std::size_t>(width), wide = static_cast<std::size_t>(kWideSolve);
  return width < kWideSolve ? w : (w + wide - 1) / wide * wide;
}

[[nodiscard]] inline std::uint64_t sweep_bytes(const FrontTree& tree, int width) {
  return sizeof(double) * sweep_width(width) * (tree.unknowns() + tree.largest());
}

/// \param b  n x width, interleaved, in place
/// \param forward, backward  called with (front, x, width): x holds the front's rows and is solved for in place
template <class Forward, class Backward>
void sweep_fronts(const FrontTree& tree, std::span<double> b, int width, const Forward& forward,
                  const Backward& backward) {
  const std::size_t w = sweep_width(width);
  const bool wide = width >= kWideSolve;
  std::vector<double> x(tree.unknowns() * w), part(tree.largest() * w);
  tree.to_order(b, width, x, w);
  const auto through = [&](std::size_t k, const auto& solve) {
    const std::span<const std::int32_t> rows = tree.rows(k);
    const std::span<double> here = std::span(part).first(rows.size() * w);
    for (std::size_t i = 0; i < rows.size(); ++i) {
      const double* from = x.data() + static_cast<std::size_t>(rows[i]) * w;
      if (wide)
        std::copy_n(from, w, here.data() + i * w);
      else
        for (std::size_t c = 0; c < w; ++c) here[c * rows.size() + i] = from[c];
    }
    solve(k, here, static_cast<int>(w));
    for (std::size_t i = 0; i < rows.size(); ++i) {
      double* to = x.data() + static_cast<std::size_t>(rows[i]) * w;
      if (wide)
        std::copy_n(here.data() + i * w, w, to);
      else
        for (std::size_t c = 0; c < w; ++c) to[c] = here[c * rows.size() + i];
    }
  };
  for (std::size_t k = 0; k < tree.count(); ++k) through(k, forward);
  for (std::size_t k = tree.count(); k-- > 0;) through(k, backward);
  tree.from_order(x, w, b, width);
}

}  // namespace tessera
