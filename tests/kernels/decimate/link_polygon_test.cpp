#include "kernels/decimate/link_polygon.h"

#include <catch2/catch.hpp>

namespace tessera::link_polygon_test {
namespace {

/// The unit square from its corner at the origin, the corner across raised.
LinkLoop square(double raised) {
  LinkLoop loop;
  for (const Double3& p : {Double3{0, 0, 0}, {1, 0, 0}, {1, 1, raised}, {0, 1, 0}}) loop.at[loop.size++] = p;
  return loop;
}

/// A point with these coordinates in space.
PolygonPoint seen(const LinkPolygon& g, const Double3& p) {
  const Double3 n = cross(g.ex, g.ey);
  PolygonPoint out{.x = static_cast<float>(dot(p, g.ex)),
                   .y = static_cast<float>(dot(p, g.ey)),
                   .z = static_cast<float>(dot(p, n))};
  classify(g, out);
  return out;
}

}  // namespace

TEST_CASE("link polygon: points inside know their sector, those on the link are outside", "[unit]") {
  LinkPolygon g;
  REQUIRE(make_polygon(square(0.0), false, g));
  CHECK(seen(g, {0.7, 0.2, 0.0}).sector == 1);
  CHECK(seen(g, {0.2, 0.7, 0.0}).sector == 2);
  for (const Double3& p : {Double3{1.2, 0.5, 0}, {-0.1, -0.1, 0}, {0.5, 1.0, 0}, {1.0, 0.5, 0}})
    CHECK_FALSE(seen(g, p).inside);
}

TEST_CASE("link polygon: a closed fan needs a centre that sees its whole link", "[unit]") {
  LinkLoop loop;
  for (const Double3& p : {Double3{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {-1, 0, 0}, {0, -1, 0}})
    loop.at[loop.size++] = p;
  LinkPolygon g;
  REQUIRE(make_polygon(loop, true, g));
  CHECK(seen(g, {0.3, 0.3, 0.0}).sector == 1);
  CHECK(seen(g, {0.3, -0.3, 0.0}).sector == 4);
  CHECK(g.sector_before(1) == 4);
  for (std::size_t i = 1; i < 5; ++i) loop.at[i] = loop.at[i] + Double3{0.6, 0.6, 0.0};
  CHECK_FALSE(make_polygon(loop, true, g));
}

TEST_CASE("link polygon: a loop without area is none", "[unit]") {
  LinkLoop loop = square(0.0);
  for (std::size_t i = 0; i < 4; ++i) loop.at[i][1] = 0.0;
  LinkPolygon g;
  CHECK_FALSE(make_polygon(loop, false, g));
}

TEST_CASE("link polygon: a segment deviates most where it crosses a spoke or leaves over the link",
          "[unit]") {
  LinkPolygon g;
  REQUIRE(make_polygon(square(0.0), false, g));
  // Level over the only inner spoke, from corner to corner.
  const float level = crossing_deviation(g, seen(g, {0.7, 0.3, 0.25}), seen(g, {0.3, 0.7, 0.25}), 0.5f);
  CHECK(level == Approx(0.75));
  // Rises from 0 inside to 0.4 beyond the link, which it crosses half way.
  const float rising = crossing_deviation(g, seen(g, {0.8, 0.2, 0.0}), seen(g, {1.2, 0.2, 0.4}), 0.0f);
  CHECK(rising == Approx(0.2));
  CHECK(crossing_deviation(g, seen(g, {0.8, 0.2, 0.0}), seen(g, {0.6, 0.2, 0.4}), 1.0f) == 0.0f);
}

TEST_CASE("link polygon: a segment between points outside is told from one that passes by", "[unit]") {
  LinkPolygon g;
  REQUIRE(make_polygon(square(0.0), false, g));
  CHECK(meets_polygon(g, seen(g, {-0.5, 0.5, 0}), seen(g, {1.5, 0.4, 0})));
  CHECK(meets_polygon(g, seen(g, {0, 0, 0}), seen(g, {1, 1, 0})));
  CHECK_FALSE(meets_polygon(g, seen(g, {-0.5, 0.6, 0}), seen(g, {0.4, 1.5, 0})));
}

TEST_CASE("link polygon: a triangle above knows corners, sectors and whether it is turned over", "[unit]") {
  LinkPolygon g;
  REQUIRE(make_polygon(square(0.0), false, g));
  const PolygonPoint a = seen(g, {0.5, -0.5, 0.1}), b = seen(g, {1.5, 0.2, 0.1}),
                     c = seen(g, {0.9, 0.4, 0.1});
  const CornerDeviation above = corner_deviation(g, {&a, &b, &c});
  CHECK(above.corners == 2u);  // corner 1 alone
  CHECK(above.deviation == Approx(0.1));
  CHECK(overlapped_sectors(g, {&a, &b, &c}) == 2u);
  CHECK_FALSE(is_folded(g, {&a, &b, &c}));
  CHECK(is_folded(g, {&a, &c, &b}));
  const PolygonPoint d = seen(g, {0.3, 0.8, 0.1});
  CHECK(overlapped_sectors(g, {&a, &c, &d}) == 6u);
}

TEST_CASE("link polygon: beyond a line of the link the distance to it counts", "[unit]") {
  LinkPolygon g;
  REQUIRE(make_polygon(square(0.0), false, g));
  const std::uint64_t right = 2u;  // from (1, 0) to (1, 1)
  CHECK(distance_beyond_lines(g, right, seen(g, {1.3, 0.5, 0.4})) == Approx(0.5));
  CHECK(distance_beyond_lines(g, right, seen(g, {1.3, 1.5, 0.4})) < 0.0f);
  CHECK(distance_to_lines(g, right, 0, seen(g, {1.3, 1.4, 0.0}), 9.0f) == Approx(0.5));
  CHECK(distance_to_lines(g, 0, 8u, seen(g, {0.0, 1.5, 0.0}), 9.0f) == Approx(0.5));
  CHECK(distance_to_lines(g, 0, 0, seen(g, {0.0, 1.5, 0.0}), 9.0f) == 3.0f);
}

TEST_CASE("link polygon: deviations are heights over the planes of the fan", "[unit]") {
  LinkPolygon g;
  REQUIRE(make_polygon(square(0.4), false, g));
  for (const Double3& p : {Double3{0.7, 0.2, 0.08}, {0.2, 0.7, 0.08}}) {  // on the faces
    const PolygonPoint s = seen(g, p);
    REQUIRE(s.inside);
    CHECK(s.z - g.slope_x[s.sector] * s.x - g.slope_y[s.sector] * s.y == Approx(0.0).margin(1e-6));
  }
}

}  // namespace tessera::link_polygon_test
