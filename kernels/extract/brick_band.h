/// \file brick_band.h
/// The part of a band that decides the mesh of one brick, as bit masks leaf by leaf: which cells take part,
/// which of them the surface crosses, and the numbers of the vertices on their edges.
///
/// Leaves run over [-1, 8] on each axis, relative to the brick. Cells of leaves -1 and 8 are the halo (their cells
/// next to the brick only), nodes of leaf 8 lie on the max faces: their edge points belong to other bricks.
///
/// Four cells meet in a lattice edge along axis a (u = a+1, v = a+2 mod 3), by their sides of it:
///
///      v
///      |  C | D       A (u-, v-)  B (u+, v-)  C (u-, v+)  D (u+, v+)
///      |  --+--       the node is the min corner of D, so D's brick owns the edge point
///      |  A | B
///      +------- u
///
/// Only in two cases do valid cells fail to form one fan: {A, D} and {B, C}. The point is then two vertices:
/// `type a` in cells A and B, `type a+3` in C and D. Otherwise it is `type a`. Every brick that names the point sees
/// all four cells, so all use the same name.
#pragma once
#include <array>
#include <bit>
#include <cstdint>
#include <vector>

#include "kernels/field/directed_field.h"

namespace tessera {

inline constexpr int kBrickLeaves = kBrickCells / kLeafCells;
inline constexpr int kBandDim = kBrickLeaves + 2;
inline constexpr std::uint32_t kSplitVertex = 0x40000000u;  ///< own point with two vertices

struct LeafMasks {
  const BandLeaf* leaf = nullptr;
  Int3 at = {0, 0, 0};  ///< leaf coordinates relative to the brick, each within [-1, 8]
  bool any_active = false;
  LeafWords valid{}, inside{};  ///< the leaf's nodes
  LeafWords cells{};            ///< valid cells, those that close holes among them
  LeafWords active{};           ///< valid cells with corners on both sides
  std::array<std::uint32_t, 8> first_cell{};
  std::array<LeafWords, 3> edges{};   ///< crossed edges of valid cells
  std::array<LeafWords, 3> split{};   ///< of these: two vertices
  std::array<LeafWords, 3> border{};  ///< of these: not all four cells are valid
  std::array<std::array<std::uint32_t, 8>, 3> first_vertex{};
  std::array<std::array<std::uint32_t, 8>, 3> first_split{};
  [[nodiscard]] bool own() const {
    for (int c : at)
      if (c < 0 || c >= kBrickLeaves) return false;
    return true;
  }
  [[nodiscard]] std::uint32_t cell_rank(int x, int y, int z) const {
    const auto w = static_cast<std::size_t>(z);
    const std::uint64_t below = (std::uint64_t{1} << (x + 8 * y)) - 1;
    return first_cell[w] + static_cast<std::uint32_t>(std::popcount(active[w] & below));
  }
};

class BrickBand {
 public:
  /// Collects the masks of a brick.
  /// \param corner  node coordinates of its min corner relative to the block
  /// \param with_halo  also the active cells next to the min faces
  void collect(const DirectedField& field, const Int3& corner, bool with_halo);

  /// Leaf that holds node or cell leaf coordinates (i, j, k), each within [-1, 8]; null if the band is not
  /// there.
  [[nodiscard]] const LeafMasks* at(int i, int j, int k) const {
    const std::int16_t index = index_[slot(i, j, k)];
    return index < 0 ? nullptr : &masks_[static_cast<std::size_t>(index)];
  }
  /// Own leaves in Morton order, then those of the halo and of the max faces.
  [[nodiscard]] const std::vector<LeafMasks>& leaves() const { return masks_; }
  /// Words of a leaf's nodes seen from its cells: [z][dx + 2 dy] holds at (x, y) the node (x+dx, y+dy, z), z
  /// in 0..8.
  using CornerWords = std::array<std::array<std::uint64_t, 4>, 9>;
  CornerWords corner_words(const LeafMasks& m, LeafWords LeafMasks::*words) const;

  /// Cells of the brick of which some neighbour across a face takes no part.
  [[nodiscard]] LeafWords boundary_cells(const LeafMasks& m) const;
  /// Whether a cell of brick or halo takes part, each coordinate within [-1, 64].
  [[nodiscard]] bool takes_part(const Int3& cell) const {
    const LeafMasks* m = at(cell[0] >> kLeafBits, cell[1] >> kLeafBits, cell[2] >> kLeafBits);
    return m && (m->cells[static_cast<std::size_t>(cell[2] & 7)] >> ((cell[0] & 7) + 8 * (cell[1] & 7)) & 1);
  }

  [[nodiscard]] std::uint32_t own_edge_vertices() const { return own_vertices_; }
  [[nodiscard]] std::uint32_t foreign_edge_vertices() const { return foreign_vertices_; }
  [[nodiscard]] std::uint32_t active_cells() const { return active_cells_; }

 private:
  static std::size_t slot(int i, int j, int k) {
    return static_cast<std::size_t>((i + 1) + kBandDim * ((j + 1) + kBandDim * (k + 1)));
  }
  void find_leaves(const DirectedField& field, const Int3& corner);
  void mark_cells(LeafMasks& m, bool with_halo);
  void mark_edges(LeafMasks& m) const;
  void number(LeafMasks& m);

  std::array<std::int16_t, kBandDim * kBandDim * kBandDim> index_;
  std::vector<LeafMasks> masks_;
  std::uint32_t own_vertices_ = 0;
  std::uint32_t foreign_vertices_ = 0;
  std::uint32_t active_cells_ = 0;
};

}  // namespace tessera
