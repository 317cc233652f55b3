/// \file hole_triangulation.h
/// Triangulation of a closed polygon in space: least largest dihedral angle first, then least area, or least area alone.
/// Source: Barequet, Sharir 1995; Liepa 2003.
#pragma once
#include <array>
#include <cstdint>
#include <vector>

#include "kernels/holes/hole_filling.h"

namespace tessera {

struct HoleTriangulation {
  /// n - 2, or none when every one needs a taken edge or a face without area.
  std::vector<std::array<std::uint32_t, 3>> faces;
  /// Cosine between the normals of the faces on both sides of the rim, mean weighted by length: 1 goes
  /// straight on, -1 folds back.
  double boundary_cosine = 1.0;
};

/// Whether a triangle is more than a line: rims have edges in line, and vertices at one place where two pieces of the
/// mesh touch.
[[nodiscard]] bool has_area(const Double3& a, const Double3& b, const Double3& c);

/// Unit normals of the mesh's faces along the loop, averaged along it over two edges to each side: single
/// faces at a border are slivers too often. Zero where there is none.
[[nodiscard]] std::vector<Double3> boundary_normals(const HoleLoop& loop);

enum class TriangulationGoal : std::uint8_t {
  kLeastDihedral,  ///< then least area
  kLeastArea,
};

/// Ties go to the lower vertex. \cost time O(n^3), memory 44 n^2 bytes
[[nodiscard]] HoleTriangulation triangulate_hole(const HoleLoop& loop,
                                                 const std::vector<Double3>& boundary_normal,
                                                 TriangulationGoal goal = TriangulationGoal::kLeastDihedral);

}  // namespace tessera
