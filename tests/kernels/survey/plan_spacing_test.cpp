// How far points lie apart when seen from above, on grids and samples whose spacing is known.
#include <catch2/catch.hpp>

#include <algorithm>
#include <vector>

#include "kernels/survey/plan_spacing.h"
#include "tests/helpers/random.h"

namespace plan_spacing_test {

using namespace tessera;
using namespace tessera::test;

namespace {

std::vector<Double2> grid(int columns, int rows, double spacing) {
  std::vector<Double2> points;
  for (int v = 0; v < rows; ++v)
    for (int u = 0; u < columns; ++u) points.push_back({500000.0 + u * spacing, 5e6 + v * spacing});
  return points;
}

}  // namespace

TEST_CASE(
    "plan spacing: of a grid that of the grid, whatever its outline, and of all points where some are "
    "sampled",
    "[unit]") {
  CHECK(plan_spacing(grid(200, 200, 0.5), 1.0) == Approx(0.5).epsilon(0.1));
  CHECK(plan_spacing(grid(2000, 20, 0.5), 1.0) == Approx(0.5).epsilon(0.1));
  CHECK(plan_spacing(grid(200, 200, 0.5), 0.25) == Approx(0.25).epsilon(0.1));
  // An L: an eighth of its box has points.
  std::vector<Double2> bent = grid(400, 25, 2.0);
  for (const Double2& p : grid(25, 375, 2.0)) bent.push_back({p[0], p[1] + 50.0});
  CHECK(plan_spacing(bent, 1.0) == Approx(2.0).epsilon(0.1));
}

TEST_CASE("plan spacing: half of the area decides, and no order does", "[property]") {
  // A quarter of the area sixteen times as dense.
  std::vector<Double2> points = grid(200, 200, 1.0);
  for (const Double2& p : grid(400, 400, 0.25)) points.push_back({p[0] + 1000.0, p[1]});
  const double want = plan_spacing(points, 1.0);
  CHECK(want == Approx(1.0).epsilon(0.15));
  Random random(2);
  for (std::size_t i = points.size(); i > 1; --i) std::swap(points[i - 1], points[random.below(i)]);
  CHECK(plan_spacing(points, 1.0) == want);
}

TEST_CASE("plan spacing: too few points, or all at one place, have none", "[unit]") {
  CHECK(plan_spacing(grid(7, 1, 1.0), 1.0) == 0.0);
  CHECK(plan_spacing(std::vector<Double2>(100, Double2{1.0, 2.0}), 1.0) == 0.0);
  CHECK(plan_spacing(grid(1000, 1, 1.0), 1.0) > 0.0);
}

TEST_CASE("plan spacing: rounded up to 1, 2 or 5 times a power of ten, as it is written", "[unit]") {
  CHECK(round_up_1_2_5(1.0) == 1.0);
  CHECK(round_up_1_2_5(1.01) == 2.0);
  CHECK(round_up_1_2_5(5.5) == 10.0);
  CHECK(round_up_1_2_5(0.031) == 0.05);
  CHECK(round_up_1_2_5(0.00051) == 0.001);
  CHECK(round_up_1_2_5(0.05) == 0.05);
  CHECK(round_up_1_2_5(3e7) == 5e7);
}

}  // namespace plan_spacing_test
