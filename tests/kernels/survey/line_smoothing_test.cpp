// Lines smoothed: within their limits, without crossing themselves.
#include <catch2/catch.hpp>

#include <algorithm>
#include <cmath>

#include "kernels/survey/line_smoothing.h"
#include "octree/portable_math.h"
#include "tests/helpers/random.h"

namespace line_smoothing_test {

using namespace tessera;

namespace {

double turning(const std::vector<Double2>& line) {
  double sum = 0.0;
  for (std::size_t k = 1; k + 1 < line.size(); ++k) {
    const double a = std::atan2(line[k][1] - line[k - 1][1], line[k][0] - line[k - 1][0]),
                 b = std::atan2(line[k + 1][1] - line[k][1], line[k + 1][0] - line[k][0]);
    sum += std::abs(std::remainder(b - a, 2.0 * kPi));
  }
  return sum;
}

double distance_to(const Double2& p, const std::vector<Double2>& line, bool closed) {
  double best = 1e300;
  for (std::size_t k = 0; k + (closed ? 0 : 1) < line.size(); ++k)
    best = std::min(best, segment_distance(p, p, line[k], line[(k + 1) % line.size()]));
  return best;
}

}  // namespace

TEST_CASE("line smoothing: distances of segments, crossing and apart", "[unit]") {
  CHECK(segment_distance({0, 0}, {2, 0}, {1, -1}, {1, 1}) == 0.0);
  CHECK(segment_distance({0, 0}, {2, 0}, {1, 1}, {5, 1}) == 1.0);
  CHECK(segment_distance({0, 0}, {2, 0}, {5, 4}, {9, 4}) == 5.0);
  CHECK(segment_distance({0, 0}, {2, 0}, {2, 0}, {3, 3}) == 0.0);
  CHECK(segment_distance({0, 0}, {0, 0}, {3, 4}, {3, 4}) == 5.0);
}

TEST_CASE("line smoothing: a line that crosses or folds onto itself is told", "[unit]") {
  const std::vector<Double2> bow = {{0, 0}, {2, 2}, {2, 0}, {0, 2}};
  CHECK(self_crossings(bow, false) == std::vector<std::size_t>{0, 2});
  CHECK(self_crossings(bow, true) == std::vector<std::size_t>{0, 2});
  const std::vector<Double2> square = {{0, 0}, {2, 0}, {2, 2}, {0, 2}};
  CHECK(self_crossings(square, true).empty());
  const std::vector<Double2> fold = {{0, 0}, {2, 0}, {1, 0}};
  CHECK(self_crossings(fold, false) == std::vector<std::size_t>{0, 1});
  const std::vector<Double2> touch = {{0, 0}, {4, 0}, {4, 2}, {2, 0}};
  CHECK_FALSE(self_crossings(touch, false).empty());
}

TEST_CASE("line smoothing: a wiggle becomes smooth, its ends stay, no point leaves its limit", "[unit]") {
  std::vector<Double2> wiggle;
  for (int k = 0; k <= 40; ++k) wiggle.push_back({k * 1.0, k % 2 == 0 ? 0.0 : 0.3});
  const std::vector<double> limit(40, 0.2);
  const std::vector<Double2> smooth = smooth_line(wiggle, false, limit, 0.2);
  CHECK(smooth.size() > wiggle.size());
  CHECK(smooth.front() == wiggle.front());
  CHECK(smooth.back() == wiggle.back());
  CHECK(turning(smooth) < 0.25 * turning(wiggle));
  for (const Double2& p : smooth) CHECK(distance_to(p, wiggle, false) <= 0.2 * (1 + 1e-12));
  for (const Double2& p : wiggle) CHECK(distance_to(p, smooth, false) <= 0.2 * (1 + 1e-12));
  // Without room nothing moves.
  const std::vector<double> none(40, 0.0);
  for (const Double2& p : smooth_line(wiggle, false, none, 0.2)) CHECK(distance_to(p, wiggle, false) < 1e-12);
}

TEST_CASE("line smoothing: random loops, thin ones too, never cross themselves", "[property]") {
  test::Random random(11);
  for (int n = 0; n < 60; ++n) {
    std::vector<Double2> ring;
    const int corners = 6 + n;
    for (int k = 0; k < corners; ++k) {
      const SinCos a = sin_cos(2.0 * kPi * k / corners);
      const double r = random.in(1.0, n % 3 == 0 ? 1.1 : 6.0);
      ring.push_back({r * a.cos, r * a.sin * (n % 2 == 0 ? 1.0 : 0.01)});
    }
    const double tolerance = 0.05 * (1 + n % 7);
    const std::vector<double> limit(ring.size(), tolerance);
    const std::vector<Double2> smooth = smooth_line(ring, true, limit, tolerance);
    CAPTURE(n);
    CHECK(self_crossings(smooth, true).empty());
    double farthest = 0.0;
    for (const Double2& p : smooth) farthest = std::max(farthest, distance_to(p, ring, true));
    CHECK(farthest <= tolerance * (1 + 1e-12));
    if (n % 3 == 0 && n % 2 == 0) CHECK(smooth != ring);
  }
}

}  // namespace line_smoothing_test
