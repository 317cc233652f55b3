#include "kernels/points/point_clumps.h"

#include <cmath>
#include <cstdint>
#include <set>
#include <tuple>
#include <vector>

#include <catch2/catch.hpp>

#include "octree/vector.h"
#include "tests/helpers/random.h"

namespace tessera::point_clumps_test {
namespace {

/// Occupied cells of the edges e, 2 e, ... up to 2^12 e.
std::vector<double> ladder(const std::vector<Double3>& points, double edge) {
  std::vector<double> occupied;
  for (int level = 0; level <= 12; ++level) {
    std::set<std::tuple<double, double, double>> cells;
    const double size = std::ldexp(edge, level);
    for (const Double3& p : points)
      cells.insert({std::floor(p[0] / size), std::floor(p[1] / size), std::floor(p[2] / size)});
    occupied.push_back(static_cast<double>(cells.size()));
  }
  return occupied;
}

/// A sphere of radius 1.6, sampled 50 mm apart, `copies` times with noise between them.
std::vector<Double3> sphere(int copies, double between) {
  test::Random random(5);
  std::vector<Double3> points;
  constexpr int kPoints = 12500;
  for (int i = 0; i < kPoints; ++i) {
    const double z = 1.0 - 2.0 * (i + 0.5) / kPoints, angle = 2.399963229728653 * i,
                 r = std::sqrt(1.0 - z * z);
    for (int k = 0; k < copies; ++k)
      points.push_back({1.6 * r * std::cos(angle) + between * random.gaussian(),
                        1.6 * r * std::sin(angle) + between * random.gaussian(),
                        1.6 * z + between * random.gaussian()});
  }
  return points;
}

TEST_CASE("point clumps: copies of a scan are told with the spacing of the scan itself", "[unit]") {
  for (const double between : {3e-5, 3e-4, 1e-3}) {
    CAPTURE(between);
    const auto points = sphere(10, between);
    const PointClumps c = find_clumps(ladder(points, 3.0 * between), 3.0 * between, 125000.0, 4.0);
    CHECK(c.spacing == Approx(0.05).epsilon(0.3));
    CHECK(c.points == Approx(10.0).epsilon(0.3));
  }
}

TEST_CASE("point clumps: a surface, a line of points and strewn points are none", "[unit]") {
  test::Random random(9);
  const auto points = sphere(1, 0.0);
  CHECK(find_clumps(ladder(points, 0.15), 0.15, 12500.0, 9.0).spacing == 0.0);
  CHECK(find_clumps(ladder(sphere(10, 0.03), 0.05), 0.05, 125000.0, 9.0).spacing == 0.0);
  CHECK(find_clumps(ladder(points, 0.001), 0.001, 12500.0, 1.0).spacing == 0.0);  // far apart, each alone
  std::vector<Double3> lines;
  for (int i = 0; i < 200; ++i)
    for (int j = 0; j < 2000; ++j) lines.push_back({j * 0.001, i * 0.05, 0.0});
  CHECK(find_clumps(ladder(lines, 0.004), 0.004, 400000.0, 4.0).spacing == 0.0);
  CHECK(find_clumps({}, 1.0, 5.0, 9.0).spacing == 0.0);
}

}  // namespace
}  // namespace tessera::point_clumps_test
