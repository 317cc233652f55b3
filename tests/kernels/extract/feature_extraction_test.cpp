// From points to feature vertices: field and extraction together, against exact solids.
#include <algorithm>
#include <catch2/catch.hpp>
#include <cmath>

#include "kernels/extract/extended_marching_cubes.h"
#include "kernels/field/field.h"
#include "octree/vector.h"
#include "tests/helpers/mesh_checks.h"
#include "tests/helpers/oriented_samples.h"
#include "tests/helpers/solids.h"

namespace feature_extraction_test {

using namespace tessera;
using namespace tessera::test;

namespace {

const Int3 kOrigin = {64, 64, 64};

/// Distance from x to the common points of the `count` faces nearest to it, by alternating projections.
double distance_to_feature(const Solid& solid, const Double3& x, std::size_t count) {
  std::vector<std::pair<double, std::size_t>> order;
  for (std::size_t f = 0; f < solid.faces.size(); ++f)
    order.emplace_back(std::fabs(solid.faces[f].value(x)), f);
  std::sort(order.begin(), order.end());
  Double3 p = x;
  for (int round = 0; round < 300; ++round) {
    for (std::size_t c = 0; c < count; ++c) {
      const Face& face = solid.faces[order[c].second];
      const double value = face.value(p);
      const Double3 g = face.gradient(p);
      for (std::size_t k = 0; k < 3; ++k) p[k] -= value * g[k];
    }
  }
  double sum = 0.0;
  for (std::size_t k = 0; k < 3; ++k) sum += (p[k] - x[k]) * (p[k] - x[k]);
  return std::sqrt(sum);
}

struct Measured {
  MeshChecks checks;
  std::size_t faces = 0;
  std::size_t features = 0;
  std::vector<double> off;  ///< distances of feature vertices from true features, ascending
  double deviation = 0.0;  ///< mean angle to the true normal of faces near creases, weighted by area, radians
};

Measured measure(const Solid& solid, const DirectedField& field, ExtractMethod method) {
  std::vector<Patch> patches;
  ExtractOptions options;
  options.method = method;
  extract_surface(field, options, [&](Patch&& p) { patches.push_back(std::move(p)); });
  const IndexedMesh mesh = weld(patches);
  Measured m;
  m.checks = check_mesh(mesh);
  m.faces = mesh.faces.size();
  for (std::size_t v = 0; v < mesh.position.size(); ++v) {
    const VertexClass c = mesh.vertex_class[v];
    if (c != VertexClass::kCrease && c != VertexClass::kCorner) continue;
    ++m.features;
    m.off.push_back(distance_to_feature(solid, mesh.position[v], c == VertexClass::kCrease ? 2 : 3));
  }
  std::sort(m.off.begin(), m.off.end());
  double area = 0.0;
  for (const auto& f : mesh.faces) {
    Double3 c = {0, 0, 0}, u, v;
    for (std::size_t k = 0; k < 3; ++k) {
      for (const std::uint32_t i : f) c[k] += mesh.position[i][k] / 3;
      u[k] = mesh.position[f[1]][k] - mesh.position[f[0]][k];
      v[k] = mesh.position[f[2]][k] - mesh.position[f[0]][k];
    }
    std::vector<double> near;
    for (const Face& face : solid.faces) near.push_back(std::fabs(face.value(c)));
    std::nth_element(near.begin(), near.begin() + 1, near.end());
    if (near[1] > 0.7) continue;
    Double3 n = cross(u, v);
    const double length = norm(n);
    for (double& x : n) x /= length;
    m.deviation += length * solid.normal_error(c, n, near[0] + 1e-6);
    area += length;
  }
  m.deviation /= area;
  return m;
}

}  // namespace

TEST_CASE("features from points: cube, bored block, fandisk-like", "[unit]") {
  const int cells = GENERATE(64, 128);
  const int which = GENERATE(0, 1, 2);
  const double c = 64 + 0.5 * cells + 0.37;
  const Double3 centre = {c, c - 0.21, c + 0.16};
  const double s = 0.25 * cells;
  const Solid solid = which == 0   ? make_box(centre, {s, 1.1 * s, 0.9 * s}, true)
                      : which == 1 ? make_bored_block(centre, {s, 1.1 * s, 0.9 * s}, 0.55 * s, true)
                                   : make_fandisk(centre, 1.3 * s, true);
  Random random(7);
  const double spacing = 1.0 / 1.5;
  const Samples samples = solid.sample(centre, 4.0 * s, spacing, random);
  const FieldOptions options;
  const DirectedField field =
      evaluate_field(make_block(samples, kOrigin, {cells, cells, cells}, field_halo_cells(options)), options);
  const Measured plain = measure(solid, field, ExtractMethod::kMarchingCubes);
  const Measured extended = measure(solid, field, ExtractMethod::kExtendedMarchingCubes);
  CAPTURE(cells, which, samples.size(), extended.features, plain.deviation, extended.deviation);
  REQUIRE(extended.features > 100);
  const auto quantile = [&](double q) {
    return extended.off[static_cast<std::size_t>(q * static_cast<double>(extended.off.size() - 1))];
  };
  CAPTURE(quantile(0.5), quantile(0.95), quantile(0.99), quantile(1.0));
  CHECK(quantile(0.5) < 0.001);
  CHECK(quantile(0.95) < 0.01);
  CHECK(quantile(0.99) < 0.02);  // beyond: roots that the field takes for a face just across the crease
  CHECK(extended.deviation < 0.1 * plain.deviation);
  CHECK(static_cast<double>(extended.faces) < 1.1 * static_cast<double>(plain.faces));
  CHECK(extended.checks.boundary_edges == 0);
  CHECK(extended.checks.defects() == 0);
}

}  // namespace feature_extraction_test
