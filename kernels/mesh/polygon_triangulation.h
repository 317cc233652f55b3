/// \file polygon_triangulation.h
/// Triangles of a polygon in space, convex or not, with holes that bridges join to its outline (keyhole polygons).
/// Source: Meisters, "Polygons Have Ears", 1975; Held, "FIST: Fast Industrial-Strength Triangulation of Polygons", 2001;
/// normals after Newell (Sutherland et al., "A Characterization of Ten Hidden-Surface Algorithms", 1974).
#pragma once
#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "octree/vector.h"

namespace tessera {

/// Polygons with more corners than these are not taken: memory and time grow with them.
inline constexpr std::size_t kMaxPolygonCorners = std::size_t{1} << 17;

/// Appends n - 2 triangles, as positions in `corners`, that run as the polygon does.
///
/// A polygon that a fan around its first corner covers gets that fan. Any other is seen along its Newell normal, its ears
/// are clipped (inner corners look ears up in a grid), and diagonals are flipped while that widens the narrower of the two
/// triangles at them. Corners in line and repeated ones keep their place in a triangle, which has no area where nothing
/// else is possible, so edges shared with neighbours stay shared.
///
/// \pre 3 <= corners.size() <= kMaxPolygonCorners
/// \return whether the triangles cover the polygon once, all facing along its normal. If not (its outline crosses itself,
///   seen along the normal, or it has no normal though it is no line), they are as good as its corners allow: the fan
///   where there is no normal or a corner is not finite
/// \cost near n log n for outlines as they come, n^2 at worst; 90 n bytes beyond the fan
bool triangulate_polygon(std::span<const Double3> corners,
                         std::vector<std::array<std::uint32_t, 3>>& triangles);

/// Twice the vector area of a polygon: along its Newell normal, as long as twice the area of a flat one.
[[nodiscard]] Double3 newell_normal(std::span<const Double3> corners);

}  // namespace tessera
