/// \file intrinsic_delaunay.h
/// Intrinsic Delaunay triangulation of a mesh: edges are flipped inside the surface, which itself does not
/// change. Source: Bobenko and Springborn 2007; Fisher, Springborn, Schroeder, Bobenko 2007 (flips by edge
/// lengths); Sharp and Crane 2020 (mollification: a little length for all edges, so that no triangle is
/// degenerate).
#pragma once
#include <array>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "solvers/laplacian.h"

namespace tessera {

/// Faces know their edges only by length. A face may name a vertex twice, two faces may share two edges.
struct IntrinsicMesh {
  std::vector<std::array<std::uint32_t, 3>> faces;  ///< m, as oriented in the input
  std::vector<std::array<double, 3>> length;        ///< m x 3, of the edge opposite each corner
  std::size_t flips = 0;
  /// Edges left that would flip but may not: other than two faces, or the flip limit.
  std::size_t not_delaunay = 0;
  double mollified = 0.0;  ///< length added to every edge; 0 unless a face is degenerate
};

/// \pre indices below the number of positions, positions of faces finite. \cost about linear
[[nodiscard]] IntrinsicMesh intrinsic_delaunay(const TriangleSpan& mesh);

/// Area by the stable form of Heron's formula (Kahan); 0 where the triangle inequality fails.
double triangle_area(const std::array<double, 3>& length);

}  // namespace tessera
