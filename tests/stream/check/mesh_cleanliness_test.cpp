#include <catch2/catch.hpp>

#include <cmath>
#include <limits>

#include "stream/check/mesh_check.h"
#include "stream/files/json.h"
#include "tests/helpers/memory_mesh.h"

namespace tessera::mesh_cleanliness_test {
namespace {

using test::MemoryMesh;

MeshCleanliness measure(MemoryMesh mesh, std::uint64_t memory_bytes = 64u << 20) {
  MeshCheckOptions options;
  options.memory_bytes = memory_bytes;
  options.cleanliness = true;
  return check_mesh(mesh, options).cleanliness.value();
}

/// n by n squares of edge 1; the vertices of every other column of the upper border stand out by `step`.
MemoryMesh sheet(std::uint64_t n, double step) {
  std::vector<Double3> points;
  std::vector<MeshFace> faces;
  for (std::uint64_t y = 0; y <= n; ++y)
    for (std::uint64_t x = 0; x <= n; ++x)
      points.push_back(
          {static_cast<double>(x), static_cast<double>(y) + (y == n && x % 2 == 1 ? step : 0.0), 0.0});
  for (std::uint64_t y = 0; y < n; ++y)
    for (std::uint64_t x = 0; x < n; ++x) {
      const std::uint64_t a = y * (n + 1) + x;
      faces.push_back({a, a + 1, a + n + 2});
      faces.push_back({a, a + n + 2, a + n + 1});
    }
  return {points, faces};
}

TEST_CASE("check: edges that fold by 70 degrees or more are sharp, whatever the winding of the file",
          "[unit]") {
  const MeshCleanliness solid = measure(test::tetrahedron());
  CHECK(solid.inner_edges == 6);
  CHECK(solid.sharp_edges == 6);  // 90 degrees and more
  CHECK(solid.sharp_edges_per_1000() == 1000.0);
  CHECK(solid.border_edges == 0);
  CHECK(solid.border_jaggedness.value() == 1.0);

  auto out = test::tetrahedron();
  std::vector<MeshFace> faces = out.faces();
  for (MeshFace& f : faces) std::swap(f[0], f[1]);
  CHECK(measure({out.points(), faces}).sharp_edges == 6);

  const auto fold = [](double degrees) {
    const double a = degrees * 3.14159265358979324 / 180.0;
    return MemoryMesh({{0, 0, 0}, {0, 1, 0}, {1, 0, 0}, {-std::cos(a), 0, std::sin(a)}},
                      {{0, 2, 1}, {0, 1, 3}});
  };
  CHECK(measure(fold(69.9)).sharp_edges == 0);
  CHECK(measure(fold(70.1)).sharp_edges == 1);
  CHECK(measure(fold(69.9)).inner_edges == 1);
}

TEST_CASE("check: a ragged border is longer than its smooth course", "[unit]") {
  const double plain = measure(sheet(32, 0.0)).border_jaggedness.value();
  const double ragged = measure(sheet(32, 0.5)).border_jaggedness.value();
  CHECK(plain > 1.0);  // its four corners are cut
  CHECK(plain < 1.08);
  // A quarter of the border is longer by sqrt(1 + 0.25), and smooth it is as the other three.
  CHECK(ragged / plain == Approx((3.0 + std::sqrt(1.25)) / 4.0).margin(0.01));
  CHECK(measure(sheet(32, 0.5)).border_edges == 128);
  CHECK(measure(sheet(32, 0.5)).border_length == Approx(96.0 + 31.0 * std::sqrt(1.25) + std::sqrt(1.25)));
}

TEST_CASE("check: cleanliness under a small cap is the same", "[unit]") {
  const MeshCleanliness a = measure(test::torus(200, 100, 50)),
                        b = measure(test::torus(200, 100, 50), 2u << 20);
  CHECK(a.border_edges > 50);
  CHECK(a.inner_edges == b.inner_edges);
  CHECK(a.sharp_edges == b.sharp_edges);
  CHECK(a.border_edges == b.border_edges);
  CHECK(a.border_jaggedness == b.border_jaggedness);
  CHECK(to_json(a) == to_json(b));
}

TEST_CASE("check: a border beyond the cap is counted and said, not guessed", "[unit]") {
  // Faces by themselves: three border edges each.
  std::vector<Double3> points;
  std::vector<MeshFace> faces;
  for (std::uint64_t i = 0; i < 30000; ++i) {
    const auto x = static_cast<double>(2 * i);
    points.insert(points.end(), {{x, 0, 0}, {x + 1, 0, 0}, {x, 1, 0}});
    faces.push_back({3 * i, 3 * i + 1, 3 * i + 2});
  }
  const MeshCleanliness c = measure({points, faces}, 20u << 20);
  CHECK(c.border_edges == 90000);
  CHECK_FALSE(c.border_jaggedness.has_value());
  CHECK(to_json(c).at("border_jaggedness").is_null());
  CHECK(describe(c).find("raise --memory to") != std::string::npos);
  CHECK(measure({points, faces}, 256u << 20).border_jaggedness.has_value());
}

TEST_CASE("check: faces without an area or with unknown vertices take no part in cleanliness", "[unit]") {
  const double nan = std::numeric_limits<double>::quiet_NaN();
  const MeshCleanliness c = measure({{{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {2, 0, 0}, {nan, 0, 0}},
                                     {{0, 1, 2}, {0, 1, 3}, {0, 1, 4}, {0, 1, 1}, {0, 1, 9}}});
  CHECK(c.inner_edges == 0);
  CHECK(c.border_edges == 3);
}

}  // namespace
}  // namespace tessera::mesh_cleanliness_test
