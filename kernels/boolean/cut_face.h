/// \file cut_face.h
/// The constrained Delaunay triangulation of a face over points in it and segments between them. Which side a point lies on is
/// exact; which of two diagonals is the better one is told in double precision.
/// Source: Lawson, "Software for C1 Surface Interpolation", 1977; Sloan, "A Fast Algorithm for Generating Constrained Delaunay
/// Triangulations", 1993.
#pragma once
#include <array>
#include <cstdint>
#include <span>
#include <utility>
#include <vector>

#include "kernels/boolean/exact_point.h"

namespace tessera {

/// Triangles that cover the face, each the same way round as it, by numbers of points; each segment is an edge of them.
/// \param corner    of the face, numbers of `points`; it has an area
/// \param inner     other points of the face, in it or on its edges, all at different positions
/// \param segments  between corners and inner points; they meet in points alone, and no point lies within one
/// \cost about n log n for points as cuts have them; the result does not depend on the order of inner points and segments
[[nodiscard]] std::vector<std::array<std::uint32_t, 3>> triangulate_cut_face(
    const PointTable& points, const std::array<std::uint32_t, 3>& corner,
    std::span<const std::uint32_t> inner, std::span<const std::pair<std::uint32_t, std::uint32_t>> segments);

}  // namespace tessera
