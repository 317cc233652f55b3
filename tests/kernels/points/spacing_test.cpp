// The lattice that follows from what was measured of a scan.
#include <algorithm>
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
