/// \file mesh_shape.h
/// Area, volume, edge lengths, angles and aspect of triangles, summed without regard to order.
#pragma once
#include "octree/lattice.h"
#include "stream/check/fixed_sum.h"
#include "stream/check/mesh_check.h"
#include "stream/check/mesh_quality.h"

namespace tessera {

class MeshShape {
 public:
  /// \param min,max  bounds of all vertices that faces will name
  MeshShape(const Double3& min, const Double3& max);
  /// False when lengths cannot be summed: empty, one point, beyond 1e100. add() is then ignored.
  bool usable() const { return usable_; }
  /// Corners by ascending vertex number, so that one triangle gives the same bits however it is written.
  /// \param flip  the face runs (a, c, b); its volume counts negative
  void add(const Double3& a, const Double3& b, const Double3& c, bool flip);
  /// Hands every face with an area on to `pass`, which outlives this.
  void pass_to(MeshQualityPass& pass) { pass_ = &pass; }
  /// Fills the shape part of a check.
  void store(MeshCheck& check) const;

 private:
  bool usable_ = false;
  Double3 centre_ = {0, 0, 0};
  FixedSum area_, volume_, edges_;
  std::uint64_t faces_ = 0;
  std::uint64_t zero_area_ = 0;
  double min_edge2_ = 0, max_edge2_ = 0;
  double max_cotangent_ = 0, min_cotangent_ = 0;  ///< of the smallest and the largest angle
  double edge_ratio2_ = 0;                        ///< the largest of longest to shortest edge
  MeshQualityPass* pass_ = nullptr;
  std::array<std::uint64_t, kAspectBounds.size() + 1> aspect_ = {};
};

}  // namespace tessera
