/// \file polygon_delaunay.h
/// The constrained Delaunay triangulation of a polygon with holes, over its corners alone: what surveyors span over a toe line.
/// Ears are clipped from the polygon after bridges have joined its holes to it, then edges are flipped until all are Delaunay.
/// Source: Lawson, "Software for C1 Surface Interpolation", 1977; Lee and Lin, "Generalized Delaunay Triangulation for Planar
/// Graphs", 1986; bridges after Held, "FIST", 2001.
#pragma once
#include <array>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "octree/vector.h"

namespace tessera {

/// Triangles, counter-clockwise, by positions in the rings one after the other. The circle around a triangle holds no corner
/// that sees its inside, but for rounding; of several such triangulations the result is always the same one.
/// \param rings  open, either way round, at least three corners each; the first is the outline, the others are holes.
///   Corners may lie in line
/// \pre the corners and two for every hole are at most kMaxPolygonCorners
/// \returns none where rings cross or touch themselves or each other, or a hole lies outside
/// \cost near n log n for outlines as they come, n^2 at worst; 300 n bytes
[[nodiscard]] std::optional<std::vector<std::array<std::uint32_t, 3>>> polygon_delaunay(
    std::span<const std::vector<Double2>> rings);

/// Of its corners, > 0 where it runs counter-clockwise.
double signed_area(std::span<const Double2> ring);

}  // namespace tessera
