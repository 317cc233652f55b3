// The lattice that follows from what was measured of a scan.
#include <algorithm>
#include <cmath>
#include <vector>

#include <catch2/catch.hpp>

#include "kernels/points/spacing.h"
#include "tests/helpers/random.h"

namespace spacing_test {

using namespace tessera;

namespace {

SpacingSummary even_scan(double noise) {
  SpacingSummary s;
  s.dense = s.middle = s.wide = s.spacing = 2.0;
  s.noise = noise;
  return s;
}

}  // namespace

TEST_CASE("spacing: a point off the plane of most around it is beside a surface", "[unit]") {
  test::Random random(11);
  for (const double height : {0.0, 0.3, 1.0, 2.0, 3.5}) {
    std::vector<Double3> points = {{8.0, 8.0, 8.0 + height}};
    for (int i = 0; i < 16; ++i)
      for (int j = 0; j < 16; ++j)
        points.push_back({i + random.unit(), j + random.unit(), 8.0 + 0.05 * random.gaussian()});
    std::vector<SpacingProbe> probes;
    measure_spacing({{0, 0, 0}, 16.0, points}, 1.0, 0.0, 2.0, probes);
    const auto beside =
        std::count_if(probes.begin(), probes.end(), [](const SpacingProbe& p) { return p.beside_surface; });
    CAPTURE(height);
    CHECK(beside == (height > 0.5 ? 1 : 0));
  }
}

TEST_CASE("spacing: the nearest of a probe are those that looking at all points finds, ascending or not",
          "[unit]") {
  constexpr double kSize = 16.0;
  const bool ascending = GENERATE(true, false);
  CAPTURE(ascending);
  test::Random random(5);
  std::vector<Double3> points;
  for (int i = 0; i < 200; ++i)  // on a grid, so that many are equally far
    points.push_back({std::floor(kSize * random.unit()), std::floor(kSize * random.unit()), 8.0});
  std::sort(points.begin(), points.end());
  points.erase(std::unique(points.begin(), points.end()), points.end());
  if (!ascending) std::reverse(points.begin(), points.end());

  std::vector<double> wanted;
  for (const Double3& p : points) {
    if (std::max(std::fabs(p[0] - 7.75), std::fabs(p[1] - 7.75)) > 3.75) continue;  // the middle half
    std::vector<double> squares;
    for (const Double3& q : points) squares.push_back(squared_distance(p, q));
    std::sort(squares.begin(), squares.end());  // the first is its own
    for (const std::size_t rank : {1u, 4u, 8u})
      wanted.push_back(std::min(std::sqrt(squares[rank]), kSize / 4) / (rank == 8 ? 2 : 1));
  }
  REQUIRE(wanted.size() > 90);  // of 30 probes
  REQUIRE(wanted.size() <= 3 * 48);

  std::vector<SpacingProbe> probes;
  measure_spacing({{0, 0, 0}, kSize, points}, 1.0, 0.0, 1e9, probes);
  std::vector<double> found;
  for (const SpacingProbe& p : probes) found.insert(found.end(), {p.nearest, p.gap, p.spacing});
  CHECK(found == wanted);
}

TEST_CASE("spacing: residuals are of the points within the radius, in whatever order they come", "[unit]") {
  test::Random random(6);
  std::vector<Double3> points;
  for (int i = 0; i < 300; ++i)
    points.push_back({16.0 * random.unit(), 16.0 * random.unit(), 8.0 + 0.3 * random.gaussian()});
  const auto residuals = [&] {
    ScaleHistogram out;
    measure_residuals({{0, 0, 0}, 16.0, points}, 3.0, out);
    return out;
  };
  std::sort(points.begin(), points.end());
  const ScaleHistogram sorted = residuals();
  REQUIRE(sorted.count() > 20);
  CHECK(sorted.quantile(0.5) == Approx(0.3).epsilon(0.3));
  ScaleHistogram twice = sorted;
  twice.add(sorted);
  CHECK(twice.count() == 2 * sorted.count());
  CHECK(twice.quantile(0.5) == sorted.quantile(0.5));
}

TEST_CASE("spacing: scans of few points get a finer lattice, down to a third", "[unit]") {
  CHECK(choose_spacing(even_scan(0.0)).h == 3.0);
  CHECK(choose_spacing(even_scan(0.0), 16384).h == 3.0);
  CHECK(choose_spacing(even_scan(0.0), 9216).h == Approx(0.75 * 3.0));
  CHECK(choose_spacing(even_scan(0.0), 4096).h == 1.5);
  CHECK(choose_spacing(even_scan(0.0), 3400).h == Approx(0.378 * 3.0).epsilon(0.001));
  CHECK(choose_spacing(even_scan(0.0), 10).h == Approx(0.35 * 3.0));
  CHECK_THAT(choose_spacing(even_scan(0.0), 3400).reason, Catch::Contains("3400 points"));
  CHECK_THAT(choose_spacing(even_scan(0.0), 20000).reason, Catch::StartsWith("1.5 times the spacing"));
}

TEST_CASE("spacing: a lattice still averages noise, and closes, however few points there are", "[unit]") {
  CHECK(choose_spacing(even_scan(1.5), 3400).h == Approx(2.25));
  CHECK_THAT(choose_spacing(even_scan(1.5), 3400).reason, Catch::Contains("noise"));
  SpacingSummary uneven = even_scan(0.0);
  uneven.dense = 1.0, uneven.wide = 6.0, uneven.spacing = 8.0;
  CHECK(choose_spacing(uneven).h == 3.0);
  CHECK(choose_spacing(uneven, 3400).h == 3.0);
}

}  // namespace spacing_test
