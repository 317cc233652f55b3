// Points on the surface of a cylinder belong to it; mean, spread, median and quartiles of few points.
#include <catch2/catch.hpp>

#include <cmath>
#include <vector>

#include "kernels/change/cylinder_positions.h"

namespace cylinder_positions_test {

using namespace tessera;

namespace {

AxialPositions positions(const std::vector<Double3>& points, const Cylinder& c, bool median, double size) {
  const PointCells cells(points, size, false);
  NearCells near;
  near.collect(cells, {c.middle, c.axis, c.radius, c.depth});
  std::vector<double> work;
  return axial_positions(cells, near, c, median, work);
}

}  // namespace

TEST_CASE("cylinder positions: the surface belongs to the cylinder, what lies beyond does not", "[unit]") {
  const Cylinder c = {{1.0, 1.0, 1.0}, {0.0, 0.0, 1.0}, 0.5, 2.0};
  const std::vector<Double3> points = {{1.5, 1.0, 1.0},    {1.0, 0.5, 3.0},   {1.0, 1.0, -1.0},
                                       {1.5001, 1.0, 1.0}, {1.0, 1.0, 3.001}, {1.0, 1.0, -1.001}};
  for (const double size : {0.1, 0.4, 7.0}) {
    const AxialPositions at = positions(points, c, false, size);
    CHECK(at.count == 3);
    CHECK(at.mean == Approx(0.0).margin(1e-12));
    CHECK(at.spread == Approx(2.0));
  }
}

TEST_CASE("cylinder positions: medians and interquartile ranges lie between points", "[unit]") {
  std::vector<Double3> points;
  for (const double z : {0.1, 0.2, 0.4, 0.8, 5.0, 0.3}) points.push_back({0.01 * z, 0.0, z});
  const Cylinder c = {{0, 0, 0}, {0, 0, 1}, 1.0, 10.0};
  const AxialPositions median = positions(points, c, true, 0.5);
  CHECK(median.count == 6);
  CHECK(median.mean == Approx(0.35));
  CHECK(median.spread == Approx(0.7 - 0.225));
  const AxialPositions mean = positions(points, c, false, 0.5);
  CHECK(mean.mean == Approx(6.8 / 6.0));
}

TEST_CASE("cylinder positions: none and one", "[unit]") {
  const Cylinder c = {{0, 0, 0}, unit(Double3{1, 1, 1}), 1.0, 2.0};
  for (const bool median : {false, true}) {
    CHECK(positions({}, c, median, 1.0).count == 0);
    const AxialPositions one = positions({{0.5, 0.5, 0.5}}, c, median, 1.0);
    CHECK(one.count == 1);
    CHECK(one.mean == Approx(0.5 * std::sqrt(3.0)));
    CHECK(one.spread == 0.0);
  }
}

}  // namespace cylinder_positions_test
