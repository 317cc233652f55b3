#include "kernels/mesh/polygon_triangulation.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>

#include <catch2/catch.hpp>

#include "kernels/mesh/flat_faces.h"
#include "tests/helpers/random.h"

namespace tessera::polygon_triangulation_test {
namespace {

using Triangles = std::vector<std::array<std::uint32_t, 3>>;
using Polygon = std::vector<Double3>;

struct Cut {
  Triangles triangles;
  bool covered = false;
  double area = 0.0;     ///< sum over the triangles
  double minimum = 1.0;  ///< cosine between the normal of a triangle and the polygon's
  std::size_t flat = 0;  ///< triangles without area
};

Cut cut(const Polygon& p) {
  Cut c;
  c.covered = triangulate_polygon(p, c.triangles);
  const Double3 normal = unit_or_zero(newell_normal(p));
  for (const auto& t : c.triangles) {
    const Double3 n = triangle_normal(p[t[0]], p[t[1]], p[t[2]]);
    c.area += 0.5 * norm(n);
    if (face_extent(p[t[0]], p[t[1]], p[t[2]]).is_flat())
      ++c.flat;
    else
      c.minimum = std::min(c.minimum, dot(unit(n), normal));
  }
  return c;
}

double area_of(const Polygon& p) {
  return 0.5 * norm(newell_normal(p));
}

/// n - 2 triangles; every edge of the polygon is in one of them, the way it runs, every other edge in two, both ways.
void require_disk(const Polygon& p, const Triangles& triangles) {
  REQUIRE(triangles.size() == p.size() - 2);
  std::map<std::pair<std::uint32_t, std::uint32_t>, int> sides;
  for (const auto& t : triangles)
    for (std::size_t k = 0; k < 3; ++k) ++sides[{t[k], t[(k + 1) % 3]}];
  for (const auto& [side, count] : sides) {
    REQUIRE(count == 1);
    const bool outline = side.second == (side.first + 1) % p.size();
    REQUIRE(sides.count({side.second, side.first}) == (outline ? 0 : 1));
  }
}

/// A planar polygon anywhere in space.
Polygon placed(const std::vector<std::array<double, 2>>& flat, test::Random& random) {
  const auto number = [&] { return random.in(-1.0, 1.0); };
  Double3 n = {number(), number(), number() + 1e-3};
  n = unit(n);
  const Double3 u = any_orthogonal(n), v = cross(n, u);
  const Double3 at = {1e3 * number(), 1e3 * number(), 1e3 * number()};
  Polygon out;
  for (const auto& q : flat) out.push_back(at + u * q[0] + v * q[1]);
  return out;
}

void require_cover(const Polygon& p) {
  const Cut c = cut(p);
  REQUIRE(c.covered);
  require_disk(p, c.triangles);
  CHECK(c.area == Approx(area_of(p)).epsilon(1e-9));
  CHECK(c.minimum > 0.999999);
}

/// A wall with windows in a row, each on a bridge from the lower edge.
std::vector<std::array<double, 2>> wall(int windows) {
  std::vector<std::array<double, 2>> p = {{0, 0}};
  for (int i = 0; i < windows; ++i) {
    const double x = 3.0 * i + 1.0;
    p.insert(p.end(), {{x, 0}, {x, 1}, {x, 3}, {x + 1.5, 3}, {x + 1.5, 1}, {x, 1}, {x, 0}});
  }
  p.insert(p.end(), {{3.0 * windows + 1.0, 0}, {3.0 * windows + 1.0, 4}, {0, 4}});
  return p;
}

TEST_CASE("polygon triangulation: what a fan covers keeps its fan", "[unit]") {
  const Triangles fan = {{0, 1, 2}, {0, 2, 3}};
  CHECK(cut({{0, 0, 0}, {1, 0, 0}, {1, 1, 0}, {0, 1, 0}}).triangles == fan);
  CHECK(cut({{0, 0, 0}, {1, 0, 0.4}, {1, 1, 0}, {0, 1, 0.4}}).triangles == fan);  // warped
  CHECK(cut({{0, 0, 0}, {2, 0, 0}, {0.6, 0.6, 0}, {0, 2, 0}}).triangles ==
        fan);  // concave, seen from its first corner
  CHECK(cut({{0, 0, 0}, {1, 0, 0}, {0, 1, 0}}).triangles == Triangles{{0, 1, 2}});
  Polygon ring;
  for (int i = 0; i < 500; ++i) ring.push_back({std::cos(i * 0.0125663706), 0.5, std::sin(i * 0.0125663706)});
  const Cut c = cut(ring);
  for (std::uint32_t i = 0; i < 498; ++i)
    REQUIRE(c.triangles[i] == std::array<std::uint32_t, 3>{0, i + 1, i + 2});
}

TEST_CASE("polygon triangulation: concave polygons, whichever corner is first", "[unit]") {
  const Polygon dart = {{0, 0, 0}, {2, -1, 0}, {0.5, 0, 0}, {2, 1, 0}};
  const Polygon corner = {{0, 0, 1}, {2, 0, 1}, {2, 1, 1}, {1, 1, 1}, {1, 2, 1}, {0, 2, 1}};
  for (const Polygon& shape : {dart, corner})
    for (std::size_t first = 0; first < shape.size(); ++first)
      for (const bool backwards : {false, true}) {
        Polygon p = shape;
        std::rotate(p.begin(), p.begin() + static_cast<std::ptrdiff_t>(first), p.end());
        if (backwards) std::reverse(p.begin(), p.end());
        CAPTURE(shape.size(), first, backwards);
        require_cover(p);
        CHECK(cut(p).flat == 0);
      }
}

TEST_CASE("polygon triangulation: windows on bridges stay open", "[unit]") {
  test::Random random(4);
  for (const int windows : {1, 2, 7, 60, 400}) {
    CAPTURE(windows);
    const auto flat = wall(windows);
    Polygon p;
    for (const auto& q : flat) p.push_back({q[0], 0.0, q[1]});
    CHECK(area_of(p) == Approx(4.0 * (3.0 * windows + 1.0) - 3.0 * windows));
    require_cover(p);
    CHECK(cut(p).flat == 0);
    require_cover(placed(flat, random));
  }
  // One window inside the other's bridge: the outline touches itself in corners only.
  require_cover({{0, 0, 0},
                 {10, 0, 0},
                 {10, 6, 0},
                 {0, 6, 0},
                 {0, 0, 0},
                 {3, 2, 0},
                 {3, 4, 0},
                 {7, 4, 0},
                 {7, 2, 0},
                 {3, 2, 0}});
}

TEST_CASE("polygon triangulation: random outlines are covered once", "[property]") {
  test::Random random(11);
  for (int round = 0; round < 300; ++round) {
    CAPTURE(round);
    const int n = 4 + static_cast<int>(random.below(round % 10 == 0 ? 2000 : 60));
    std::vector<std::array<double, 2>> p;
    if (round % 3 == 0) {  // a star
      for (int i = 0; i < n; ++i) {
        const double r = random.in(1.0, 10.0), angle = 6.283185307179586 * i / n;
        p.push_back({r * std::cos(angle), r * std::sin(angle)});
      }
    } else if (round % 3 == 1) {  // a comb: upper teeth and lower ones at random heights
      for (int i = 0; i <= n; ++i) p.push_back({1.0 * i, -0.5 - random.in(0.0, 10.0)});
      for (int i = n; i >= 0; --i) p.push_back({1.0 * i, 0.5 + random.in(0.0, 10.0)});
    } else {  // a spiral band
      const double step = 0.15;
      for (int i = 0; i < n; ++i)
        p.push_back({(1 + step * i) * std::cos(0.3 * i), (1 + step * i) * std::sin(0.3 * i)});
      for (int i = n - 1; i >= 0; --i)
        p.push_back({(1.8 + step * i) * std::cos(0.3 * i), (1.8 + step * i) * std::sin(0.3 * i)});
      std::reverse(p.begin(), p.end());
    }
    require_cover(placed(p, random));
  }
}

TEST_CASE("polygon triangulation: corners in line and repeated ones keep their edges", "[unit]") {
  // Edges cut by the corners of neighbours: no face without area is needed.
  Polygon cut_edges = {{0, 0, 0}, {1, 0, 0},   {2, 0, 0}, {3, 0, 0}, {3, 1, 0},
                       {3, 2, 0}, {1.5, 2, 0}, {0, 2, 0}, {0, 1, 0}};
  for (std::size_t first = 0; first < cut_edges.size(); ++first) {
    CAPTURE(first);
    require_cover(cut_edges);
    CHECK(cut(cut_edges).flat == 0);
    std::rotate(cut_edges.begin(), cut_edges.begin() + 1, cut_edges.end());
  }
  const Polygon doubled = {{0, 0, 0}, {2, 0, 0}, {2, 0, 0}, {2, 2, 0}, {1, 0.5, 0}, {0, 2, 0}};
  const Cut c = cut(doubled);
  CHECK(c.covered);
  require_disk(doubled, c.triangles);
  CHECK(c.area == Approx(area_of(doubled)));
  CHECK(c.flat == 1);
  // A spike out and one in.
  for (const double tip : {-1.0, 1.0}) {
    const Polygon spike = {{0, 0, 0}, {1, 0, 0}, {1, tip, 0}, {1, 0, 0}, {2, 0, 0}, {2, 2, 0}, {0, 2, 0}};
    const Cut s = cut(spike);
    require_disk(spike, s.triangles);
    CHECK(s.area == Approx(4.0));
  }
  // Rounded to floats on a slope, corners in line are in line no more.
  test::Random random(8);
  for (int round = 0; round < 50; ++round) {
    Polygon p =
        placed({{0, 0}, {10, 0}, {20, 0}, {30, 0}, {30, 10}, {20, 10}, {20, 20}, {10, 20}, {0, 20}, {0, 10}},
               random);
    for (Double3& q : p) q = wide(narrow(q));
    const Cut rounded = cut(p);
    CHECK(rounded.covered);
    CHECK(rounded.area == Approx(500.0).epsilon(1e-4));
  }
}

TEST_CASE("polygon triangulation: what has no triangulation says so and has as many triangles", "[unit]") {
  const Polygon line = {{0, 0, 0}, {1, 1, 1}, {2, 2, 2}, {3, 3, 3}};
  CHECK(cut(line).covered);
  CHECK(cut(line).triangles == Triangles{{0, 1, 2}, {0, 2, 3}});
  const Polygon bowtie = {{0, 0, 0}, {1, 1, 0}, {1, 0, 0}, {0, 1, 0}};
  CHECK_FALSE(cut(bowtie).covered);
  CHECK(cut(bowtie).triangles.size() == 2);
  const Polygon crossing = {{0, 0, 0}, {4, 0, 0}, {4, 4, 0}, {1, -1, 0}, {0, 4, 0}};
  CHECK_FALSE(cut(crossing).covered);
  CHECK(cut(crossing).triangles.size() == 3);
  const double nan = std::numeric_limits<double>::quiet_NaN();
  const Polygon unknown = {{0, 0, 0}, {1, 0, 0}, {nan, 1, 0}, {0, 1, 0}};
  CHECK(cut(unknown).triangles == Triangles{{0, 1, 2}, {0, 2, 3}});
  const Polygon huge = {{0, 0, 0}, {3e38, 0, 0}, {1e37, 1e37, 0}, {0, 3e38, 0}};
  CHECK(cut(huge).covered);
  // Random corners cross themselves everywhere; the time stays that of a clean outline.
  test::Random random(2);
  Polygon scribble;
  for (int i = 0; i < 20000; ++i) scribble.push_back({random.in(0.0, 1000.0), random.in(0.0, 1000.0), 0.0});
  const Cut c = cut(scribble);
  CHECK_FALSE(c.covered);
  require_disk(scribble, c.triangles);
}

}  // namespace
}  // namespace tessera::polygon_triangulation_test
