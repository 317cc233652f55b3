/// \file distance_octree.h
/// A distance field as an adaptive octree: cells are halved until the tri-linear field of their corners is within a
/// tolerance of the distance (thesis 2.2; Frisken, Perry, Rockwood, Jones, "Adaptively Sampled Distance Fields", 2000).
#pragma once
#include <array>
#include <cstdint>
#include <functional>
#include <vector>

#include "octree/lattice.h"

namespace tessera {

/// Nodes by levels, the cube first, within a level in the order of their parents, eight children (x fastest) side by side.
/// A node is known by one bit, so the children of the n-th node that is halved are nodes 8 n + 1 to 8 n + 8.
class DistanceOctree {
 public:
  /// \param corner  of the cube, lattice nodes  \param edge  cells, a power of two
  DistanceOctree(const Int3& corner, int edge) : corner_(corner), edge_(edge) {}
  /// From what the accessors gave. \throws InputError when bits and values do not make an octree
  DistanceOctree(const Int3& corner, int edge, std::vector<std::uint64_t> halved, std::uint64_t nodes,
                 std::vector<std::array<float, 8>> cells);

  [[nodiscard]] const Int3& corner() const { return corner_; }
  [[nodiscard]] int edge() const { return edge_; }
  [[nodiscard]] std::uint64_t nodes() const { return nodes_; }
  [[nodiscard]] const std::vector<std::uint64_t>& halved() const { return halved_; }  ///< a bit a node
  /// Per node that is not halved, in order: values at its corners (x fastest), cells, < 0 inside.
  [[nodiscard]] const std::vector<std::array<float, 8>>& cells() const { return cells_; }
  /// The field at a point of the cube, both in cells of the lattice.
  double at(const Double3& p) const;
  /// Cells by their size: entry k has edges of 2^k.
  [[nodiscard]] std::vector<std::uint64_t> sizes() const;

 private:
  friend class OctreeBuilder;
  bool is_halved(std::uint64_t node) const { return halved_[node / 64] >> (node % 64) & 1; }
  void count();

  Int3 corner_;
  int edge_;
  std::uint64_t nodes_ = 0;
  std::vector<std::uint64_t> halved_;
  std::vector<std::uint64_t> before_;  ///< nodes that are halved before each word
  std::vector<std::array<float, 8>> cells_;
};

/// In a cell of the lattice a distance is so near to the tri-linear field of its corners wherever two sheets meet, cells.
inline constexpr double kBetweenNodes = 0.5;

/// Halves cells down to those of the lattice. One stays whole if its field is within `tolerance` less kBetweenNodes of the
/// distance at all its nodes, or at 9^3 of them: so between the nodes it is within the tolerance.
/// \param distance  at a node of the lattice, cells, < 0 inside; asked for once or a few times each
/// \param tolerance  cells, at least 2 kBetweenNodes
DistanceOctree build_distance_octree(const Int3& corner, int edge, double tolerance,
                                     const std::function<double(const Int3&)>& distance,
                                     const std::function<void()>& pause = {});

/// Memory of so many cells while they are made.
[[nodiscard]] constexpr std::uint64_t distance_octree_bytes(std::uint64_t cells) {
  return cells * 3 * (32 + 2) + (std::uint64_t{2} << 20);
}

}  // namespace tessera
