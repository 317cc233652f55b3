#include "octree/box_levels.h"

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

}  // namespace tessera::box_levels_test
