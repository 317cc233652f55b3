#include "kernels/mesh/mean_ratio.h"

#include <catch2/catch.hpp>

namespace tessera::mean_ratio_test {

TEST_CASE("mean ratio: 1 for the equilateral triangle of any size, 0 without area", "[unit]") {
  for (const double size : {1e-6, 1.0, 1e+6}) {
    const Double3 a{1, 2, 3}, b = a + Double3{size, 0, 0},
                              c = a + Double3{0.5 * size, 0, 0.75 * size / 0.8660254037844386};
    CHECK(mean_ratio(a, b, c) == Approx(1.0));
    CHECK(mean_ratio(a, b, a + Double3{3.0 * size, 0, 0}) == Approx(0.0).margin(1e-9));
  }
  CHECK(mean_ratio({}, {}, {}) == 0.0);
  CHECK(squared_mean_ratio({}, {}, {}) == 0.0);
}

TEST_CASE("mean ratio: of a right angle with equal legs it is sqrt(3) / 2, and the square is its square",
          "[unit]") {
  const Double3 a{0, 0, 0}, b{2, 0, 0}, c{0, 2, 0};
  CHECK(mean_ratio(a, b, c) == Approx(0.8660254037844386));
  CHECK(squared_mean_ratio(a, b, c) == Approx(0.75));
}

}  // namespace tessera::mean_ratio_test
