/// \file tangent_planes.h
/// Least-squares intersection of the tangent planes of one loop, and its correction for curved sheets.
/// Source: thesis 4.2.2 (pseudo-inverse with the smallest singular value clamped).
#pragma once
#include <array>

#include "octree/lattice.h"

namespace tessera {

inline constexpr std::size_t kMaxPlanes =
    24;  ///< a loop has at most one root on every edge of a cell, two have two
/// Bent or not, tangent planes err more with distance, so near roots count more: weight 1 / (distance^2 + this).
inline constexpr double kPlaneNearness = 0.05;

/// Planes normal.(x - point) = offset, weighted.
struct TangentPlanes {
  std::size_t size = 0;
  std::array<Double3, kMaxPlanes> point;
  std::array<Double3, kMaxPlanes> normal;
  std::array<double, kMaxPlanes> offset;
  std::array<double, kMaxPlanes> weight;
};

struct PlaneIntersection {
  Double3 position = {0, 0, 0};  ///< the least-squares point nearest to the anchor
  double min_spread = 0.0;       ///< smallest over largest eigenvalue: squared ratio of singular values
};

/// Pseudo-inverse by eigenvectors of the normal equations; only + - * / sqrt.
/// \param rank  singular values kept: 2 for a crease, 3 for a corner; those near zero are always dropped
[[nodiscard]] PlaneIntersection intersect_planes(const TangentPlanes& planes, const Double3& anchor,
                                                 int rank);

/// The same for a crease of known direction (unit, the cross product of two of the normals, `any` one of
/// these): cheaper, and good for a first guess.
[[nodiscard]] Double3 intersect_crease(const TangentPlanes& planes, const Double3& anchor,
                                       const Double3& direction, std::size_t any);

/// Replaces the normals of the planes whose sheet is `sheet` by the mean of their own and that of the sheet
/// at x, which a linear fit of the sheet's normals predicts: on a quadric, the plane through a root with this
/// normal passes exactly through the surface at x. Planes of a single root stay as they are.
void extrapolate_normals(TangentPlanes& planes, const std::array<int, kMaxPlanes>& sheets, int sheet,
                         const Double3& x);

}  // namespace tessera
