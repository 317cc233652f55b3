// Polygons triangulated: all of them is covered once, and every circle is empty.
#include <catch2/catch.hpp>

#include <algorithm>
#include <cmath>

#include "kernels/survey/polygon_delaunay.h"
#include "octree/portable_math.h"
#include "tests/helpers/random.h"

namespace polygon_delaunay_test {

using namespace tessera;

namespace {

using Rings = std::vector<std::vector<Double2>>;

std::vector<Double2> flat(const Rings& rings) {
  std::vector<Double2> all;
  for (const auto& ring : rings) all.insert(all.end(), ring.begin(), ring.end());
  return all;
}

double area(const std::vector<Double2>& p, const std::array<std::uint32_t, 3>& t) {
  return signed_area(std::array{p[t[0]], p[t[1]], p[t[2]]});
}

/// Corners on the edges of a ring too, `steps` pieces an edge.
std::vector<Double2> divided(const std::vector<Double2>& ring, int steps) {
  std::vector<Double2> out;
  for (std::size_t k = 0; k < ring.size(); ++k) {
    const Double2 &a = ring[k], &b = ring[(k + 1) % ring.size()];
    for (int i = 0; i < steps; ++i) {
      const double t = static_cast<double>(i) / steps;
      out.push_back({a[0] + t * (b[0] - a[0]), a[1] + t * (b[1] - a[1])});
    }
  }
  return out;
}

/// Edges that two triangles share have an empty circle on either side. \returns the number of such edges
std::size_t shared_edges(const std::vector<Double2>& p,
                         const std::vector<std::array<std::uint32_t, 3>>& triangles) {
  std::size_t count = 0;
  for (const auto& t : triangles)
    for (std::size_t e = 0; e < 3; ++e)
      for (const auto& u : triangles)
        for (std::size_t f = 0; f < 3; ++f) {
          if (u[f] != t[(e + 1) % 3] || u[(f + 1) % 3] != t[e]) continue;
          ++count;
          const Double2 &a = p[t[0]], &b = p[t[1]], &c = p[t[2]], &d = p[u[(f + 2) % 3]];
          const double ax = a[0] - d[0], ay = a[1] - d[1], bx = b[0] - d[0], by = b[1] - d[1],
                       cx = c[0] - d[0], cy = c[1] - d[1];
          const double in = (ax * ax + ay * ay) * (bx * cy - by * cx) +
                            (bx * bx + by * by) * (cx * ay - cy * ax) +
                            (cx * cx + cy * cy) * (ax * by - ay * bx);
          if (in > 1e-9) FAIL("a corner lies " << in << " within a circle");
        }
  return count / 2;
}

void check_covered(const Rings& rings, double wanted) {
  const auto triangles = polygon_delaunay(rings);
  REQUIRE(triangles);
  const std::vector<Double2> p = flat(rings);
  double sum = 0.0;
  for (const auto& t : *triangles) {
    CHECK(area(p, t) > 0.0);
    sum += area(p, t);
  }
  CHECK(sum == Approx(wanted).epsilon(1e-12));
  CHECK(shared_edges(p, *triangles) > 0);
}

}  // namespace

TEST_CASE("polygon delaunay: a rectangle takes the shorter diagonals of its sides' points", "[unit]") {
  // Two rows of points: any triangle has its corners on both, so circles decide.
  check_covered({divided({{0, 0}, {8, 0}, {8, 1}, {0, 1}}, 8)}, 8.0);
  check_covered({{{0, 0}, {2, -1}, {4, 0}, {2, 1}}}, 4.0);
  const auto kite = polygon_delaunay(Rings{{{0, 0}, {2, -1}, {4, 0}, {2, 1}}});
  REQUIRE(kite);
  CHECK(*kite == std::vector<std::array<std::uint32_t, 3>>{{0, 1, 3}, {1, 2, 3}});  // by the short diagonal
}

TEST_CASE("polygon delaunay: holes, whichever way round they run, are left out", "[unit]") {
  const std::vector<Double2> outline = {{0, 0}, {10, 0}, {10, 6}, {0, 6}};
  std::vector<Double2> hole = {{1, 1}, {3, 1}, {3, 3}, {1, 3}}, other = {{5, 2}, {6, 4}, {7, 2}};
  check_covered({outline, hole}, 56.0);
  std::reverse(hole.begin(), hole.end());
  check_covered({divided(outline, 7), divided(hole, 3), divided(other, 5)}, 54.0);
  std::vector<Double2> backwards = outline;
  std::reverse(backwards.begin(), backwards.end());
  check_covered({divided(backwards, 9), hole, other}, 54.0);
  // One behind the other, at the same height, and one that is closed off by an L.
  check_covered({outline, {{1, 2}, {2, 2}, {2, 3}}, {{3, 2}, {4, 2}, {4, 3}}, {{5, 2}, {6, 2}, {6, 3}}},
                58.5);
}

TEST_CASE("polygon delaunay: random stars with divided sides are covered once", "[property]") {
  test::Random random(3);
  for (int n = 0; n < 40; ++n) {
    std::vector<Double2> ring;
    const int corners = 5 + n % 20;
    for (int k = 0; k < corners; ++k) {
      const SinCos a = sin_cos(2.0 * kPi * k / corners);
      const double r = random.in(2.0, 9.0);
      ring.push_back({1000.0 + r * a.cos, r * a.sin});
    }
    const SinCos b = sin_cos(random.in(0, 6));
    const Double2 c = {1000.0, 0.0};
    const std::vector<Double2> hole = {{c[0] + b.cos, c[1] + b.sin},
                                       {c[0] - b.sin, c[1] + b.cos},
                                       {c[0] - b.cos, c[1] - b.sin},
                                       {c[0] + b.sin, c[1] - b.cos}};
    check_covered({divided(ring, 1 + n % 5), divided(hole, 1 + n % 3)}, signed_area(ring) - 2.0);
  }
}

TEST_CASE("polygon delaunay: what is no polygon with holes has none", "[unit]") {
  CHECK_FALSE(polygon_delaunay(Rings{{{0, 0}, {2, 2}, {2, 0}, {0, 2.5}}}));  // a bowtie
  CHECK_FALSE(polygon_delaunay(Rings{{{0, 0}, {4, 0}, {4, 4}, {0, 4}}, {{6, 1}, {7, 1}, {7, 2}}}));
}

TEST_CASE("polygon delaunay: a circle of twenty thousand corners takes no time to speak of", "[unit]") {
  std::vector<Double2> ring;
  constexpr int kCorners = 20000;
  for (int k = 0; k < kCorners; ++k) {
    const SinCos a = sin_cos(2.0 * kPi * k / kCorners);
    ring.push_back({a.cos, a.sin});
  }
  const auto triangles = polygon_delaunay(Rings{ring});
  REQUIRE(triangles);
  CHECK(triangles->size() == kCorners - 2);
}

}  // namespace polygon_delaunay_test
