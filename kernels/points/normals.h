/// \file normals.h
/// Unoriented normals and neighbourhood statistics of the points of one block, for cleaning and orientation.
/// Source: Hoppe et al., "Surface Reconstruction from Unorganized Points", 1992 (tangent planes); radius capped so
/// that the halo suffices, halved where the neighbourhood bends, grown where the scan is thin (ALGORITHMS section 2).
/// Where it is dense a cell lends a part of its points, so that cost per point is bounded.
#pragma once
#include <cstdint>
#include <vector>

#include "octree/points.h"

namespace tessera {

struct NormalOptions {
  double radius_cells = 3.0;  ///< neighbours within this distance, cells, within [1, 4]
  bool estimate = true;       ///< fit planes; false = statistics only, given normals are kept
};

/// What one point's neighbourhood looks like.
struct PointShape {
  /// Unit, sign arbitrary but deterministic; zero if too few neighbours, or all on a line.
  Float3 normal = {0, 0, 0};
  /// With estimate only: l0 / (l0 + l1 + l2) of the covariance: 0 flat .. 1/3 no surface.
  float variation = 0.0f;
  /// With estimate only: the same over the widest neighbourhood that was looked at.
  float roughness = 0.0f;
  float residual = 0.0f;  ///< with estimate only: weighted RMS distance of the neighbours to the plane, cells
  std::uint16_t neighbours = 0;  ///< within the radius, the point itself not counted; of dense cells a part
  /// Of these, with a normal within 60 degrees (given normals); else = neighbours.
  std::uint16_t supporters = 0;
};

/// Cells around the core that must hold all points: the largest radius, rounded up.
[[nodiscard]] int normal_halo_cells(const NormalOptions& options);

/// Shapes of the core points of the block, in their order (points outside the core are skipped).
/// Every value is a pure function of the points within the radius: any block gives the same bits.
/// Planes of points known as ground go through such points alone, where the block tells (PointBlock::flags).
/// \pre points are complete within normal_halo_cells of the core, canonical order
/// \cost one vectorised pass over the points of the 4^3-cell cube and its halo per point
[[nodiscard]] std::vector<PointShape> estimate_shapes(const PointBlock& points, const NormalOptions& options);

}  // namespace tessera
