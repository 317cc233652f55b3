// Short waves go, long ones and borders stay.
#include "kernels/edit/fair_positions.h"

#include <catch2/catch.hpp>
#include <cmath>
#include <limits>

#include "octree/portable_math.h"
#include "tests/helpers/irregular_mesh.h"

namespace fair_positions_test {

using namespace tessera;

TEST_CASE("fair positions: waves as long as told go, those twenty times as long and the border stay",
          "[unit]") {
  test::IrregularMesh mesh = test::irregular_mesh({.side = 120, .grading = 0.0, .height = 0.0});
  double low = std::numeric_limits<double>::infinity(), high = -low;
  for (const Double3& p : mesh.positions) low = std::min(low, p[0]), high = std::max(high, p[0]);
  const double size = high - low, length = size / 24.0;
  const auto wave = [&](const Double3& p, double waves) {
    return 0.001 * size * sin_cos(2.0 * kPi * waves * (p[0] - low) / size).sin;
  };
  for (const double waves : {1.2, 24.0}) {
    for (Double3& p : mesh.positions) p[2] = wave(p, waves);
    const TriangleSpan surface{mesh.positions, mesh.faces};
    const std::vector<Double3> fair = fair_positions(surface, laplacian(surface), length, nullptr);
    REQUIRE(fair.size() == mesh.positions.size());
    double left = 0.0, was = 0.0;
    for (std::size_t v = 0; v < fair.size(); ++v) {
      const Double3& p = mesh.positions[v];
      const double side = std::min(std::min(p[0] - low, high - p[0]), std::min(p[1] - low, high - p[1]));
      if (side < 1e-9 * size) CHECK(fair[v] == p);
      if (side < 0.2 * size) continue;
      left = std::max(left, std::fabs(waves < 2.0 ? fair[v][2] - p[2] : fair[v][2]));
      was = std::max(was, std::fabs(p[2]));
    }
    CHECK(was > 0.0009 * size);
    CHECK(left < 0.03 * was);
  }
}

}  // namespace fair_positions_test
