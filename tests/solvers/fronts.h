/// \file fronts.h
/// What tests of multifrontal factors share.
#pragma once
#include <cmath>
#include <cstddef>
#include <utility>
#include <vector>

#include "solvers/sparse_matrix.h"

namespace tessera::test {

/// Sizes of fronts, and how many of their columns are eliminated: at the edges of tiles, of inner columns and of panels.
inline std::vector<std::pair<std::size_t, std::size_t>> front_sizes() {
  std::vector<std::pair<std::size_t, std::size_t>> out;
  for (const std::size_t size : {1, 2, 5, 8, 9, 31, 97, 200, 233})
    for (const std::size_t eliminated : {std::size_t{1}, size / 3, size / 2, size - 1, size})
      if (eliminated >= 1) out.emplace_back(size, eliminated);
  return out;
}

/// Right-hand sides, interleaved.
inline std::vector<double> load_of(const SparseMatrix& a, int width) {
  std::vector<double> b(static_cast<std::size_t>(a.rows) * static_cast<std::size_t>(width));
  for (std::size_t i = 0; i < b.size(); ++i) b[i] = std::sin(1.7 * static_cast<double>(i));
  return b;
}

}  // namespace tessera::test
