// Slope and shading of planes that are known.
#include <catch2/catch.hpp>

#include <cmath>

#include "kernels/survey/relief.h"

namespace relief_test {

using namespace tessera;

TEST_CASE("relief: slopes in degrees", "[unit]") {
  CHECK(slope_degrees(0.0, 0.0) == 0.0);
  CHECK(slope_degrees(1.0, 0.0) == Approx(45.0));
  CHECK(slope_degrees(0.0, -1.0) == Approx(45.0));
  CHECK(slope_degrees(std::sqrt(3.0), 0.0) == Approx(60.0));
  CHECK(slope_degrees(1e6, 1e6) == Approx(90.0).margin(1e-3));
}

TEST_CASE("relief: light from the north west, on level ground, towards the sun and away from it", "[unit]") {
  const Double3 sun = sun_direction(315.0, 45.0);
  CHECK(sun[0] == Approx(-0.5));
  CHECK(sun[1] == Approx(0.5));
  CHECK(sun[2] == Approx(std::sqrt(0.5)));
  CHECK(hillshade(0.0, 0.0, sun) == 181);  // 1 + 254 * sin 45, rounded
  const double facing = std::sqrt(0.5);    // rises by 45 degrees towards the south east
  CHECK(hillshade(facing, -facing, sun) == 255);
  CHECK(hillshade(-2.0 * facing, 2.0 * facing, sun) == 1);
  CHECK(hillshade(0.0, 0.0, sun_direction(90.0, 90.0)) == 255);
}

}  // namespace relief_test
