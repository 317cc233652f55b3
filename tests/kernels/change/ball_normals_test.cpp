// Sides of normals, and normals that a rule bends.
#include <catch2/catch.hpp>

#include <vector>

#include "kernels/change/ball_normals.h"

namespace ball_normals_test {

using namespace tessera;

namespace {

std::optional<Double3> normal_at(const std::vector<Double3>& points, const Double3& p, double radius,
                                 const NormalRule& rule) {
  const PointCells cells(points, 0.3 * radius, true);
  NearCells near;
  near.collect(cells, {p, {}, radius, 0.0});
  return ball_normal(cells, near, p, radius, rule);
}

/// A grid on the plane through the origin with this normal.
std::vector<Double3> plane(const Double3& normal) {
  const Double3 u = any_orthogonal(normal), v = cross(normal, u);
  std::vector<Double3> points;
  for (int i = -5; i <= 5; ++i)
    for (int k = -5; k <= 5; ++k) points.push_back(u * (0.1 * i) + v * (0.1 * k));
  return points;
}

}  // namespace

TEST_CASE("ball normals: they show to the side asked for", "[unit]") {
  const Double3 tilted = unit(Double3{1.0, 2.0, -3.0});
  const std::vector<Double3> points = plane(tilted);
  NormalRule rule;
  CHECK(dot(*normal_at(points, {0, 0, 0}, 0.4, rule), tilted) == Approx(-1.0));  // up
  rule.direction = {0, 1, 0};
  CHECK(dot(*normal_at(points, {0, 0, 0}, 0.4, rule), tilted) == Approx(1.0));
  rule.viewpoint = Double3{-10.0, -20.0, 30.0};
  CHECK(dot(*normal_at(points, {0, 0, 0}, 0.4, rule), tilted) == Approx(-1.0));
}

TEST_CASE("ball normals: a wall has no upper side, its first component decides", "[unit]") {
  CHECK(norm(*normal_at(plane({1, 0, 0}), {0, 0, 0}, 0.4, {}) - Double3{1, 0, 0}) < 1e-12);
  CHECK(norm(*normal_at(plane({0, -1, 0}), {0, 0, 0}, 0.4, {}) - Double3{0, 1, 0}) < 1e-12);
}

TEST_CASE("ball normals: horizontal ones have no z, vertical ones nothing else", "[unit]") {
  NormalRule rule;
  rule.kind = NormalRule::Kind::kHorizontal, rule.direction = {1, 0, 0};
  const Double3 n = *normal_at(plane(unit(Double3{3.0, 4.0, 5.0})), {0, 0, 0}, 0.4, rule);
  CHECK(norm(n - Double3{0.6, 0.8, 0.0}) < 1e-9);
  CHECK_FALSE(normal_at(plane({0, 0, 1}), {0, 0, 0}, 0.4, rule).has_value());
  rule.kind = NormalRule::Kind::kVertical, rule.direction = {0, 0, 1};
  CHECK(*normal_at({{0, 0, 0}}, {0, 0, 0}, 0.4, rule) == Double3{0, 0, 1});
}

}  // namespace ball_normals_test
