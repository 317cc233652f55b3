// Cells of points with values: means, places, and that no order matters.
#include <catch2/catch.hpp>

#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

#include "stream/render/value_cells.h"
#include "tests/helpers/random.h"

namespace value_cells_test {

using namespace tessera;
using namespace tessera::test;

namespace {

constexpr double kNone = std::numeric_limits<double>::quiet_NaN();

struct Valued {
  Double3 p{};
  double value = 0.0;
};

ValueMap map_of(const std::vector<Valued>& points) {
  ValueCells cells({0, 0, 0}, {1024, 1024, 64}, 10.0);
  for (const Valued& v : points) cells.add(v.p, v.value);
  return cells.finish();
}

bool same(const ValueMap& a, const ValueMap& b) {
  const auto equal_cells = [](const ValueCell& x, const ValueCell& y) {
    return x.centre == y.centre && (x.mean == y.mean || (std::isnan(x.mean) && std::isnan(y.mean)));
  };
  const auto equal_places = [](const WorstPlace& x, const WorstPlace& y) {
    return x.at == y.at && x.value == y.value;
  };
  return a.cell == b.cell &&
         std::equal(a.cells.begin(), a.cells.end(), b.cells.begin(), b.cells.end(), equal_cells) &&
         std::equal(a.worst.begin(), a.worst.end(), b.worst.begin(), b.worst.end(), equal_places);
}

}  // namespace

TEST_CASE("value cells: a cell has the mean of its points, none where no point has a value", "[unit]") {
  const ValueMap map = map_of({{{10.25, 3.5, 1.5}, 1.0},
                               {{10.75, 3.5, 1.5}, 2.0},
                               {{10.5, 3.5, 1.5}, kNone},
                               {{100.5, 3.5, 1.5}, kNone},
                               {{2000, 0, 0}, 9.0}});
  CHECK(map.cell == 1.0);
  REQUIRE(map.cells.size() == 2);
  CHECK(map.cells[0].mean == Approx(1.5).margin(1e-6));
  CHECK(map.cells[0].centre[0] == Approx(10.5).margin(1e-4));
  CHECK(std::isnan(map.cells[1].mean));
  REQUIRE(map.worst.size() == 1);  // what lies outside has no part, and of one cell the worst
  CHECK(map.worst[0].value == 2.0);
  CHECK(map.worst[0].at == Double3{10.75, 3.5, 1.5});
}

TEST_CASE("value cells: more points than cells make larger cells, and no order of points makes a difference",
          "[property]") {
  Random random(5);
  std::vector<Valued> points;
  for (int i = 0; i < 400000; ++i)
    points.push_back({{random.in(0, 1024), random.in(0, 1024), random.in(0, 64)},
                      random.below(9) == 0 ? kNone : random.in(-10, 10)});
  const ValueMap map = map_of(points);
  CHECK(map.cells.size() <= ValueCells::kMaxCells);
  CHECK(map.cells.size() > ValueCells::kMaxCells / 16);
  CHECK(map.cell > 1.0);
  REQUIRE(map.worst.size() == ValueCells::kWorstPlaces);
  for (std::size_t i = 1; i < map.worst.size(); ++i)
    CHECK(std::abs(map.worst[i].value) <= std::abs(map.worst[i - 1].value));
  double largest = 0.0;
  for (const Valued& v : points)
    if (!std::isnan(v.value)) largest = std::max(largest, std::abs(v.value));
  CHECK(std::abs(map.worst[0].value) == largest);
  std::reverse(points.begin(), points.end());
  CHECK(same(map_of(points), map));
  std::sort(points.begin(), points.end(), [](const Valued& a, const Valued& b) { return a.p < b.p; });
  CHECK(same(map_of(points), map));
}

}  // namespace value_cells_test
