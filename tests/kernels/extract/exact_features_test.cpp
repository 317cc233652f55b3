// Exact samples of CAD shapes, in any place and turn: their mesh has every corner and crease, and nothing else is sharp.
#include <algorithm>
#include <catch2/catch.hpp>

#include "kernels/extract/extended_marching_cubes.h"
#include "kernels/field/field.h"
#include "tests/helpers/exact_scan.h"

namespace exact_features_test {

using namespace tessera;
using namespace tessera::test;

namespace {

IndexedMesh mesh_of(const ExactScan& scan) {
  const FieldOptions options;
  const DirectedField field = evaluate_field(make_block(scan.samples, {kScanOrigin, kScanOrigin, kScanOrigin},
                                                        scan.cells, field_halo_cells(options)),
                                             options);
  std::vector<Patch> patches;
  extract_surface(field, {}, [&](Patch&& p) { patches.push_back(std::move(p)); });
  return weld(patches);
}

double worst(const std::vector<double>& errors) {
  return errors.empty() ? 0.0 : *std::max_element(errors.begin(), errors.end());
}

}  // namespace

TEST_CASE("exact features: corners and creases of CAD shapes, wherever they lie", "[property]") {
  const std::string scene = GENERATE("cube", "fandisk", "csg");
  struct Pose {
    int pose;
    double shift;
  };
  // Along the axes: on nodes, closer to them than roots may come, and between; else any.
  const Pose pose = GENERATE(Pose{0, 0.0}, Pose{0, 0.008}, Pose{0, 0.083}, Pose{0, 0.3}, Pose{0, 0.75},
                             Pose{0, 0.97}, Pose{1, 0.1}, Pose{2, 0.1}, Pose{3, 0.1}, Pose{4, 0.1});
  CAPTURE(scene, pose.pose, pose.shift);
  const ExactScan scan = make_exact_scan(scene, scene == "fandisk" ? 0.02 : 0.03, pose.pose,
                                         {pose.shift, pose.shift, pose.shift});
  const IndexedMesh mesh = mesh_of(scan);
  const MeshChecks checks = check_mesh(mesh);
  CHECK(checks.defects() == 0);
  CHECK(checks.boundary_edges == 0);
  CHECK(checks.components == 1);
  CHECK(checks.genus == (scene == "cube" ? 0 : 1));
  const FeatureErrors errors = measure_features(scan, mesh);
  REQUIRE(errors.classed.size() > 600);
  CHECK(worst(errors.corners) < 0.005);
  CHECK(worst(errors.classed) < 0.02);
  // A wedge that an ambiguous face cuts in two leaves a notch: a few vertices each, rarely.
  const auto off = std::count_if(errors.sharp.begin(), errors.sharp.end(), [](double e) { return e > 0.05; });
  CHECK(static_cast<double>(off) < 0.008 * static_cast<double>(errors.sharp.size()));
}

TEST_CASE("exact features: where a plane runs into a cylinder nothing is sharp", "[property]") {
  // At this spacing the hollow of the fandisk leaves a plane of nodes at a shallow angle: thin faces along a line.
  const double shift = GENERATE(0.0, 0.01, 0.5);
  const ExactScan scan = make_exact_scan("fandisk", 0.02, 0, {shift, shift, shift});
  const IndexedMesh mesh = mesh_of(scan);
  double off = 0.0;
  for (const Double3& p : mesh.position) {
    const Double3 q = scan.to_scene(p);
    off = std::max(off, norm(scan.scene->closest(q).position - q) / scan.h);
  }
  const FeatureErrors errors = measure_features(scan, mesh);
  const auto far = std::count_if(errors.sharp.begin(), errors.sharp.end(), [](double e) { return e > 2.0; });
  CAPTURE(shift, off);
  CHECK(far == 0);
  CHECK(off < 0.1);
}

}  // namespace exact_features_test
