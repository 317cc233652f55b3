/// \file loop_triangulation.h
/// Triangulation of the loop of a cell without a feature: the one of least area.
/// Source: Barequet, Sharir, "Filling gaps in the boundary of a polyhedron", 1995 (dynamic programme).
#pragma once
#include <array>
#include <cstdint>

#include "kernels/extract/feature_sample.h"

namespace tessera {

/// Triangles as positions in the loop, counter-clockwise like the loop itself.
struct LoopTriangles {
  int count = 0;  ///< 0: every triangulation needs a chord in a face, use a centre instead
  std::array<std::array<std::uint8_t, 3>, kCellEdges - 2> triangle;
};

/// Least area among the triangulations without a chord in a face of the cell (the neighbour might use the
/// same chord, and four triangles would meet in it); ties go to the lower position.
void triangulate_loop(const LoopSamples& loop, LoopTriangles& out);

/// The same where vertices were moved onto a border, so that three may lie in a line: the triangulation whose least
/// area, seen along `normal`, is the largest.
void triangulate_border_loop(const LoopSamples& loop, const Float3& normal, LoopTriangles& out);

/// Whether two triangles meet beyond what they share, exactly. \param centre  of the fan that takes the place of none
[[nodiscard]] bool loop_crosses_itself(const LoopSamples& loop, const LoopTriangles& triangles,
                                       const Float3& centre);

}  // namespace tessera
