#include "kernels/blends/rib_profile.h"

#include <catch2/catch.hpp>
#include <cmath>

#include "octree/portable_math.h"

namespace rib_profile_test {

using namespace tessera;

namespace {

RibProfile tilted(double radius, bool convex) {
  RibProfile p;
  p.angle = convex ? std::array{-0.6, 0.9} : std::array{0.6, -0.9};
  p.offset = {0.3, -0.2};
  p.radius = convex ? radius : -radius;
  return p;
}

std::vector<Double2> points_on(const RibProfile& p, int count) {
  std::vector<Double2> out;
  for (int i = 0; i <= count; ++i) {
    const double t = static_cast<double>(i) / count;
    out.push_back(p.on_arc(t));
    out.push_back(p.on_flank(0, p.tangent_length() + 5.0 * t));
    out.push_back(p.on_flank(1, p.tangent_length() + 6.0 * t));
  }
  return out;
}

}  // namespace

TEST_CASE("rib profile: points on it are at distance 0 and at their arc length", "[unit]") {
  const bool convex = GENERATE(true, false);
  const RibProfile p = tilted(2.0, convex);
  CHECK(p.arc_angle() == Approx(1.5));
  CHECK(p.arc_length() == Approx(3.0));
  CHECK(p.tangent_length() == Approx(2.0 * std::tan(0.75)));
  for (const double t : {0.0, 0.25, 0.7, 1.0}) {
    const ProfilePosition at = profile_position(p, p.on_arc(t));
    CHECK(std::fabs(at.distance) < 1e-14);
    CHECK(at.run == Approx((t - 0.5) * 3.0).margin(1e-12));
  }
  const ProfilePosition left = profile_position(p, p.on_flank(0, p.tangent_length() + 1.0));
  CHECK(left.zone == RibZone::kLeft);
  CHECK(left.run == Approx(-2.5));
  const Double2 n = p.arc_normal(0.3), on = p.on_arc(0.3);
  CHECK(profile_position(p, {on[0] + 0.1 * n[0], on[1] + 0.1 * n[1]}).distance == Approx(0.1));
}

TEST_CASE("rib profile: exact points give the exact profile, from a rough guess", "[unit]") {
  const bool convex = GENERATE(true, false);
  const double radius = GENERATE(0.0, 0.5, 2.0);
  CAPTURE(convex, radius);
  const RibProfile p = tilted(radius, convex);
  std::vector<Double2> points = points_on(p, 30);
  const Double2 m = p.middle();
  for (Double2& q : points) q[0] -= m[0];
  const ProfileFit guess = guess_profile(points, 1.3, convex);
  REQUIRE(guess.found);
  const ProfileFit fit = fit_profile(points, guess.profile, convex);
  REQUIRE(fit.found);
  CHECK(fit.rms < 1e-8);
  CHECK(std::fabs(fit.profile.radius - p.radius) < 1e-7);
  CHECK(fit.profile.angle[0] == Approx(p.angle[0]).margin(1e-8));
  CHECK(fit.profile.angle[1] == Approx(p.angle[1]).margin(1e-8));
}

TEST_CASE("rib profile: one line has no corner", "[unit]") {
  std::vector<Double2> line;
  for (int i = -20; i <= 20; ++i) line.push_back({0.3 * i, 0.01 * i});
  CHECK_FALSE(guess_profile(line, 2.0, true).found);
  CHECK_FALSE(fit_profile(std::span(line).first(5), tilted(1.0, true), true).found);
}

}  // namespace rib_profile_test
