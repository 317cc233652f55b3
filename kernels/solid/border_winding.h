/// \file border_winding.h
/// The part of a generalized winding number that the border of a mesh makes.
///
/// Source: Jacobson, Kavan, Sorkine-Hornung, "Robust Inside-Outside Segmentation using Generalized Winding Numbers", 2013,
/// and Stokes: a ribbon from every border edge to infinity in direction +x closes the mesh, so at a node
///   winding number = turns of the mesh on the way from -x infinity (an integer) + solid angle of the ribbons / (4 pi).
/// The mesh itself is never summed, only its border, and a closed one has none. Where a node lies on the shadow of a border
/// edge, the same moved node decides as in lattice_crossings.h, so the two jumps cancel exactly.
#pragma once
#include <span>
#include <vector>

#include "kernels/solid/lattice_crossings.h"

namespace tessera {

/// An edge that has `count` more faces on its left than on its right (< 0: fewer), seen from outside.
struct BorderEdge {
  Long3 a{}, b{};
  std::int64_t count = 0;
};

/// Edges that lie beside each other, and their moments: from afar these stand for them.
struct BorderCluster {
  Float3 centre{};  ///< cells
  float radius = 0.0f;
  Float3 sum{};                   ///< of the edges as vectors, cells
  std::array<float, 9> moment{};  ///< of (edge, place - centre)
  /// Of (edge, place - centre, place - centre), half, the edges' y and z: xx, yy, zz, xy, xz, yz.
  std::array<std::array<float, 6>, 2> second{};
  float length = 0.0f;
  std::uint32_t first = 0, end = 0;
  std::uint32_t left = 0;  ///< its children are left and left + 1; 0: none
};

/// Sums over clusters of edges: a pure function of the node and the set of edges, whatever their order was.
class BorderWinding {
 public:
  BorderWinding() = default;
  /// \param edges  each pair of ends at most once, counts not zero
  explicit BorderWinding(std::vector<BorderEdge> edges);

  [[nodiscard]] bool empty() const { return edges_.empty(); }
  [[nodiscard]] std::size_t size() const { return edges_.size(); }
  [[nodiscard]] std::span<const BorderEdge> edges() const { return edges_; }
  /// A tree, the first one holds all.
  [[nodiscard]] std::span<const BorderCluster> clusters() const { return clusters_; }
  static constexpr std::size_t kStack = 128;  ///< who walks the tree waits with no more
  /// Share of the winding number at a node that the border makes. Error: 1e-4 with hundreds of edges, 1e-3 with tens of
  /// thousands that contradict each other.
  double at(const Int3& node) const;
  /// Derivative of the winding number there, per cell.
  [[nodiscard]] Double3 gradient(const Double3& cells) const;
  /// Bound of how much the winding number differs between two points within `radius` of a point, but for whole turns:
  /// by first derivatives alone, or by those in the middle and a bound of the second ones.
  double change(const Double3& cells, double radius) const;

  /// Upper bound of what holding so many edges takes, and building.
  [[nodiscard]] static constexpr std::uint64_t bytes(std::uint64_t edges) {
    // Halves of a cluster of more than that many have half of them at least.
    return edges * sizeof(BorderEdge) + (1 + 4 * edges / kClusterEdges) * sizeof(BorderCluster);
  }

 private:
  static constexpr std::uint32_t kClusterEdges = 4;  ///< of a cluster without children, at most
  void split(std::uint32_t cluster);
  void sum_up(BorderCluster& c) const;

  std::vector<BorderEdge> edges_;
  std::vector<BorderCluster> clusters_;
};

}  // namespace tessera
