#include "kernels/blends/rib_planes.h"

#include <catch2/catch.hpp>
#include <cmath>

#include "octree/portable_math.h"

namespace rib_planes_test {

using namespace tessera;

namespace {

/// A quarter of a circle of `radius` between two straight pieces, in the xy plane, steps of about `step`.
RibPlanes curved_planes(double radius, double step) {
  std::vector<Double3> spine, up;
  for (double x = -6.0; x < 0.0; x += step) spine.push_back({x, 0.0, 0.0});
  const int n = std::max(2, static_cast<int>(0.5 * kPi * radius / step));
  for (int i = 0; i < n; ++i) {
    const SinCos a = sin_cos(0.5 * kPi * i / n);
    spine.push_back({radius * a.sin, radius * (1.0 - a.cos), 0.0});
  }
  for (double y = 0.0; y < 6.0; y += step) spine.push_back({radius, radius + y, 0.0});
  up.assign(spine.size(), {0.0, 0.0, 1.0});
  return planes_across(spine, up, false, 0, 0);
}

RibEnds ends_at(const RibPlanes& planes, double width) {
  RibEnds ends;
  for (std::size_t i = 0; i < planes.size(); ++i) {
    ends.left.push_back(planes.at(i, -width, -0.5));
    ends.right.push_back(planes.at(i, width, -0.5));
  }
  return ends;
}

}  // namespace

TEST_CASE("rib planes: every point between two planes has one place, exact along lines and arcs", "[unit]") {
  std::vector<Double3> ring, up;
  const int n = 48;
  for (int i = 0; i < n; ++i) {
    const SinCos a = sin_cos(2.0 * kPi * i / n);
    ring.push_back({10.0 * a.cos, 10.0 * a.sin, 1.0});
    up.push_back({0.0, 0.0, 1.0});
  }
  const RibPlanes planes = planes_across(ring, up, true, 0, 8);
  REQUIRE(planes.size() == n);
  CHECK(planes.length() == Approx(2.0 * kPi * 10.0).epsilon(2e-3));
  const double radius = norm(Double3{planes[0].origin[0], planes[0].origin[1], 0.0});
  for (const double angle : {0.01, 1.7, 3.3, 6.2}) {
    const SinCos a = sin_cos(angle);
    const auto at = planes.locate({8.5 * a.cos, 8.5 * a.sin, 1.25}, 0);
    const auto near =
        planes.locate({8.5 * a.cos, 8.5 * a.sin, 1.25}, static_cast<std::size_t>(at ? at->rib : 0));
    REQUIRE(near);
    CHECK(near->rib == Approx(angle / (2.0 * kPi) * n).margin(1e-4));
    CHECK(std::fabs(near->x) == Approx(radius - 8.5).margin(5e-5));
    CHECK(near->y == Approx(0.25));
  }
  const RibPlanes straight = planes_across({{0, 0, 0}, {1, 0, 0}, {2, 0, 0}, {3, 0, 0}},
                                           {{0, 0, 1}, {0, 0, 1}, {0, 0, 1}, {0, 0, 1}}, false, 0, 0);
  const auto before = straight.locate({-0.5, 0.25, 2.0}, 1);
  REQUIRE(before);
  CHECK(before->rib == -0.5);
  CHECK(straight.at(0, before->x, before->y)[1] == 0.25);
}

TEST_CASE("rib planes: ribs that overlap in a bend are straightened by their end trajectories", "[unit]") {
  RibPlanes planes = curved_planes(1.0, 0.5);
  const RibEnds ends = ends_at(planes, 1.6);
  REQUIRE(ribs_cross(planes, ends, 0.05));
  REQUIRE(straighten_ribs(planes, ends, 0.05));
  // Planes changed only where they had to: the first and the last one stand as they did.
  CHECK(std::fabs(planes[0].along[0]) > 0.99);
  RibEnds now;
  for (std::size_t i = 0; i < planes.size(); ++i) {
    now.left.push_back(planes.at(i, -1.6, -0.5));
    now.right.push_back(planes.at(i, 1.6, -0.5));
    CHECK(std::fabs(dot(planes[i].across, planes[i].along)) < 1e-12);
    CHECK(norm(planes[i].up) == Approx(1.0));
  }
  CHECK_FALSE(ribs_cross(planes, now, 0.0));
}

TEST_CASE(
    "rib planes: ribs that do not overlap are told so, and no filter helps ribs wider than a full circle",
    "[unit]") {
  const RibPlanes planes = curved_planes(4.0, 0.5);
  CHECK_FALSE(ribs_cross(planes, ends_at(planes, 1.6), 0.05));
  std::vector<Double3> ring, up;
  for (int i = 0; i < 24; ++i) {
    const SinCos a = sin_cos(2.0 * kPi * i / 24);
    ring.push_back({2.0 * a.cos, 2.0 * a.sin, 0.0});
    up.push_back({0.0, 0.0, 1.0});
  }
  RibPlanes closed = planes_across(ring, up, true, 0, 0);
  CHECK_FALSE(straighten_ribs(closed, ends_at(closed, 2.5), 0.05));
}

TEST_CASE("rib planes: smoothing leaves lines and curves of even curvature where they are", "[unit]") {
  std::vector<double> line;
  std::vector<Double3> parabola;
  for (int i = 0; i < 12; ++i) {
    line.push_back(3.0 + 0.5 * i);
    parabola.push_back({1.0 * i, 0.1 * i * i, 0.0});
  }
  const std::vector<double> was = line;
  const std::vector<Double3> curve = parabola;
  smooth_line(line, false, 20);
  smooth_curve(parabola, false, 20);
  for (std::size_t i = 0; i < was.size(); ++i) {
    CHECK(line[i] == Approx(was[i]));
    CHECK(norm(parabola[i] - curve[i]) < 1e-12);
  }
}

}  // namespace rib_planes_test
