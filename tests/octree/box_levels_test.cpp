#include "octree/box_levels.h"

#include <algorithm>
#include <catch2/catch.hpp>

#include "octree/vector.h"

namespace tessera::box_levels_test {

TEST_CASE("box levels: every box lies in the one above it, the last in none", "[unit]") {
  struct Box {
    Double3 low, high;
  };
  for (const std::size_t count : {1u, 2u, 4u, 5u, 37u}) {
    std::vector<Box> boxes;
    for (std::size_t i = 0; i < count; ++i) {
      const auto at = static_cast<double>(i * i % 11);
      boxes.push_back({{at, -at, 1.0}, {at + 1.0, 2.0 - at, 1.0 + at}});
    }
    const auto levels = box_levels(boxes, 4);
    CHECK(levels.front().size() == count);
    CHECK(levels.back().size() == 1);
    for (std::size_t l = 1; l < levels.size(); ++l) {
      CHECK(levels[l].size() == (levels[l - 1].size() + 3) / 4);
      for (std::size_t b = 0; b < levels[l].size(); ++b) {
        Box tight = levels[l - 1][4 * b];
        for (std::size_t c = 4 * b; c < std::min(4 * b + 4, levels[l - 1].size()); ++c)
          for (std::size_t a = 0; a < 3; ++a) {
            tight.low[a] = std::min(tight.low[a], levels[l - 1][c].low[a]);
            tight.high[a] = std::max(tight.high[a], levels[l - 1][c].high[a]);
          }
        CHECK(tight.low == levels[l][b].low);
        CHECK(tight.high == levels[l][b].high);
      }
    }
  }
}

TEST_CASE("box levels: the ways down find what lies near, as looking at all does", "[unit]") {
  struct Box {
    Double3 low, high;
  };
  std::vector<Box> boxes;
  for (std::size_t i = 0; i < 300; ++i) {
    const Double3 at = {static_cast<double>(i / 10), static_cast<double>(i * 7 % 10),
                        static_cast<double>(i % 3)};
    boxes.push_back({at, at + Double3{0.5, 0.25, 0.75}});
  }
  const auto levels = box_levels(boxes, 4);
  for (const Double3& p : {Double3{3.2, 4, 1}, Double3{-5, 3, 2}, Double3{17.8, 9.9, 0.1}}) {
    double least = 1e300, best = 1e300;
    for (const Box& box : boxes) least = std::min(least, square_to_box(box, p));
    std::size_t asked = 0;
    visit_nearest_boxes(
        levels, 4, [&](const Box& box) { return square_to_box(box, p); },
        [&](double bound) { return bound < best; },
        [&](std::size_t i) { best = std::min(best, square_to_box(boxes[i], p)), ++asked; });
    CHECK(best == least);
    CHECK(asked < 50);
    std::vector<std::size_t> near, up, down;
    const auto enters = [&](const Box& box) { return square_to_box(box, p) <= 30.0; };
    for (std::size_t i = 0; i < boxes.size(); ++i)
      if (enters(boxes[i])) near.push_back(i);
    visit_boxes(levels, 4, BoxOrder::kAscending, enters,
                [&](std::size_t i) { return up.push_back(i), true; });
    CHECK(up == near);
    visit_boxes(levels, 4, BoxOrder::kDescending, enters,
                [&](std::size_t i) { return down.push_back(i), down.size() < 2; });
    REQUIRE(down.size() == 2);
    CHECK(down[0] == near.back());
    CHECK(down[1] == near[near.size() - 2]);
  }
}

}  // namespace tessera::box_levels_test
