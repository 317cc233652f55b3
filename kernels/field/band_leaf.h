/// \file band_leaf.h
/// 8^3 lattice nodes of the band. Values and validity are an OpenVDB leaf, so that grids, level-set tools and
/// boolean operations take them as they are; what only the mesh needs lies in words beside it.
///
/// Words of this project run along x: bit x + 8 y of word z, and node x + 8 y + 64 z. OpenVDB's run along z: the
/// accessors swap the two, a node by one shift, 512 bits by twelve exchanges.
#pragma once
#include <openvdb/version.h>

#include <array>
#include <cstddef>
#include <cstdint>
#include <memory>

#include "octree/lattice.h"

// OpenVDB's headers cost seconds a file: vdb_leaf.h is for the few that look into a leaf.
namespace openvdb {
OPENVDB_USE_VERSION_NAMESPACE
namespace OPENVDB_VERSION_NAME::tree {
template <typename T, std::uint32_t Log2Dim>
class LeafNode;
}  // namespace OPENVDB_VERSION_NAME::tree
}  // namespace openvdb

namespace tessera {

using LeafWords = std::array<std::uint64_t, 8>;  ///< a bit per node or cell of a leaf
using VdbLeaf = openvdb::tree::LeafNode<float, kLeafBits>;

inline constexpr float kBandBackground = 3.0f;  ///< value of nodes without one, cells: beyond any in the band

/// Words along z of words along x, and the other way round.
[[nodiscard]] inline LeafWords swap_x_and_z(LeafWords words) {
  constexpr std::array<std::uint64_t, 3> kLow = {0x5555555555555555ULL, 0x3333333333333333ULL,
                                                 0x0f0f0f0f0f0f0f0fULL};
  for (std::size_t level = 0; level < kLow.size(); ++level) {
    const std::size_t step = std::size_t{1} << level;
    for (std::size_t low = 0; low < words.size(); ++low) {
      if (low & step) continue;
      std::uint64_t &a = words[low], &b = words[low + step];
      const std::uint64_t differ = ((a >> step) ^ b) & kLow[level];
      b ^= differ;
      a ^= differ << step;
    }
  }
  return words;
}

class BandLeaf {
 public:
  /// \param block  node coordinates of the block's min corner on the lattice
  /// \param origin  see below
  BandLeaf(const Int3& block, const Int3& origin);

  [[nodiscard]] static constexpr std::size_t node(int i, int j, int k) {
    return static_cast<std::size_t>((i & 7) + 8 * (j & 7) + 64 * (k & 7));
  }
  /// Signed distance in cells, < 0 inside.
  float& value(std::size_t node) { return values_[vdb_offset(node)]; }
  [[nodiscard]] float value(std::size_t node) const { return values_[vdb_offset(node)]; }

  /// The field is defined here.
  [[nodiscard]] LeafWords valid() const {
    LeafWords words;
    for (std::size_t x = 0; x < words.size(); ++x) words[x] = mask_[x];
    return swap_x_and_z(words);
  }
  void set_valid(const LeafWords& nodes) {
    const LeafWords words = swap_x_and_z(nodes);
    for (std::size_t x = 0; x < words.size(); ++x) mask_[x] = words[x];
  }
  [[nodiscard]] bool is_valid(std::size_t node) const {
    return mask_[node & 7] >> (vdb_offset(node) & 63) & 1;
  }

  [[nodiscard]] const VdbLeaf& vdb() const { return *vdb_; }
  /// Hands the leaf over, to a tree for one; this may only be destroyed then.
  VdbLeaf* release() { return vdb_.release(); }

  Int3 origin;          ///< node coordinates of the min corner, relative to the block, multiples of 8
  LeafWords inside{};   ///< exactly 0 counts as outside; of valid nodes and closing cells
  LeafWords closing{};  ///< cells that take part though not all of their nodes are valid
  LeafWords unseen{};   ///< cells whose faces nobody saw: unseen_cells.h
  LeafWords quiet{};    ///< cells that are traced elsewhere: where levels meet (brick_levels.h)
  std::array<LeafWords, 3> crossing{};                       ///< per axis: the edge from this node has a root
  std::array<std::array<std::uint32_t, 8>, 3> first_root{};  ///< index of the first root of each word
  LeafWords ended{};        ///< cells beyond the border: they take no part though all nodes are valid
  bool any_moving = false;  ///< whether any of:
  std::array<LeafWords, 3> moving{};  ///< per axis: roots on or beyond the border

 private:
  struct Delete {
    void operator()(VdbLeaf* leaf) const noexcept;
  };
  static constexpr std::size_t vdb_offset(std::size_t node) {
    return (node & 7) << 6 | (node & 56) | node >> 6;
  }

  std::unique_ptr<VdbLeaf, Delete> vdb_;
  float* values_;        ///< of the leaf's buffer
  std::uint64_t* mask_;  ///< of the leaf's value mask
};

}  // namespace tessera
