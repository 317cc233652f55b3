#include "kernels/blends/blend_curves.h"

#include <catch2/catch.hpp>

#include "octree/error.h"
#include "tests/helpers/blend_search.h"
#include "tests/helpers/block_meshes.h"
#include "tests/helpers/filleted.h"

namespace blend_curves_test {

using namespace tessera;
using namespace tessera::test;

TEST_CASE("blend tracks: a fillet is one track along its middle, as wide as it is", "[unit]") {
  const bool convex = GENERATE(true, false);
  Swept s;
  s.convex = convex;
  const std::vector<BlendCurve> curves = search_blends(swept_block(s), 4.5, 1.2);
  REQUIRE(curves.size() == 1);
  CHECK(curves[0].convex == convex);
  CHECK_FALSE(curves[0].closed);
  CHECK(curves[0].half_width == Approx(2.4).margin(1.3));
  CHECK(curves[0].centre.size() > 24);
  for (const Double3& c : curves[0].centre) CHECK(std::fabs(c[0]) < 0.6);
}

TEST_CASE("blend tracks: a fillet around a ring closes, a box has twelve", "[unit]") {
  Swept s;
  s.sweep_radius = 20.0;
  s.closed = true;
  const std::vector<BlendCurve> ring = search_blends(swept_block(s), 4.5, 1.2);
  REQUIRE(ring.size() == 1);
  CHECK(ring[0].closed);
  const std::vector<BlendCurve> box = search_blends(filleted_box(15.0, 3.0, 30, 0.3, 0.02, 4), 4.5, 1.1);
  CHECK(box.size() == 12);
  for (const BlendCurve& t : box) CHECK(t.convex);
}

TEST_CASE("blend tracks: spheres, cylinders that are too wide and flat sheets have none", "[unit]") {
  CHECK(search_blends(sphere_block(5), 0.2, 0.05).empty());
  CHECK(search_blends(grid_block(30, 30, [](double, double) { return 0.0; }), 4.0, 1.0).empty());
  Swept s;
  s.radius = 60.0;
  CHECK(search_blends(swept_block(s), 4.5, 1.2).empty());
}

TEST_CASE("blend tracks: a track by hand goes through its points in even steps", "[unit]") {
  const std::vector<Double3> points = {{0, 0, 0}, {4, 0, 0}, {8, 3, 0}};
  const BlendCurve t = curve_through(points, false, 0.5);
  CHECK(t.centre.front() == points[0]);
  CHECK(norm(t.centre.back() - points[2]) < 1e-9);
  for (std::size_t i = 1; i < t.centre.size(); ++i)
    CHECK(norm(t.centre[i] - t.centre[i - 1]) == Approx(0.5).epsilon(0.05));
  double nearest = 1e9;
  for (const Double3& c : t.centre) nearest = std::min(nearest, norm(c - points[1]));
  CHECK(nearest < 0.26);
  CHECK_THROWS_AS(curve_through(std::span(points).first(1), false, 0.5), InputError);
  const std::vector<Double3> twice = {{1, 1, 1}, {1, 1, 1}};
  CHECK_THROWS_AS(curve_through(twice, false, 0.5), InputError);
}

}  // namespace blend_curves_test
