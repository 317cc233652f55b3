/// \file exact_scan.h
/// Exact samples of a scene with known creases, placed anywhere on the lattice, and how far features of its mesh are
/// from the true ones.
#pragma once
#include <memory>
#include <string>
#include <vector>

#include "kernels/scene/scene.h"
#include "tests/helpers/mesh_checks.h"
#include "tests/helpers/oriented_samples.h"

namespace tessera::test {

/// A scene on the lattice: p_cells = turn p_scene / h + origin.
struct ExactScan {
  std::unique_ptr<synth::Scene> scene;
  std::array<Double3, 3> matrix = {Double3{1, 0, 0}, Double3{0, 1, 0}, Double3{0, 0, 1}};  ///< rows
  Double3 origin = {0, 0, 0};
  double h = 1.0;
  Samples samples;
  Int3 cells = {0, 0, 0};  ///< of the block from kScanOrigin that holds it all

  Double3 to_cells(const Double3& p) const;
  Double3 to_scene(const Double3& p) const;
};

inline constexpr int kScanOrigin = 64;

/// \param h       scene units; the samples lie 1 / spacings apart in it
/// \param pose  0 = along the axes, else one of many rotations
/// \param shift   of the scene's origin relative to a node, cells
ExactScan make_exact_scan(const std::string& scene, double h, int pose, const Double3& shift);

/// Distances in cells.
struct FeatureErrors {
  std::vector<double> corners;  ///< per true corner: of the nearest vertex
  std::vector<double> classed;  ///< per vertex of a crease or corner class: of the nearest true crease
  std::vector<double> sharp;    ///< per end of an edge that turns by more than 30 degrees: the same
  std::vector<Double3> classed_at, sharp_at;
  double recovered = 0.0;  ///< share of the true length within a tenth of a cell of such an edge
};

FeatureErrors measure_features(const ExactScan& scan, const IndexedMesh& mesh);

}  // namespace tessera::test
