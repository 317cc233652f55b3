/// \file chart_overlap.h
/// Which triangles of a chart lie over others in the plane.
#pragma once
#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "octree/vector.h"

namespace tessera {

/// Whether the interiors of two triangles meet by more than `tolerance` along each of six directions: the separating axes of
/// convex polygons. Triangles that share a corner or an edge and lie beside each other do not. Orientations do not matter.
[[nodiscard]] bool triangles_overlap(const std::array<Double2, 3>& a, const std::array<Double2, 3>& b,
                                     double tolerance);

/// Indices of triangles, ascending, that overlap one before them that is not among them: without these no two overlap.
/// Triangles without area overlap none. \param uv  finite
/// \param rounding  of the extent of all: what rounding of coordinates may let neighbours overlap by
[[nodiscard]] std::vector<std::uint32_t> overlapping_faces(
    std::span<const Double2> uv, std::span<const std::array<std::uint32_t, 3>> faces, double rounding = 1e-9);

}  // namespace tessera
