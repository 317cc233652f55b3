#include "stream/check/mesh_quality.h"

#include <algorithm>
#include <catch2/catch.hpp>
#include <cmath>

#include "stream/check/mesh_check.h"
#include "tests/helpers/memory_mesh.h"

namespace tessera::mesh_quality_test {
namespace {

using test::MemoryMesh;

MeshCheck quality(MemoryMesh mesh, std::uint64_t memory_bytes = 64u << 20, int threads = 1) {
  MeshCheckOptions options;
  options.memory_bytes = memory_bytes;
  options.threads = threads;
  options.quality = true;
  return check_mesh(mesh, options);
}

/// A box of these edges with its lowest corner at `at`.
MemoryMesh box(const Double3& edges, const Double3& at = {0, 0, 0}) {
  std::vector<Double3> points;
  for (std::size_t i = 0; i < 8; ++i)
    points.push_back({at[0] + (i & 1 ? edges[0] : 0.0), at[1] + (i & 2 ? edges[1] : 0.0),
                      at[2] + (i & 4 ? edges[2] : 0.0)});
  return {points,
          {{0, 2, 1},
           {1, 2, 3},
           {4, 5, 6},
           {5, 7, 6},
           {0, 1, 4},
           {1, 5, 4},
           {2, 6, 3},
           {3, 6, 7},
           {0, 4, 2},
           {2, 4, 6},
           {1, 3, 5},
           {3, 7, 5}}};
}

MemoryMesh inside_out(const MemoryMesh& mesh) {
  std::vector<MeshFace> faces = mesh.faces();
  for (MeshFace& f : faces) std::swap(f[0], f[1]);
  return {mesh.points(), faces};
}

TEST_CASE("mesh quality: a plate has right angles, and its thickness is that of its walls", "[unit]") {
  for (const bool turned : {false, true}) {
    const MemoryMesh plate = box({20, 10, 0.5}, {691600, 5334700, 500});
    const MeshCheck c = quality(turned ? inside_out(plate) : plate);
    CAPTURE(turned);
    CHECK(c.solid());
    CHECK(c.min_angle_deg == Approx(std::atan2(0.5, 20.0) * 57.29577951308232));
    CHECK(c.max_angle_deg == Approx(90.0));
    CHECK(c.max_edge_ratio == Approx(std::sqrt(400.25) / 0.5));
    REQUIRE(c.quality);
    CHECK(c.quality->dihedral.edges == 18);
    CHECK(c.quality->dihedral.min == Approx(90.0).epsilon(1e-6));
    CHECK(c.quality->dihedral.max == Approx(180.0).epsilon(1e-6));
    CHECK(c.quality->walls.samples > kWallSamples / 2);
    CHECK(c.quality->walls.facing == c.quality->walls.samples);
    CHECK(c.quality->walls.thinnest == Approx(0.5).epsilon(1e-6));
    CHECK(c.quality->walls.percent == Approx(0.5).epsilon(1e-6));
  }
}

TEST_CASE("mesh quality: the balls of a torus are its tube, and its dihedral angles lie about 180 degrees",
          "[unit]") {
  const MeshCheck c = quality(test::torus(120, 60));
  REQUIRE(c.quality);
  CHECK(c.quality->walls.thinnest == Approx(2.0).epsilon(0.03));
  CHECK(c.quality->walls.median == Approx(2.0).epsilon(0.02));
  CHECK(c.quality->dihedral.edges == c.edges);
  CHECK(c.quality->dihedral.min > 170.0);
  CHECK(c.quality->dihedral.max > 180.0);  // on its inner side
  CHECK(c.quality->dihedral.max < 185.0);
}

TEST_CASE(
    "mesh quality: a notch is a reflex angle, a knife's edge a sharp one, and both are told with their place",
    "[unit]") {
  // A prism over a quadrilateral with a reflex corner at (1, 0.1): 0, 2 and 3 are sharp.
  const std::vector<Double3> points = {{0, 0, 0}, {1, 0.1, 0}, {2, 0, 0}, {1, 3, 0},
                                       {0, 0, 1}, {1, 0.1, 1}, {2, 0, 1}, {1, 3, 1}};
  const MeshCheck c = quality({points,
                               {{0, 3, 1},
                                {1, 3, 2},
                                {4, 5, 7},
                                {5, 6, 7},
                                {0, 1, 4},
                                {1, 5, 4},
                                {1, 2, 5},
                                {2, 6, 5},
                                {2, 3, 6},
                                {3, 7, 6},
                                {3, 0, 7},
                                {0, 4, 7}}});
  REQUIRE(c.solid());
  REQUIRE(c.volume > 0.0);
  REQUIRE(c.quality);
  const double reflex = 180.0 + 2.0 * std::atan(0.1) * 57.29577951308232;
  CHECK(c.quality->dihedral.max == Approx(reflex).epsilon(1e-6));
  CHECK(c.quality->dihedral.max_at[0] == Approx(1.0));
  CHECK(c.quality->dihedral.max_at[2] == Approx(0.5));
  CHECK(c.quality->dihedral.min == Approx(2.0 * std::atan(1.0 / 3.0) * 57.29577951308232).epsilon(1e-6));
  CHECK(c.quality->dihedral.min_at[1] == Approx(3.0));
}

TEST_CASE("mesh quality: a sheet has no wall, and what folds back on itself has an angle of nothing",
          "[unit]") {
  const MeshCheck sheet = quality({{{0, 0, 0}, {1, 0, 0}, {1, 1, 0}, {0, 1, 0}}, {{0, 1, 2}, {0, 2, 3}}});
  REQUIRE(sheet.quality);
  CHECK(sheet.quality->walls.samples > 0);
  CHECK(sheet.quality->walls.facing == 0);
  CHECK(sheet.quality->dihedral.edges == 1);
  CHECK(sheet.quality->dihedral.min == Approx(180.0));
  CHECK_FALSE(to_json(*sheet.quality).at("walls").contains("thinnest"));
  const MeshCheck folded =
      quality({{{0, 0, 0}, {1, 0, 0}, {0.4, 1, 1e-9}, {0.5, 1, 0}}, {{0, 1, 2}, {1, 0, 3}}});
  REQUIRE(folded.quality);
  const double angle = folded.quality->dihedral.min;
  CHECK(std::min(angle, 360.0 - angle) < 1e-3);
}

TEST_CASE("mesh quality: neither the cap, nor threads, nor the order of faces and vertices changes a bit",
          "[property]") {
  const MemoryMesh torus = test::torus(200, 100);
  const std::string want = dump_json(to_json(*quality(torus).quality));
  std::vector<MeshFace> faces = torus.faces();
  std::reverse(faces.begin(), faces.end());
  std::vector<Double3> points = torus.points();
  std::reverse(points.begin(), points.end());
  for (MeshFace& f : faces) {
    for (auto& v : f) v = points.size() - 1 - v;
    std::rotate(f.begin(), f.begin() + 1, f.end());
  }
  CHECK(dump_json(to_json(*quality({points, faces}).quality)) == want);
  CHECK(dump_json(to_json(*quality(torus, 512u << 20, 3).quality)) == want);
  // Faces wait on disk, and come in many parts.
  CHECK(dump_json(to_json(*quality(torus, 20u << 20, 2).quality)) == want);
}

}  // namespace
}  // namespace tessera::mesh_quality_test
