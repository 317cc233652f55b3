#include "kernels/certify/certificate.h"

#include <catch2/catch.hpp>

#include <cmath>

#include "octree/vector.h"
#include "tests/helpers/surfaces.h"

namespace certificate_test {

namespace {

using namespace tessera;
using test::Surface;

DeviationReport measure(const Surface& a, const Surface& b, double tolerance, double max_distance,
                        std::vector<float>* bound = nullptr, const Box3* core = nullptr) {
  const ClosestFaces reference(b.position, b.faces, {0.5, 0.5, 0.5});
  return certify_deviation({a.position, a.faces}, core, reference,
                           {.tolerance = tolerance, .max_distance = max_distance, .area_unit = 0x1p-40},
                           bound);
}

double flat(double, double) {
  return 0.0;
}

/// The border of a strip along y = `y`, as segments.
Surface polyline(double y, int segments) {
  Surface s;
  for (int i = 0; i <= segments; ++i) s.position.push_back({static_cast<double>(i) / segments, y, 0.0});
  for (std::uint32_t i = 0; i < static_cast<std::uint32_t>(segments); ++i)
    s.faces.push_back({i, i + 1, i + 1});
  return s;
}

}  // namespace

TEST_CASE("closest face: as the slow way says, also for segments and slivers", "[property]") {
  test::Random random(3);
  const Surface s = test::soup(400, 0.2, random);
  const ClosestFaces index(s.position, s.faces, {0.5, 0.5, 0.5});
  std::uint32_t hint = ClosestFaces::kNone;
  for (int i = 0; i < 2000; ++i) {
    const Double3 p = {random.in(-0.5, 1.5), random.in(-0.5, 1.5), random.in(-0.5, 1.5)};
    const Double3 local = {p[0] - 0.5, p[1] - 0.5, p[2] - 0.5};
    const double truth = test::surface_distance(p, s);
    const auto hit = index.closest(local, 1e300, i % 2 ? hint : ClosestFaces::kNone);
    hint = hit.slot;
    CHECK(std::sqrt(hit.square) == Approx(truth).margin(1e-12));
    const auto& f = s.faces[index.face(hit.slot)];
    CHECK(test::triangle_distance(p, s.position[f[0]], s.position[f[1]], s.position[f[2]]) ==
          Approx(truth).margin(1e-12));
    CHECK(index.closest(local, truth * truth * 0.99, hint).slot == ClosestFaces::kNone);
  }
}

TEST_CASE("closest face: needles across the axes are found as the slow way finds them", "[property]") {
  test::Random random(8);
  Surface s;
  const auto add = [&](const Double3& a, const Double3& b, const Double3& c) {
    const auto v = static_cast<std::uint32_t>(s.position.size());
    s.position.insert(s.position.end(), {a, b, c});
    s.faces.push_back({v, v + 1, v + 2});
  };
  // Walls of turned parts: fans and strips of needles in all directions, lines, and small faces between.
  for (int i = 0; i < 300; ++i) {
    const Double3 at = {random.unit(), random.unit(), random.unit()};
    const Double3 direction = {random.in(-0.7, 0.7), random.in(-0.7, 0.7), random.in(-0.7, 0.7)};
    const double width = std::pow(10.0, random.in(-9.0, -2.0)), along = random.in(0.0, 1.0);
    const Double3 lateral = {random.in(-width, width), random.in(-width, width), random.in(-width, width)};
    add(at, at + direction, i % 29 == 3 ? at + direction : at + direction * along + lateral);
    for (int k = 0; k < 3; ++k) {
      const Double3 near = {random.unit(), random.unit(), random.unit()};
      add(near, near + Double3{0.01, 0.002, 0}, near + Double3{0, 0.01, 0.003});
    }
  }
  const ClosestFaces index(s.position, s.faces, {0.5, 0.5, 0.5});
  std::uint32_t hint = ClosestFaces::kNone;
  for (int i = 0; i < 2000; ++i) {
    const Double3 p = {random.in(-0.5, 1.5), random.in(-0.5, 1.5), random.in(-0.5, 1.5)};
    const Double3 local = {p[0] - 0.5, p[1] - 0.5, p[2] - 0.5};
    const double truth = test::surface_distance(p, s);
    const auto hit = index.closest(local, 1e300, i % 2 ? hint : ClosestFaces::kNone);
    hint = hit.slot;
    CHECK(std::sqrt(hit.square) == Approx(truth).margin(1e-12));
    CHECK(index.closest(local, truth * truth * 0.99, hint).slot == ClosestFaces::kNone);
  }
}

TEST_CASE("certificate: parallel planes of unlike meshes are as far apart as they are", "[unit]") {
  const Surface a = test::height_grid(7, 1.0, flat);
  const Surface b = test::height_grid(31, 1.0, [](double, double) { return 0.01; });
  const DeviationReport r = measure(a, b, 0.02, 0.02);
  CHECK(r.upper >= 0.01);
  CHECK(r.upper <= 0.01 * 1.0001);
  CHECK(r.lower == Approx(0.01));
  CHECK(r.rms() == Approx(0.01));
  CHECK(r.area == Approx(1.0));
  CHECK(r.faces_exceeding == 0);
  CHECK_FALSE(r.beyond);
  CHECK(r.faces == a.faces.size());
}

TEST_CASE("certificate: equal surfaces with other triangles are at distance zero", "[unit]") {
  const auto tilted = [](double x, double y) { return 0.3 * x - 0.2 * y; };
  const Surface a = test::height_grid(5, 1.0, tilted), b = test::height_grid(13, 1.0, tilted);
  for (const auto& [one, other] : {std::pair(&a, &b), std::pair(&b, &a)}) {
    const DeviationReport r = measure(*one, *other, 0.01, 0.01);
    CHECK(r.upper <= 0.01 * 1.1e-3);
    CHECK(r.faces_exceeding == 0);
  }
}

TEST_CASE("certificate: a coarse sphere in a fine one", "[unit]") {
  const Surface coarse = test::sphere(3, 1.0), fine = test::sphere(6, 1.0);
  // The deepest point of a coarse face is its foot from the centre.
  double depth = 0.0;
  for (const auto& f : coarse.faces) {
    const Double3 &a = coarse.position[f[0]], &b = coarse.position[f[1]], &c = coarse.position[f[2]];
    const Double3 u = b - a, v = c - a;
    const Double3 n = cross(u, v);
    const double size = norm(n);
    depth = std::max(depth, 1.0 - std::abs(dot(n, a)) / size);
  }
  for (const auto& [one, other] : {std::pair(&coarse, &fine), std::pair(&fine, &coarse)}) {
    const DeviationReport r = measure(*one, *other, 0.05, 0.05);
    CHECK(r.upper >= 0.97 * depth);
    CHECK(r.upper <= 1.05 * depth);
    CHECK(r.lower <= depth);
    CHECK(r.upper <= 1.04 * r.lower);
    const double area = one->faces.size() > 1000 ? 12.56 : 12.4;
    CHECK(r.area == Approx(area).epsilon(0.02));
  }
}

TEST_CASE("certificate: a step over the tolerance is found, with the place", "[unit]") {
  Surface a = test::height_grid(20, 1.0, flat);
  const Surface b = a;
  a.position[10 * 21 + 10][2] = 0.05;
  const DeviationReport r = measure(a, b, 0.02, 0.1);
  CHECK(r.upper >= 0.05);
  CHECK(r.upper <= 0.0516);
  CHECK(r.lower == Approx(0.05));
  CHECK(r.witness[0] == Approx(0.5));
  CHECK(r.witness[1] == Approx(0.5));
  CHECK(r.faces_exceeding == 6);
  const DeviationReport near = measure(a, b, 0.02, 0.02);
  CHECK(near.beyond);
  CHECK(std::isinf(near.upper));
  CHECK(near.faces_exceeding == 6);
}

TEST_CASE("certificate: nothing to compare with is beyond, nothing to measure is zero", "[unit]") {
  const Surface a = test::height_grid(3, 1.0, flat);
  const DeviationReport none = measure(a, Surface{}, 0.1, 0.1);
  CHECK(none.beyond);
  CHECK(none.faces_exceeding == a.faces.size());
  CHECK(none.histogram[kDeviationBins + 1] > 0);
  const DeviationReport empty = measure(Surface{}, a, 0.1, 0.1);
  CHECK(empty.upper == 0.0);
  CHECK(empty.faces == 0);
}

TEST_CASE("certificate: a border shifted sideways shows in the border curves", "[unit]") {
  const Surface a = polyline(0.0, 10), b = polyline(0.03, 37);
  const DeviationReport r = measure(a, b, 0.05, 0.05);
  CHECK(r.upper >= 0.03);
  CHECK(r.upper <= 0.031);
  CHECK(r.area == Approx(1.0));
  const DeviationReport same = measure(a, polyline(0.0, 7), 0.05, 0.05);
  CHECK(same.upper <= 0.05 * 1.1e-3);
}

TEST_CASE("certificate: boxes that tile space give every point once and the same maximum", "[property]") {
  test::Random random(5);
  const Surface a = test::height_grid(9, 1.0, [&](double, double) { return random.in(-0.02, 0.02); });
  const Surface b = test::height_grid(23, 1.0, [&](double, double) { return random.in(-0.01, 0.01); });
  const DeviationReport whole = measure(a, b, 0.05, 0.05);
  DeviationReport parts;
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 3; ++j) {
      const Box3 box = {{i / 3.0, j / 3.0, -1.0}, {(i + 1) / 3.0, (j + 1) / 3.0, 1.0}};
      parts.merge(measure(a, b, 0.05, 0.05, nullptr, &box));
    }
  CHECK(parts.area == Approx(whole.area));
  CHECK(parts.lower == Approx(whole.lower).epsilon(0.04));
  CHECK(parts.upper == Approx(whole.upper).epsilon(0.04));
  CHECK(parts.upper >= whole.lower);
}

TEST_CASE("certificate: no sample is ever above the bound of its face", "[property]") {
  for (std::uint64_t seed = 1; seed <= 6; ++seed) {
    test::Random random(seed);
    const double noise = 0.002 * static_cast<double>(seed);
    Surface a = test::height_grid(6, 1.0, [&](double, double) { return random.in(-noise, noise); });
    Surface b = test::height_grid(17, 1.0, [&](double, double) { return random.in(-noise, noise); });
    if (seed == 6) {  // surfaces that have nothing to do with each other
      a = test::soup(40, 0.3, random);
      b = test::soup(60, 0.3, random);
    }
    std::vector<float> bound;
    const double max_distance = seed == 6 ? 2.0 : 0.1;
    const DeviationReport r = measure(a, b, 0.01, max_distance, &bound);
    REQUIRE(bound.size() == a.faces.size());
    CHECK(r.upper <= 1.05 * r.lower);
    double maximum = 0.0;
    for (int i = 0; i < 20000; ++i) {
      const std::size_t face = random.below(a.faces.size());
      const Double3 p = test::random_point(a, face, random);
      const double d = test::surface_distance(p, b);
      maximum = std::max(maximum, d);
      CHECK(d <= static_cast<double>(bound[face]));
    }
    CHECK(maximum <= r.upper);
    CHECK(r.lower <= r.upper);
    CHECK(r.upper <= 1.15 * maximum);
  }
}

TEST_CASE("certificate: far from the origin of coordinates it stays a bound", "[property]") {
  test::Random random(9);
  Surface a = test::height_grid(8, 1.0, [&](double, double) { return random.in(-0.01, 0.01); });
  Surface b = test::height_grid(8, 1.0, [&](double, double) { return 0.0; });
  const DeviationReport here = measure(a, b, 0.02, 0.02);
  for (Surface* s : {&a, &b})
    for (Double3& p : s->position) p[0] += 0x1p22, p[1] -= 0x1p22;
  const ClosestFaces reference(b.position, b.faces, {0x1p22, -0x1p22, 0.0});
  const DeviationReport there =
      certify_deviation({a.position, a.faces}, nullptr, reference,
                        {.tolerance = 0.02, .max_distance = 0.02, .area_unit = 0x1p-40});
  CHECK(there.upper == Approx(here.upper).epsilon(1e-6));
  CHECK(there.upper >= there.lower);
}

}  // namespace certificate_test
