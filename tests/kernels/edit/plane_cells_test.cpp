// A scan in cells: means and normals where it is a plane, whatever the order of its points.
#include "kernels/edit/plane_cells.h"

#include <catch2/catch.hpp>
#include <cmath>
#include <limits>
#include <random>
#include <vector>

namespace plane_cells_test {

using namespace tessera;

namespace {

/// Two walls that meet at a right angle, with noise.
std::vector<Double3> walls(int count) {
  std::mt19937 random(5);
  std::uniform_real_distribution<double> at(0.0, 1.0), noise(-0.001, 0.001);
  std::vector<Double3> out;
  for (int i = 0; i < count; ++i) {
    out.push_back({at(random), at(random), noise(random)});
    out.push_back({noise(random), at(random), at(random)});
  }
  return out;
}

std::vector<PlaneCell> cells_of(const std::vector<Double3>& points, PlaneCellReport& report, bool normals) {
  PlaneCells cells({-0.1, -0.1, -0.1}, {1.1, 1.1, 1.1}, 1.0 / 512);
  for (const Double3& p : points)
    cells.add(p, normals ? (p[2] < p[0] ? Double3{0, 0, 1} : Double3{2, 0, 0}) : Double3{});
  return cells.finish(report);
}

}  // namespace

TEST_CASE("plane cells: means lie on the walls, their edge is left out", "[unit]") {
  const std::vector<Double3> points = walls(60000);
  PlaneCellReport report;
  const std::vector<PlaneCell> cells = cells_of(points, report, true);
  CHECK(report.points == points.size());
  CHECK(report.outside == 0);
  CHECK(cells.size() > 1000);
  CHECK(cells.size() < report.cells);
  for (const PlaneCell& c : cells) {
    const bool floor = c.at[2] < c.at[0];
    CHECK(std::fabs(floor ? c.at[2] : c.at[0]) < 0.001);
    CHECK((floor ? c.normal[2] : c.normal[0]) > 0.98);
    CHECK(c.oriented == 1);
    CHECK(std::max(c.at[0], c.at[2]) > 0.5 * report.edge);
  }
}

TEST_CASE("plane cells: the order of points makes no difference, strays and infinities are told", "[unit]") {
  std::vector<Double3> points = walls(20000);
  PlaneCellReport one, other;
  const std::vector<PlaneCell> forth = cells_of(points, one, false);
  std::reverse(points.begin(), points.end());
  points.push_back({5, 0, 0});
  points.push_back({std::numeric_limits<double>::quiet_NaN(), 0, 0});
  const std::vector<PlaneCell> back = cells_of(points, other, false);
  CHECK(other.outside == 2);
  REQUIRE(forth.size() == back.size());
  for (std::size_t i = 0; i < forth.size(); ++i) {
    CHECK(forth[i].at == back[i].at);
    CHECK(forth[i].normal == back[i].normal);
    CHECK(forth[i].oriented == 0);
  }
}

TEST_CASE("plane cells: more cells than fit become coarser, a cloud has no plane", "[unit]") {
  std::mt19937 random(6);
  std::uniform_real_distribution<double> at(0.0, 1.0);
  PlaneCells cells({0, 0, 0}, {1, 1, 1}, 1.0 / 1024);
  for (int i = 0; i < 400000; ++i) cells.add({at(random), at(random), at(random)}, {});
  PlaneCellReport report;
  const std::size_t planar = cells.finish(report).size();
  CHECK(report.edge > 1.0 / 512);
  CHECK(static_cast<double>(planar) < 0.1 * static_cast<double>(report.cells));
}

}  // namespace plane_cells_test
