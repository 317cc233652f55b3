/// \file irregular_mesh.h
/// Irregular triangle meshes of any size for solver tests and benches: jittered points in graded density,
/// planar Delaunay triangulation, lifted to a wavy height field. Deterministic.
#pragma once
#include <array>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "octree/vector.h"

namespace tessera::test {

struct IrregularMeshOptions {
  std::size_t side = 100;  ///< points along a side: side^2 vertices
  double jitter = 0.3;     ///< of a point, in grid steps each way; 0 is regular, 0.3 the most
  double grading = 0.6;    ///< in [0, 1): the density varies by (1 + g) / (1 - g) along each axis
  double stretch = 1.0;    ///< steps in y are shorter by this factor: anisotropic above 1
  double height = 0.15;    ///< of the waves
};

struct IrregularMesh {
  std::vector<Double3> positions;
  std::vector<std::array<std::uint32_t, 3>> faces;
  /// 1 for three rings at the border and for a disk (the handle) around the middle of 1/8 of the side.
  std::vector<std::uint8_t> fixed;
  std::vector<double> target;  ///< n x 3: the positions, the handle raised by 0.2
};

IrregularMesh irregular_mesh(const IrregularMeshOptions& options);

}  // namespace tessera::test
