#include "kernels/solid/blended_shape.h"

#include <catch2/catch.hpp>

#include <cmath>

#include "octree/portable_math.h"
#include "tests/helpers/random.h"

namespace blended_shape_test {

using namespace tessera;
using namespace tessera::test;

namespace {

std::unique_ptr<SolidShape> half_space(const Double3& normal) {
  return make_shape("halfspace", {0, 0, 0, normal[0], normal[1], normal[2]}, {});
}
std::unique_ptr<SolidShape> shape(const char* kind, const std::vector<double>& numbers) {
  return make_shape(kind, numbers, {});
}

}  // namespace

TEST_CASE("blended shape: two planes at any angle get a cylinder of the radius, tangent to both", "[unit]") {
  const double radius = 0.7;
  for (const double degrees : {30.0, 60.0, 90.0, 120.0, 150.0}) {
    CAPTURE(degrees);
    // The outward normals of a floor and of a wall with so wide a gap between them.
    const SinCos gap = sin_cos(degrees * kPi / 180.0);
    const Double3 floor = {0, 0, 1}, wall = {gap.sin, 0, -gap.cos};
    const auto blend = blend_shapes(half_space(floor), half_space(wall), SolidTree::Join::kUnite, radius);
    // The centre: at the radius from both.
    const double g = dot(floor, wall);
    const Double3 centre = (floor + wall) * (radius / (1.0 + g));
    for (int step = 0; step <= 20; ++step) {
      const Double3 direction = unit(floor * (step / 20.0) + wall * (1.0 - step / 20.0));
      const Double3 p = centre - direction * radius + Double3{0, 3.0 * step, 0};
      CHECK(blend->distance(p) == Approx(0.0).margin(1e-10));
      CHECK(blend->distance(p + direction * 0.3) == Approx(0.3).margin(1e-10));
      CHECK(blend->distance(p - direction * 0.1) == Approx(-0.1).margin(1e-10));
      if (step > 0 && step < 20) CHECK(norm(unit(blend->direction(p)) - direction) < 1e-9);
    }
    CHECK(blend->distance(floor * 0.01 + (wall - floor * g) * 10.0) == Approx(0.01).margin(1e-10));
  }
}

TEST_CASE("blended shape: curved surfaces get what a ball leaves that rolls along both", "[unit]") {
  // A rod on a floor: a quarter of a torus.
  const auto foot = blend_shapes(half_space({0, 0, 1}), shape("cylinder", {0, 0, -5, 0, 0, 9, 2}),
                                 SolidTree::Join::kUnite, 0.5);
  // A bore through a plate, its rim rounded: the ball lies within the plate.
  const auto edge = blend_shapes(half_space({0, 0, 1}), shape("cylinder", {0, 0, -5, 0, 0, 9, 2}),
                                 SolidTree::Join::kSubtract, 0.5);
  // Two balls: the centre lies where the balls of radii larger by 0.5 meet.
  const auto balls = blend_shapes(shape("sphere", {0, 0, 0, 3}), shape("sphere", {4, 0, 0, 2}),
                                  SolidTree::Join::kUnite, 0.5);
  const double x = (3.5 * 3.5 - 2.5 * 2.5 + 16.0) / 8.0, ring = std::sqrt(3.5 * 3.5 - x * x);
  for (int trial = 0; trial < 12; ++trial) {
    const SinCos about = sin_cos(trial * 0.55);
    for (int step = 0; step <= 10; ++step) {
      const SinCos a = sin_cos(0.5 * kPi * step / 10.0);
      const Double3 out = {about.cos, about.sin, 0};
      CHECK(foot->distance(out * (2.5 - 0.5 * a.cos) + Double3{0, 0, 0.5 - 0.5 * a.sin}) ==
            Approx(0.0).margin(1e-10));
      CHECK(edge->distance(out * (2.5 - 0.5 * a.cos) + Double3{0, 0, -0.5 + 0.5 * a.sin}) ==
            Approx(0.0).margin(1e-10));
      // From the contact with one ball to that with the other.
      const Double3 centre = {x, ring * about.cos, ring * about.sin};
      const Double3 first = unit(Double3{0, 0, 0} - centre), last = unit(Double3{4, 0, 0} - centre);
      const Double3 direction = unit(first * (1.0 - step / 10.0) + last * (step / 10.0));
      CHECK(balls->distance(centre + direction * 0.5) == Approx(0.0).margin(1e-10));
    }
  }
}

TEST_CASE("blended shape: values never pass the distance, sharp joints stay what they are", "[property]") {
  Random random(5);
  const auto point = [&] {
    return Double3{10.0 * random.unit() - 5.0, 10.0 * random.unit() - 5.0, 10.0 * random.unit() - 5.0};
  };
  const auto parts = [] {
    return std::pair{shape("box", {-2, -2, -2, 2, 2, 1}), shape("cylinder", {0, 0, 0, 0, 1, 4, 1})};
  };
  for (const SolidTree::Join join :
       {SolidTree::Join::kUnite, SolidTree::Join::kIntersect, SolidTree::Join::kSubtract}) {
    auto [a, b] = parts();
    auto [c, d] = parts();
    const auto sharp = blend_shapes(std::move(a), std::move(b), join, 0.0);
    const auto round = blend_shapes(std::move(c), std::move(d), join, 0.4);
    const auto [box, rod] = parts();
    Double3 low, high;
    REQUIRE(round->bounds(low, high));
    std::size_t filled = 0, gone = 0;
    for (int i = 0; i < 20'000; ++i) {
      const Double3 p = point();
      const double in_box = box->value(p), in_rod = rod->value(p);
      const bool inside = join == SolidTree::Join::kUnite       ? in_box < 0 || in_rod < 0
                          : join == SolidTree::Join::kIntersect ? in_box < 0 && in_rod < 0
                                                                : in_box < 0 && !(in_rod < 0);
      CHECK((sharp->value(p) < 0.0) == inside);
      const bool contained = round->value(p) < 0.0;
      filled += contained && !inside;
      gone += !contained && inside;
      if (contained)
        for (std::size_t k = 0; k < 3; ++k) CHECK((p[k] >= low[k] && p[k] <= high[k]));
      // No surface is passed within the value.
      const double value = round->value(p);
      const Double3 q = p + unit(point()) * (0.999 * std::fabs(value));
      CHECK((round->value(q) < 0.0) == contained);
    }
    CHECK((join == SolidTree::Join::kUnite ? filled : gone) > 2);
    CHECK((join == SolidTree::Join::kUnite ? gone : filled) == 0);
  }
}

}  // namespace blended_shape_test
