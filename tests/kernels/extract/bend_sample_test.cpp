// Creases that bend within an edge or two: a second sample between those of two cells halves what chords cut off.
#include "kernels/extract/bend_sample.h"

#include <algorithm>
#include <array>
#include <catch2/catch.hpp>
#include <cmath>
#include <limits>
#include <numbers>

#include "kernels/extract/extended_marching_cubes.h"
#include "kernels/mesh/closest_face.h"
#include "tests/helpers/analytic_field.h"
#include "tests/helpers/mesh_checks.h"

namespace bend_sample_test {

using namespace tessera;
using namespace tessera::test;

namespace {

constexpr Double3 kCentre = {128.31, 100.73, 96.42};  // on the side of two bricks

/// A peg along z, six cells high.
Shape peg(double radius) {
  return intersect(cylinder(kCentre, {0, 0, 1}, radius),
                   intersect(half_space(kCentre + Double3{0, 0, 3}, {0, 0, 1}),
                             half_space(kCentre - Double3{0, 0, 3}, {0, 0, -1})));
}

struct Rim {
  IndexedMesh mesh;
  ExtractReport report;
  double off = 0.0;  ///< of points of the rims from the mesh, at the most
};

Rim rim_of(double radius, bool bends, const Int3& origin, const Int3& cells) {
  Rim rim;
  ExtractOptions options;
  options.bends = bends;
  std::vector<Patch> patches;
  rim.report = extract_surface(make_field(peg(radius), origin, cells), options,
                               [&](Patch&& p) { patches.push_back(std::move(p)); });
  rim.mesh = weld(patches);
  const ClosestFaces there(rim.mesh.position, rim.mesh.faces, kCentre);
  for (int i = 0; i < 1000; ++i)
    for (const double z : {-3.0, 3.0}) {
      const double turn = 2.0 * std::numbers::pi * i / 1000.0;
      const Double3 p = {radius * std::cos(turn), radius * std::sin(turn), z};
      const double square = there.closest(p, std::numeric_limits<double>::max(), ClosestFaces::kNone).square;
      rim.off = std::max(rim.off, std::sqrt(square));
    }
  return rim;
}

}  // namespace

TEST_CASE("bend sample: rims of a few cells come within a fiftieth of a cell, and the mesh stays closed",
          "[unit]") {
  const double radius = GENERATE(2.3, 3.1, 4.7);
  CAPTURE(radius);
  const Rim plain = rim_of(radius, false, {64, 64, 64}, {128, 64, 64}),
            bent = rim_of(radius, true, {64, 64, 64}, {128, 64, 64});
  CHECK(plain.report.bend_samples == 0);
  CHECK(bent.report.bend_samples > 10);
  CHECK(bent.report.flips == plain.report.flips);
  // Each such vertex makes four faces of two.
  CHECK(bent.mesh.faces.size() == plain.mesh.faces.size() + 2 * bent.report.bend_samples);
  CHECK(bent.off < 0.6 * plain.off);
  CHECK(bent.off < 0.02);
  const MeshChecks checks = check_mesh(bent.mesh);
  CHECK(checks.defects() == 0);
  CHECK(checks.boundary_edges == 0);
  CHECK(checks.genus == 0);
}

TEST_CASE("bend sample: straight creases get none", "[unit]") {
  const Shape cube = box({100.3, 90.6, 80.2}, {117.7, 104.1, 99.9});
  ExtractOptions options;
  options.bends = true;
  const ExtractReport report =
      extract_surface(make_field(cube, {64, 64, 64}, {64, 64, 64}), options, [](Patch&&) {});
  CHECK(report.flips > 100);
  CHECK(report.bend_samples == 0);
}

TEST_CASE("bend sample: the same faces whichever block holds them", "[unit]") {
  const auto sorted = [](const IndexedMesh& mesh) {
    std::vector<std::array<Double3, 3>> faces;
    for (const auto& f : mesh.faces) {
      std::array<Double3, 3> at = {mesh.position[f[0]], mesh.position[f[1]], mesh.position[f[2]]};
      std::rotate(at.begin(), std::min_element(at.begin(), at.end()), at.end());
      faces.push_back(at);
    }
    std::sort(faces.begin(), faces.end());
    return faces;
  };
  const auto whole = sorted(rim_of(2.9, true, {64, 64, 64}, {128, 64, 64}).mesh);
  REQUIRE_FALSE(whole.empty());
  CHECK(sorted(rim_of(2.9, true, {0, 0, 0}, {256, 128, 192}).mesh) == whole);
}

TEST_CASE("bend sample: sheets that do not meet between the samples have no point there", "[unit]") {
  CreaseSpan span;
  // A rim of radius 2 about z, its plane z = 0, and two roots of each at both sides.
  span.planes.size = 0;
  const auto add = [&](const Double3& p, const Double3& n) {
    span.planes.point[span.planes.size] = p;
    span.planes.normal[span.planes.size] = n;
    span.planes.offset[span.planes.size++] = 0.0;
  };
  for (const double turn : {-0.3, 0.05, 0.4})
    for (const double z : {-0.2, -0.6}) {
      const Double3 n = {std::cos(turn), std::sin(turn), 0};
      add(n * 2.0 + Double3{0, 0, z}, n);
    }
  for (const double turn : {-0.3, 0.1, 0.4}) add({1.5 * std::cos(turn), 1.5 * std::sin(turn), 0}, {0, 0, 1});
  span.beside = {2, 7};
  span.end = {Double3{2.0 * std::cos(-0.25), 2.0 * std::sin(-0.25), 0},
              Double3{2.0 * std::cos(0.25), 2.0 * std::sin(0.25), 0}};
  Double3 x;
  REQUIRE(sample_bend(span, 0.7, x));
  CHECK(std::hypot(x[0], x[1]) == Approx(2.0).margin(0.01));
  CHECK(std::fabs(x[2]) < 1e-3);
  SECTION("the same rim, far away") {
    for (std::size_t i = 0; i < span.planes.size; ++i) span.planes.point[i][0] += 1.0;
    CHECK_FALSE(sample_bend(span, 0.7, x));
  }
  SECTION("a chord that is as near") {
    span.end = {Double3{2.0 * std::cos(-0.05), 2.0 * std::sin(-0.05), 0},
                Double3{2.0 * std::cos(0.05), 2.0 * std::sin(0.05), 0}};
    CHECK_FALSE(sample_bend(span, 0.7, x));
  }
}

}  // namespace bend_sample_test
