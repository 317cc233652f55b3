/// \file offset_field.h
/// Parallel surfaces of a closed mesh: what lies between two signed distances of it, as directed distances.
/// Source: thesis 2.2, 4.2.1. Outward offsets of convex edges are round, those of concave ones are creases of the field, which
/// the extractor finds by the normals of its roots; inward it is the other way round. With a mitre the planes beside a crease
/// go on until they meet: there the distance is the largest of those from its sheets.
#pragma once
#include <limits>

#include "kernels/field/sampled_field.h"
#include "kernels/mesh/signed_distance.h"
#include "kernels/mesh/triangle_foot.h"
#include "kernels/solid/crease_sheets.h"
#include "kernels/solid/row_signs.h"

namespace tessera {

/// Inside is where low < signed distance < high, cells.
struct OffsetLayer {
  double low = -std::numeric_limits<double>::infinity();
  double high = 0.0;
  double mitre =
      1.0;  ///< where sheets go on, no tip lies farther from the surface than this times the distance; 1 = round

  /// Nodes that matter are no farther from the surface.
  double max_distance() const;
  /// Whether, at most `radius` from a point this far from the surface, a side of the layer may pass.
  [[nodiscard]] bool may_pass(double away, bool inside, double radius) const;
};

/// The mesh around a block.
class OffsetSampler : public FieldSampler {
 public:
  /// How far beyond OffsetLayer::reach() faces must be in the block, cells: what nodes at a layer's sides ask for, and
  /// whole stars of the vertices.
  static constexpr double kMargin = 8.0;
  static constexpr double kNear = 2.0;  ///< beyond the diagonal of a cell

  /// \param faces  positions in cells from the block's corner, quantise_cells()  \param corner  of the block, global
  /// \param signs  of the whole mesh
  /// \param near  nodes farther from the layer's sides take no part, cells
  OffsetSampler(MeshBlock&& faces, const Int3& corner, const RowSigns& signs, const OffsetLayer& layer,
                double near = kNear);
  [[nodiscard]] Sample at(const Int3& node, std::size_t axis, double t) const override;
  [[nodiscard]] bool inside(const Int3& node) const;  ///< of the mesh
  /// Leaves of the block in which a side of the layer may pass, as build_sampled_field() takes them.
  [[nodiscard]] std::vector<Int3> leaves(const Int3& cells) const;

  /// What build_sampled_field() is to take for near: with a mitre the sampler says itself which nodes take part.
  double near() const { return layer_.mitre > 1.0 ? std::numeric_limits<double>::infinity() : near_; }

  /// Upper bound of what it holds, the block included.
  [[nodiscard]] static constexpr std::uint64_t bytes(std::uint64_t vertices, std::uint64_t faces) {
    return SignedDistance::bytes(vertices, faces) + vertices * 48 + faces * 16 +
           CreaseSheets::bytes(vertices, faces);
  }

 private:
  double between(double distance) const;  ///< value of the layer at this signed distance
  /// The distance from the sheets around a foot, at least 1 / mitre of that from the foot, interpolated from the corners of its
  /// face, so that it is continuous wherever the foot goes.
  /// \param on  the foot on that face, seen from p  \param[in,out] outward  p's direction from the foot, then the distance's
  double mitred(const std::array<std::uint32_t, 3>& face, const TriangleFoot& on,
                const std::array<Double3, 3>& corner, double away, double side, Double3& outward) const;
  /// Whether a side may pass a cube of leaves around a node, or the nodes beside it.
  bool may_pass(const Int3& middle, int edge) const;
  void search(const Int3& cells, const Int3& leaf, int edge, std::vector<Int3>& out) const;

  MeshBlock faces_;
  SignedDistance surface_;
  CreaseSheets sheets_;  ///< with a mitre
  Int3 corner_;
  OffsetLayer layer_;
  double near_, limit_square_;
  // What was asked last: points come one beside the other. It changes no result.
  mutable NodeSigns signs_;
  mutable std::uint32_t hint_ = SignedDistance::kNone;
};

/// Positions of a block in cells from a node, to 2^-20 cells: then what is between a point and a face is the same number
/// from every node.
void quantise_cells(const Lattice& lattice, const Int3& corner, MeshBlock& block);

}  // namespace tessera
