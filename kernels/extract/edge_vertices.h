/// \file edge_vertices.h
/// Vertices on the lattice edges that the surface crosses: where they are, and where cells find them.
#pragma once
#include <array>
#include <cstdint>
#include <vector>

#include "kernels/extract/border_shift.h"
#include "kernels/extract/brick_band.h"
#include "kernels/extract/feature_sample.h"
#include "kernels/extract/patch_builder.h"

namespace tessera {

/// The own ones in the order of their numbers, the names under which other bricks know them, and the keys of those on the
/// max faces, which belong to other bricks.
void emit_edge_vertices(const DirectedField& field, const BrickBand& band, BorderShift& border,
                        PatchBuilder& patch);

/// One loop of a cell: the vertices that faces name, and roots.
struct TracedLoop {
  Int3 cell;            ///< relative to the brick; -1 on one axis for the halo
  int number;           ///< loop of the cell
  LoopSamples samples;  ///< size, edges, points
  std::array<std::uint32_t, kCellEdges> vertex, root;

  [[nodiscard]] std::size_t size() const { return static_cast<std::size_t>(samples.size); }
  [[nodiscard]] std::size_t after(std::size_t i) const { return i + 1 == size() ? 0 : i + 1; }
};
/// Middle of the points, relative to the cell.
[[nodiscard]] Float3 mean_point(const TracedLoop& loop);
[[nodiscard]] std::uint32_t mean_colour(const DirectedField& field, const TracedLoop& loop);

/// Numbers of the vertices and roots around a leaf, so that its cells find theirs by a load.
class LeafEdges {
 public:
  void collect(const BrickBand& band, const LeafMasks& leaf);

  /// Whether vertices of the leaf may move onto a border.
  [[nodiscard]] bool moving() const { return moving_; }
  /// Of an edge of a cell, kNone where no cell around it is valid. \param cell  relative to the brick, of the leaf
  [[nodiscard]] std::uint32_t vertex(const Int3& cell, int edge) const {
    const std::uint32_t v = vertex_[slot(cell, edge)];
    if (v == kNone || (v & (kForeignVertex | kSplitVertex)) != kSplitVertex) return v;
    return pairs_[v & ~kSplitVertex][edge >> 1 & 1 ? 0 : 1];  // offset 1 along v: cell A or B
  }
  [[nodiscard]] std::uint32_t root(const Int3& cell, int edge) const { return root_[slot(cell, edge)]; }
  /// \param edge  `size` edges of the cell
  [[nodiscard]] TracedLoop loop(const DirectedField& field, const Int3& cell, int number,
                                const std::uint8_t* edge, std::size_t size) const;

  static constexpr std::uint32_t kNone = 0xffffffffu;

 private:
  static constexpr std::size_t kNodes = 9 * 9 * 9;
  static std::size_t slot(const Int3& cell, int edge) {
    return static_cast<std::size_t>((cell[0] & 7) + 9 * (cell[1] & 7) + 81 * (cell[2] & 7)) +
           kEdgeSlot[static_cast<std::size_t>(edge)];
  }
  static constexpr std::array<std::uint16_t, kCellEdges> kEdgeSlot = [] {
    std::array<std::uint16_t, kCellEdges> slots{};
    for (int e = 0; e < kCellEdges; ++e)
      slots[static_cast<std::size_t>(e)] =
          static_cast<std::uint16_t>((e >> 2) * static_cast<int>(kNodes) + edge_offset(e, 0) +
                                     9 * edge_offset(e, 1) + 81 * edge_offset(e, 2));
    return slots;
  }();

  /// By axis, then 9^3 nodes; of crossed edges.
  std::array<std::uint32_t, 3 * kNodes> vertex_, root_;
  std::vector<std::array<std::uint32_t, 2>> pairs_;  ///< vertices of cells A, B and of cells C, D
  bool moving_ = false;
};

}  // namespace tessera
