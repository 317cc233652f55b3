#include "kernels/mesh/box_mask.h"

#include <catch2/catch.hpp>

namespace tessera::box_mask_test {

TEST_CASE("box mask: a box is met where it shares a cell with a marked one, and only there", "[unit]") {
  BoxMask mask({0, 0, 0}, {8, 8, 8}, 8);  // cells of edge 1
  CHECK_FALSE(mask.meets({0, 0, 0}, {8, 8, 8}));
  mask.mark({2.25, 2.25, 2.25}, {3.75, 2.75, 2.75});  // cells (2,2,2) and (3,2,2)
  CHECK(mask.meets({0, 0, 0}, {8, 8, 8}));
  CHECK(mask.meets({3.1, 2.1, 2.1}, {3.2, 2.2, 2.2}));
  CHECK(mask.meets({2.9, 2.9, 2.9}, {2.95, 2.95, 2.95}));
  CHECK_FALSE(mask.meets({4.1, 2.1, 2.1}, {7.9, 2.9, 2.9}));
  CHECK_FALSE(mask.meets({2.1, 3.1, 2.1}, {3.9, 7.9, 7.9}));
  CHECK_FALSE(mask.meets({0.0, 0.0, 0.0}, {1.9, 7.9, 7.9}));
}

TEST_CASE("box mask: what lies outside counts with the nearest cell, a flat box with its one layer",
          "[unit]") {
  BoxMask mask({0, 0, 5}, {4, 4, 5}, 4);  // no extent along z
  mask.mark({-9, -9, 5}, {-8, -8, 5});
  CHECK(mask.meets({0.5, 0.5, 5}, {0.5, 0.5, 5}));
  CHECK(mask.meets({-100, -100, -100}, {-50, -50, 100}));
  CHECK_FALSE(mask.meets({1.5, 0.5, 5}, {100, 100, 5}));
}

}  // namespace tessera::box_mask_test
