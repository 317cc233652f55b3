/// \file directed_field.h
/// The band of one block: signs and values at lattice nodes near the surface, and directed distances
/// with normals on the lattice edges that the surface crosses.
/// Source: thesis 4.2.1 (directed distance fields).
///
/// Nodes come in leaves of 8^3, aligned to the lattice, stored only where the band is. Node coordinates
/// are relative to the block's min corner and run over [-1, cells + 1] on each axis: the kernel that extracts the
/// block needs one halo cell below it (for flips across its min faces) and one above it (to know where it ends).
#pragma once
#include <bit>
#include <cstdint>
#include <vector>

#include "kernels/field/band_leaf.h"
#include "octree/vector.h"

namespace tessera {

/// Where the surface crosses the lattice edge from a node in +axis direction.
struct EdgeRoot {
  float t = 0.5f;             ///< directed distance from the node along the axis, in cells, within (0, 1)
  Float3 normal = {0, 0, 0};  ///< unit, outward (from inside to outside)
  float offset = 0.0f;        ///< the tangent plane is n.(x - root) = offset, cells; 0 unless t was clamped
  std::uint32_t rgba = 0;     ///< colour near the root, alpha 0 = none
  bool slides = false;        ///< clamped beside a smooth stretch: the vertex stands on the tangent plane

  /// Where the vertex stands, from the root: there, unless it slides.
  [[nodiscard]] Float3 slide_offset() const { return slides ? normal * offset : Float3{0, 0, 0}; }
};

/// How far a vertex moves from its lattice edge, along the surface onto the border.
struct BorderMove {
  std::uint32_t root = 0;
  Float3 by = {0, 0, 0};  ///< cells
};

/// The band of a block.
struct DirectedField {
  Int3 origin = {0, 0, 0};  ///< global cell coordinates of the block's min corner
  Int3 cells = {0, 0, 0};   ///< core size; nodes run over [-1, cells + 1]
  /// Dense (cells/8 + 2)^3 table, x fastest, -1 = no leaf; leaf -1 first.
  std::vector<std::int32_t> leaf_index;
  std::vector<BandLeaf> leaves;  ///< in table order
  std::vector<EdgeRoot> roots;   ///< by leaf, axis, word, bit
  /// Noisy samples: per root of the fits, whether there is a crease at one of its nodes. Only such roots tell of features,
  /// for normals alone bend where noise is too. Empty: all do.
  std::vector<std::uint8_t> creased;
  std::vector<BorderMove> moves;  ///< ascending; of what BandLeaf::moving marks, the rest stays

  [[nodiscard]] Int3 leaf_dims() const { return {cells[0] / 8 + 2, cells[1] / 8 + 2, cells[2] / 8 + 2}; }

  /// Leaf that holds node (i,j,k), each coordinate within [-1, cells + 1]; null where the band is not.
  [[nodiscard]] const BandLeaf* leaf_at(int i, int j, int k) const {
    const Int3 d = leaf_dims();
    const auto at = ((static_cast<std::size_t>((k >> 3) + 1) * static_cast<std::size_t>(d[1]) +
                      static_cast<std::size_t>((j >> 3) + 1)) *
                         static_cast<std::size_t>(d[0]) +
                     static_cast<std::size_t>((i >> 3) + 1));
    const std::int32_t leaf = leaf_index[at];
    return leaf < 0 ? nullptr : &leaves[static_cast<std::size_t>(leaf)];
  }

  /// The next leaf along an axis; null where the field ends or the band is not.
  [[nodiscard]] const BandLeaf* leaf_after(const BandLeaf& leaf, std::size_t axis) const {
    Int3 after = leaf.origin;
    after[axis] += kLeafCells;
    return after[axis] <= cells[axis] ? leaf_at(after[0], after[1], after[2]) : nullptr;
  }

  [[nodiscard]] static constexpr int word(int k) { return k & 7; }
  [[nodiscard]] static constexpr int bit(int i, int j) { return (i & 7) + 8 * (j & 7); }

  /// Root on the edge from node (i,j,k) in +axis direction; null if the edge is not crossed.
  [[nodiscard]] const EdgeRoot* root_at(int i, int j, int k, int axis) const {
    const BandLeaf* leaf = leaf_at(i, j, k);
    if (!leaf) return nullptr;
    const auto a = static_cast<std::size_t>(axis);
    const auto w = static_cast<std::size_t>(word(k));
    const std::uint64_t mask = leaf->crossing[a][w];
    const std::uint64_t mine = std::uint64_t{1} << bit(i, j);
    if (!(mask & mine)) return nullptr;
    return &roots[leaf->first_root[a][w] + static_cast<std::uint32_t>(std::popcount(mask & (mine - 1)))];
  }
};

}  // namespace tessera
