#include "kernels/decimate/auto_tolerance.h"

#include <catch2/catch.hpp>

namespace tessera::auto_tolerance_test {

TEST_CASE("auto tolerance: a fifth of the cell, never below the noise", "[unit]") {
  CHECK(auto_tolerance(1.0, 0.0) == Approx(0.2));
  CHECK(auto_tolerance(1.0, 0.19) == Approx(0.2));
  CHECK(auto_tolerance(1.0, 0.3) == Approx(0.3));
  CHECK(kAutoTolerance < 0.0);  // no tolerance that one could type
}

}  // namespace tessera::auto_tolerance_test
