/// \file point_leaves.h
/// The points of a block by leaf of 8^3 cells. Canonical order makes every leaf one contiguous range, so
/// this is an index, not a copy.
#pragma once
#include <cstdint>
#include <vector>

#include "octree/points.h"

namespace tessera {

/// Dense table of leaves (cells/8 + 2 per axis, x fastest, leaf -1 first), the layout of DirectedField.
struct PointLeaves {
  struct Range {
    std::uint32_t begin = 0;
    std::uint32_t end = 0;
  };
  Int3 dims = {0, 0, 0};
  std::vector<Range> range;                         ///< per leaf: its points
  std::vector<std::uint32_t> occupied;              ///< leaves that hold a nearest node, ascending
  std::vector<std::int32_t> mark_index;             ///< per leaf: index into marks, -1 = none
  std::vector<std::array<std::uint64_t, 8>> marks;  ///< nodes that are the nearest one of a point

  /// Marks of a leaf, null if it has none.
  [[nodiscard]] const std::array<std::uint64_t, 8>* marks_of(std::size_t leaf) const {
    return mark_index[leaf] < 0 ? nullptr : &marks[static_cast<std::size_t>(mark_index[leaf])];
  }
  [[nodiscard]] std::size_t at(int i, int j, int k) const {
    return (static_cast<std::size_t>(k + 1) * static_cast<std::size_t>(dims[1]) +
            static_cast<std::size_t>(j + 1)) *
               static_cast<std::size_t>(dims[0]) +
           static_cast<std::size_t>(i + 1);
  }
  [[nodiscard]] bool holds(int i, int j, int k) const {
    return i >= -1 && j >= -1 && k >= -1 && i < dims[0] - 1 && j < dims[1] - 1 && k < dims[2] - 1;
  }
};

/// Indexes the points within 8 cells of the block's core; farther ones and those without normal are left out
/// of the marks (the ranges keep the latter: whoever gathers skips them).
/// \pre points in canonical order, at most 2^32 - 1 of them
/// \param mark  fill the marks too
[[nodiscard]] PointLeaves index_leaves(const PointBlock& points, bool mark);

}  // namespace tessera
