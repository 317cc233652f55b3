// Points by cell: counts, extremes, the surface that is seen; no order matters.
#include <catch2/catch.hpp>

#include <algorithm>
#include <cmath>
#include <tuple>
#include <vector>

#include "kernels/survey/point_raster.h"
#include "tests/helpers/random.h"

namespace point_raster_test {

using namespace tessera;
using namespace tessera::test;

namespace {

struct Point {
  std::size_t cell = 0;
  double z = 0.0;
  bool ground = false;
  std::uint32_t rgba = 0;
  std::int32_t intensity = -1;
};

PointRaster raster_of(const std::vector<Point>& points, double depth) {
  PointRaster raster(4, depth);
  for (const Point& p : points) raster.add(p.cell, p.z, p.ground);
  for (const Point& p : points) raster.add_seen(p.cell, p.z, p.rgba, p.intensity);
  return raster;
}

constexpr std::uint32_t kOpaque = 0xffu << 24;

}  // namespace

TEST_CASE("point raster: a cell has its count, its highest point and its lowest one of the ground",
          "[unit]") {
  const auto cells = raster_of({{0, 3.0, false, 0, -1},
                                {0, -1.0, false, 0, -1},
                                {0, 0.5, true, 0, -1},
                                {0, 1.5, true, 0, -1},
                                {2, -0.0, false, 0, -1}},
                               1.0)
                         .cells();
  CHECK(cells[0].count == 4);
  CHECK(cells[0].top == 3.0);
  CHECK(cells[0].ground == 0.5);
  CHECK_FALSE(cells[1].covered());
  CHECK_FALSE(cells[2].has_ground());
  CHECK_FALSE(std::signbit(cells[2].top));
}

TEST_CASE("point raster: a wall below an edge gives no colour and no intensity to what is seen", "[unit]") {
  std::vector<Point> points;
  for (int k = 0; k < 100; ++k) points.push_back({1, 0.1 * k, false, kOpaque | 200u << 16, 9000});
  points.push_back({1, 10.0, false, kOpaque | 10u, 100});
  points.push_back({1, 10.1, false, kOpaque | 21u, 203});
  points.push_back({1, 10.05, false, 0, -1});  // neither
  const ScanCell cell = raster_of(points, 0.15).cells()[1];
  CHECK(cell.count == 103);
  CHECK(cell.coloured == 2);
  CHECK(cell.rgba() == (kOpaque | 16u));  // 15.5, rounded up
  CHECK(cell.intensity() == 151.5);
  CHECK(ScanCell{}.rgba() == 0);
}

TEST_CASE("point raster: the order of points changes nothing", "[property]") {
  Random random(3);
  std::vector<Point> points;
  for (int k = 0; k < 500; ++k)
    points.push_back(
        {random.below(4), std::floor(random.in(-4.0, 4.0)) * 0.25, random.below(3) == 0,
         static_cast<std::uint32_t>(random.below(1u << 24)) | (random.below(4) == 0 ? 0 : kOpaque),
         static_cast<std::int32_t>(random.below(65536))});
  const PointRaster want = raster_of(points, 0.5);
  for (int k = 0; k < 20; ++k) {
    for (std::size_t i = points.size(); i > 1; --i) std::swap(points[i - 1], points[random.below(i)]);
    const PointRaster got = raster_of(points, 0.5);
    for (std::size_t c = 0; c < 4; ++c) {
      const ScanCell &a = want.cells()[c], &b = got.cells()[c];
      CHECK(std::tie(a.top, a.ground, a.count, a.red, a.green, a.blue, a.coloured, a.intensity_sum,
                     a.measured) == std::tie(b.top, b.ground, b.count, b.red, b.green, b.blue, b.coloured,
                                             b.intensity_sum, b.measured));
    }
  }
}

TEST_CASE("point raster: a coordinate lies in the cell whose edges, as doubles, hold it", "[property]") {
  CHECK(cell_index(0.3, 0.1) == 2.0);  // 3 * 0.1 lies above 0.3
  CHECK(cell_index(-0.5, 0.5) == -1.0);
  CHECK(cell_index(-0.51, 0.5) == -2.0);
  Random random(5);
  for (int k = 0; k < 20000; ++k) {
    const double cell = random.in(1e-3, 3.0);
    double x = random.in(-1e6, 1e6);
    if (random.below(2) == 0) x = std::floor(x / cell) * cell;
    const double i = cell_index(x, cell);
    if (!(i * cell <= x && x < (i + 1.0) * cell)) FAIL(x << " in cells of " << cell);
  }
}

}  // namespace point_raster_test
