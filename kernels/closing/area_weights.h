/// \file area_weights.h
/// The piece of surface that every point of a scan stands for.
///
/// Per voxel of 4^3 cells and side of the surface: the area of the mean plane within the voxel, divided among
/// the points there. So a spot that ten scans have seen weighs as much as one that a single scan has. Where
/// normals differ, points get more, so that their area-weighted normals sum up to that of the plane: by the
/// divergence theorem it is that of the surface itself, however it bends inside the voxel. No point stands for more than
/// 1.5 cells^2.
#pragma once
#include <vector>

#include "octree/multipole.h"
#include "octree/points.h"

namespace tessera {

inline constexpr int kAreaVoxelCells = 4;

/// Area of the plane through `point` with unit normal `normal` within the cube [0, edge]^3.
double plane_area_in_cube(const Double3& point, const Double3& normal, double edge);

/// cells^2 per point of the block, 0 without normal.
/// \pre canonical order; a voxel's points are all there or the caller does not use its weights
/// \post a pure function of the voxel's points
[[nodiscard]] std::vector<float> area_weights(const PointBlock& points);

/// The points that have an area, with it, in the same order.
[[nodiscard]] std::vector<Dipole> make_dipoles(const PointBlock& points);

}  // namespace tessera
