#include "kernels/solid/wall_balls.h"

#include <algorithm>
#include <catch2/catch.hpp>
#include <cmath>

#include "octree/vector.h"
#include "tests/helpers/random.h"

namespace tessera::wall_balls_test {
namespace {

using Corners = std::array<Double3, 3>;
constexpr double kNone = std::numeric_limits<double>::infinity();

/// By many points of the triangle; never below the true radius.
double sampled_radius(const WallSample& s, const Corners& f) {
  double least = kNone;
  constexpr int kSteps = 400;
  for (int i = 0; i <= kSteps; ++i)
    for (int j = 0; i + j <= kSteps; ++j) {
      const Double3 x =
          f[0] + (f[1] - f[0]) * (i / double{kSteps}) + (f[2] - f[0]) * (j / double{kSteps}) - s.position;
      const double ahead = dot(s.inward, x);
      if (ahead > 0.0) least = std::min(least, dot(x, x) / (2.0 * ahead));
    }
  return least;
}

Double3 random_point(test::Random& random, double size) {
  return {random.in(-0.5 * size, 0.5 * size), random.in(-0.5 * size, 0.5 * size),
          random.in(-0.5 * size, 0.5 * size)};
}

TEST_CASE("wall balls: across a plate of thickness 2 the ball has radius 1", "[unit]") {
  const WallSample s{{0, 0, 0}, {0, 0, 1}};
  CHECK(wall_ball_radius(s, {{{-9, -9, 2}, {9, -9, 2}, {0, 9, 2}}}) == 1.0);
  // Seen from behind, or a side wall, or a wall of 60 degrees.
  CHECK(wall_ball_radius(s, {{{9, -9, 2}, {-9, -9, 2}, {0, 9, 2}}}) == kNone);
  CHECK(wall_ball_radius(s, {{{1, -9, 0}, {1, 9, 0}, {1, 0, 9}}}) == kNone);
  const double a = std::cos(1.0471975511965976), b = std::sin(1.0471975511965976);
  CHECK(wall_ball_radius(s, {{{-9, 0, 2}, {9, 0, 2}, {0, 9 * a, 2 - 9 * b}}}) == kNone);
  // Behind the place, and without an area.
  CHECK(wall_ball_radius(s, {{{-9, -9, -2}, {9, -9, -2}, {0, 9, -2}}}) == kNone);
  CHECK(wall_ball_radius(s, {{{-9, -9, 2}, {9, 9, 2}, {0, 0, 2}}}) == kNone);
}

TEST_CASE("wall balls: a small face to the side is touched at its corner", "[unit]") {
  const WallSample s{{0, 0, 0}, {0, 0, 1}};
  // Through (1, 0, 2): r = 5 / 4.
  CHECK(wall_ball_radius(s, {{{1, 0, 2}, {3, -1, 2}, {3, 1, 2}}}) == Approx(1.25));
  // Through the middle of an edge, as near.
  CHECK(wall_ball_radius(s, {{{1, 1, 2}, {1, -1, 2}, {3, 0, 2}}}) == Approx(1.25));
}

TEST_CASE("wall balls: no point of a random face lies deeper in its ball, and one touches it", "[property]") {
  test::Random random(7);
  int found = 0;
  for (int i = 0; i < 4000 && found < 60; ++i) {
    const WallSample s{random_point(random, 1.0), unit(random_point(random, 1.0))};
    const Corners f = {random_point(random, 4.0), random_point(random, 4.0), random_point(random, 4.0)};
    const double radius = wall_ball_radius(s, f);
    if (radius == kNone) continue;
    ++found;
    CAPTURE(i, radius);
    const double sampled = sampled_radius(s, f);
    CHECK(radius <= sampled * (1 + 1e-12));
    CHECK(radius >= 0.95 * sampled);
  }
  CHECK(found == 60);
}

TEST_CASE("wall balls: parts of the faces in any order give the smallest of all, to the bit", "[property]") {
  test::Random random(11);
  std::vector<Corners> faces;
  for (int i = 0; i < 3000; ++i) {
    const Double3 at = random_point(random, 10.0);
    faces.push_back({at, at + random_point(random, 0.7), at + random_point(random, 0.7)});
  }
  std::vector<WallSample> samples;
  for (int i = 0; i < 200; ++i)
    samples.push_back({random_point(random, 8.0), unit(random_point(random, 1.0))});
  std::vector<WallSample> parts = samples;
  const WallFaces all(faces);
  const WallFaces back({faces.rbegin(), faces.rbegin() + 1000}), front({faces.begin(), faces.begin() + 2000});
  int facing = 0;
  for (std::size_t i = 0; i < samples.size(); ++i) {
    double least = kNone;
    for (const Corners& f : faces) least = std::min(least, wall_ball_radius(samples[i], f));
    all.shrink(samples[i]);
    back.shrink(parts[i]);
    front.shrink(parts[i]);
    CHECK(samples[i].radius == least);
    CHECK(parts[i].radius == least);
    facing += least < kNone ? 1 : 0;
  }
  CHECK(facing > 150);
}

}  // namespace
}  // namespace tessera::wall_balls_test
