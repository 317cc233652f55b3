// One core point in a cell, whatever the order and whatever else lies around.
#include <catch2/catch.hpp>

#include <algorithm>
#include <vector>

#include "kernels/change/core_points.h"
#include "tests/helpers/random.h"

namespace core_points_test {

using namespace tessera;
using namespace tessera::test;

TEST_CASE("core points: the point nearest to the centre of its cell, of several the first by position",
          "[unit]") {
  const std::vector<Double3> points = {{0.1, 0.1, 0.1},  {0.6, 0.5, 0.5}, {0.4, 0.5, 0.5},
                                       {-0.5, 0.5, 0.5}, {0.4, 0.5, 0.5}, {1.0, 0.0, 0.0}};
  CHECK(core_points(points, 1.0) == std::vector<std::size_t>{2, 3, 5});
  CHECK(core_points(points, 10.0) == std::vector<std::size_t>{1, 3});
  CHECK(core_points({}, 1.0).empty());
}

TEST_CASE("core points: the order of the points makes no difference", "[property]") {
  Random random(3);
  std::vector<Double3> points;
  for (int i = 0; i < 4000; ++i)
    points.push_back({random.in(-9.0, 9.0), random.in(-9.0, 9.0), random.in(-1.0, 1.0)});
  const auto chosen = [&] {
    std::vector<Double3> out;
    for (const std::size_t i : core_points(points, 0.7)) out.push_back(points[i]);
    std::sort(out.begin(), out.end());
    return out;
  };
  const std::vector<Double3> one = chosen();
  std::reverse(points.begin(), points.end());
  CHECK(chosen() == one);
  CHECK(one.size() < points.size() / 2);
}

}  // namespace core_points_test
