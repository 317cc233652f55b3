// The lattice that follows from what was measured of a scan.
#include <catch2/catch.hpp>

#include "kernels/points/spacing.h"

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

TEST_CASE("spacing: scans of few points get a finer lattice, down to half", "[unit]") {
  CHECK(choose_spacing(even_scan(0.0)).h == 3.0);
  CHECK(choose_spacing(even_scan(0.0), 16384).h == 3.0);
  CHECK(choose_spacing(even_scan(0.0), 9216).h == Approx(0.75 * 3.0));
  CHECK(choose_spacing(even_scan(0.0), 3400).h == 1.5);
  CHECK(choose_spacing(even_scan(0.0), 10).h == 1.5);
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
