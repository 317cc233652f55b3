/// \file column_filters.h
/// Filters over a square of columns of a scan seen from above: sums over boxes, dilation and erosion, medians. A column depends
/// on no more columns than the radius says. Source: J. Serra, "Image Analysis and Mathematical Morphology", 1982.
#pragma once
#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "kernels/points/surface_model.h"

namespace tessera {

/// Columns of a square, u fastest.
struct ColumnSquare {
  int edge;
  [[nodiscard]] std::size_t at(int u, int v) const {
    return static_cast<std::size_t>(v) * static_cast<std::size_t>(edge) + static_cast<std::size_t>(u);
  }
};

/// Sums over squares of columns of this radius, cut off at the rim.
[[nodiscard]] inline std::vector<std::int64_t> box_sums(ColumnSquare s, const std::vector<std::int64_t>& in,
                                                        int radius) {
  std::vector<std::int64_t> rows(in.size()), out(in.size());
  const auto slide = [&](const std::vector<std::int64_t>& from, std::vector<std::int64_t>& to, auto index) {
    for (int line = 0; line < s.edge; ++line) {
      std::int64_t sum = 0;
      for (int k = 0; k < std::min(radius, s.edge); ++k) sum += from[index(k, line)];
      for (int k = 0; k < s.edge; ++k) {
        if (k + radius < s.edge) sum += from[index(k + radius, line)];
        if (k - radius - 1 >= 0) sum -= from[index(k - radius - 1, line)];
        to[index(k, line)] = sum;
      }
    }
  };
  slide(in, rows, [&](int k, int line) { return s.at(k, line); });
  slide(rows, out, [&](int k, int line) { return s.at(line, k); });
  return out;
}

/// Columns within `radius` of a set (chessboard); with `set` false of what is not in it, turned over: what is left of it.
[[nodiscard]] inline std::vector<std::uint8_t> dilate(ColumnSquare s, const std::vector<std::uint8_t>& mask,
                                                      int radius, bool set = true) {
  std::vector<std::int64_t> count(mask.size());
  for (std::size_t i = 0; i < mask.size(); ++i) count[i] = (mask[i] != 0) == set;
  const std::vector<std::int64_t> sums = box_sums(s, count, radius);
  std::vector<std::uint8_t> out(mask.size());
  for (std::size_t i = 0; i < mask.size(); ++i) out[i] = (sums[i] > 0) == set;
  return out;
}
[[nodiscard]] inline std::vector<std::uint8_t> erode(ColumnSquare s, const std::vector<std::uint8_t>& mask,
                                                     int radius) {
  return dilate(s, mask, radius, false);
}

/// As dilate(), within `radius` of an octagon, which is nearly a disk: a square of four tenths of it, and the rest by steps to the
/// four neighbours. What is closed by squares has the corners of the lattice.
[[nodiscard]] inline std::vector<std::uint8_t> dilate_round(ColumnSquare s,
                                                            const std::vector<std::uint8_t>& mask, int radius,
                                                            bool set = true) {
  const int square = (2 * radius + 2) / 5;
  std::vector<std::uint8_t> out = dilate(s, mask, square, set), before;
  for (int step = square; step < radius; ++step) {
    before = out;
    const auto spread = [&](std::size_t from, std::size_t to) {
      if ((before[from] != 0) == set) out[to] = set;
    };
    for (int v = 0; v < s.edge; ++v)
      for (int u = 0; u < s.edge; ++u) {
        const std::size_t i = s.at(u, v);
        if (u > 0) spread(i, s.at(u - 1, v));
        if (u + 1 < s.edge) spread(i, s.at(u + 1, v));
        if (v > 0) spread(i, s.at(u, v - 1));
        if (v + 1 < s.edge) spread(i, s.at(u, v + 1));
      }
  }
  return out;
}

/// Lower median of the heights around every wanted column.
[[nodiscard]] inline std::vector<std::int32_t> median5(ColumnSquare s,
                                                       const std::vector<std::int32_t>& height,
                                                       const std::vector<std::uint8_t>& wanted) {
  std::vector<std::int32_t> out = height;
  std::array<std::int32_t, 25> near;
  for (int v = 0; v < s.edge; ++v)
    for (int u = 0; u < s.edge; ++u) {
      if (wanted[s.at(u, v)] == 0 || height[s.at(u, v)] == kNoHeight) continue;
      std::size_t n = 0;
      for (int dv = -2; dv <= 2; ++dv)
        for (int du = -2; du <= 2; ++du) {
          if (u + du < 0 || v + dv < 0 || u + du >= s.edge || v + dv >= s.edge) continue;
          const std::int32_t h = height[s.at(u + du, v + dv)];
          if (h != kNoHeight) near[n++] = h;
        }
      const auto middle = near.begin() + static_cast<std::ptrdiff_t>((n - 1) / 2);
      std::nth_element(near.begin(), middle, near.begin() + static_cast<std::ptrdiff_t>(n));
      out[s.at(u, v)] = *middle;
    }
  return out;
}

}  // namespace tessera
