/// \file bodies.h
/// Closed bodies around points that lie strewn through space instead of on a surface: crowns, hedges, spray.
///
/// Such points have no normal. Their body is where the density of occupied cells exceeds a level, which a smooth kernel
/// makes a smooth surface. Its signed distance, to first order, joins that of the oriented points by the minimum: what
/// they tell inside a body is gone, so bodies stand on the ground and swallow the shreds within them.
#pragma once
#include <cstdint>
#include <vector>

#include "kernels/field/band.h"
#include "kernels/field/node_fit.h"
#include "kernels/field/point_leaves.h"

namespace tessera {

/// How far from a strewn point the density reaches, cells.
inline constexpr float kBodyRadius = 4.0f;

/// The points of a block that have no normal, one of each cell: the first in canonical order.
[[nodiscard]] PointBlock volumetric_points(const PointBlock& points);

/// Adds the leaves that strewn points reach to the band, without any nodes; it stays in table order.
/// \param volumetric  index of volumetric_points
void add_body_leaves(const PointLeaves& volumetric, std::vector<BandNodes>& band);

/// The points of a block that tell of bodies. \param coarse  mean normals of the oriented ones (average_normals)
struct BodyPoints {
  const PointBlock& volumetric;
  const PointLeaves& volumetric_leaves;
  const PointBlock& coarse;
  const PointLeaves& coarse_leaves;
};

/// Scratch that a caller keeps between leaves.
struct BodyScratch {
  SampleList samples, slab, coarse;
  RowSamples row;
};

/// Joins the bodies near a leaf with what the oriented points say there.
/// \param nodes   those of the leaf that may get a value
/// \param boundary     where a node lies beyond the end of the surface, the body alone tells
/// \param sheets  those of creases inside bodies go
/// \pre   the sheets of `fit` are the last of `sheets`
void join_bodies(const BodyPoints& points, const Int3& leaf, const std::array<std::uint64_t, 8>& nodes,
                 BodyScratch& scratch, LeafFit& fit, LeafBoundary& boundary, std::vector<Sheets>& sheets);

}  // namespace tessera
