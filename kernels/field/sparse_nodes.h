/// \file sparse_nodes.h
/// Where samples lie too far apart for the cells of a lattice, but perhaps not for cells of twice the edge.
///
/// A surface that samples cover passes four times as many cells as coarse cells, scan lines twice as many, lone points
/// one each. The ratio is counted in a cube of six coarse cells around every node of the coarse lattice, and in its halves, so that
/// what lies between dense samples and sparse ones counts: the rim of a hole amid dense samples, whose cells are nearly full
/// on all sides, is none of these places, and what lies between far scan lines is.
#pragma once
#include <array>
#include <cstdint>
#include <functional>
#include <vector>

#include "octree/points.h"

namespace tessera {

class SparseNodes {
 public:
  /// \param points  of a block, within a leaf of its core at least, canonical order; those without normal do not count
  /// \param requested  which leaves of the coarse block matter, relative to it, in leaves; nodes of others are nowhere; empty = all
  explicit SparseNodes(const PointBlock& points, const std::function<bool(const Int3&)>& requested = {});

  /// The block of the coarse lattice that holds all nodes of the fine one: corner and size in coarse cells, whole leaves.
  [[nodiscard]] const Int3& origin() const { return origin_; }
  [[nodiscard]] const Int3& cells() const { return cells_; }
  [[nodiscard]] bool any() const { return !depth_.empty(); }
  /// How far within such a place a node lies, as border depths go (border.h), in fine cells, at most kDeep; kNowhere where
  /// there is no sample at all or they lie densely.
  /// \param node  relative to origin(), within [-1, cells() + 1]
  [[nodiscard]] float depth(const Int3& node) const {
    const std::int32_t leaf =
        leaf_index_[index_of({node[0] >> kLeafBits, node[1] >> kLeafBits, node[2] >> kLeafBits})];
    if (leaf < 0) return kNowhere;
    return depth_[static_cast<std::size_t>(leaf)]
                 [static_cast<std::size_t>((node[0] & 7) + 8 * (node[1] & 7) + 64 * (node[2] & 7))];
  }

  static constexpr float kDeep = 1.0f, kNowhere = -1.0f;

 private:
  std::size_t index_of(const Int3& leaf) const {
    return static_cast<std::size_t>(((leaf[2] + 1) * (cells_[1] / kLeafCells + 2) + leaf[1] + 1) *
                                        (cells_[0] / kLeafCells + 2) +
                                    leaf[0] + 1);
  }

  Int3 origin_{}, cells_{};
  std::vector<std::int32_t> leaf_index_;  ///< as DirectedField has it; -1: all nodes are nowhere
  std::vector<std::array<float, 512>> depth_;
};

}  // namespace tessera
