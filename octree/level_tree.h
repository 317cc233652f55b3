/// \file level_tree.h
/// Bricks of several sizes: an octree over the lattice whose leaves are bricks of 64 2^k cells of it, k their level. Leaves that
/// touch, also at an edge or a corner, differ by one level at most.
#pragma once
#include <array>
#include <cstddef>
#include <cstdint>
#include <utility>
#include <vector>

#include "octree/lattice.h"

namespace tessera {

inline constexpr int kMaxLevels = 8;

class LevelTree {
 public:
  /// All bricks of the coarsest level, where `split` does not say otherwise.
  /// \param levels  1 .. kMaxLevels
  /// \param split   per level from 1 on ([0] is not used): Morton codes, on their level, of the nodes that are no leaves, in any
  ///                order; further ones are split where leaves would differ too much, and all above them
  LevelTree(int levels, std::vector<std::vector<std::uint64_t>> split);

  [[nodiscard]] int levels() const { return static_cast<int>(split_.size()); }
  [[nodiscard]] const std::vector<std::vector<std::uint64_t>>& split() const {
    return split_;
  }  ///< ascending, no repeats
  /// Level of the leaf that holds a brick of the finest level.
  [[nodiscard]] int level_of(const Int3& brick) const;
  /// Levels of the 26 bricks around a leaf relative to its own, as LevelSurroundings has them: -1, 0 or 1. What lies beyond the lattice is
  /// of its level.
  /// \param leaf  coordinates on its level
  [[nodiscard]] std::array<int, 27> steps_around(const Int3& leaf, int level) const;
  /// Whether a node of a level from 1 on is no leaf, given that it is part of the tree.
  [[nodiscard]] bool is_split(const Int3& node, int level) const;

 private:
  std::vector<std::vector<std::uint64_t>> split_;
};

}  // namespace tessera
