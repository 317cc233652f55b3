// Cells hold every point once, in an order that the points alone decide.
#include <catch2/catch.hpp>

#include <algorithm>
#include <vector>

#include "kernels/change/point_cells.h"
#include "tests/helpers/random.h"

namespace point_cells_test {

using namespace tessera;
using namespace tessera::test;

TEST_CASE("point cells: every point stands in its cell, moments and balls are those of its points",
          "[property]") {
  Random random(1);
  std::vector<Double3> points;
  for (int i = 0; i < 5000; ++i)
    points.push_back({random.in(-3.0, 3.0), random.in(0.0, 2.0), random.in(-1.0, 9.0)});
  const PointCells cells(points, 0.37, true);
  REQUIRE(cells.count() == points.size());
  std::size_t wrong = 0, next = 0;
  for (std::size_t k = 0; k < cells.cells().size(); ++k) {
    const PointCell& c = cells.cells()[k];
    const CellMoments& m = cells.moments(k);
    wrong += c.begin == next && c.end > c.begin ? 0 : 1;
    double xz = 0.0;
    for (std::size_t i = c.begin; i < c.end; ++i) {
      const Double3 p = cells.position(i);
      wrong += p == points[cells.source(i)] ? 0 : 1;
      wrong += norm(p - c.middle) <= c.radius ? 0 : 1;
      for (std::size_t a = 0; a < 3; ++a) wrong += cells.cell_of(p[a]) == cells.cell_of(c.centre[a]) ? 0 : 1;
      xz += (p[0] - c.centre[0]) * (p[2] - c.centre[2]);
    }
    wrong += m.count == static_cast<double>(c.end - c.begin) && m.xz == Approx(xz).margin(1e-12) ? 0 : 1;
    next = c.end;
  }
  CHECK(wrong == 0);
  CHECK(next == points.size());
}

TEST_CASE("point cells: their order does not hang on that of the points", "[property]") {
  Random random(2);
  std::vector<Double3> points;
  for (int i = 0; i < 3000; ++i)
    points.push_back({random.in(0.0, 1.0), random.in(0.0, 1.0), random.in(0.0, 1.0)});
  points.push_back(points.front());
  const PointCells one(points, 0.2, false);
  std::reverse(points.begin(), points.end());
  const PointCells other(points, 0.2, false);
  CHECK(std::equal(one.x().begin(), one.x().end(), other.x().begin()));
  CHECK(std::equal(one.y().begin(), one.y().end(), other.y().begin()));
  CHECK(std::equal(one.z().begin(), one.z().end(), other.z().begin()));
}

TEST_CASE("point cells: none have no cells", "[unit]") {
  const PointCells none({}, 1.0, true);
  CHECK(none.empty());
  CHECK(none.cells().empty());
}

}  // namespace point_cells_test
