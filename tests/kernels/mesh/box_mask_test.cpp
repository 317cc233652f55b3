#include "kernels/mesh/box_mask.h"

#include <algorithm>
#include <array>
#include <catch2/catch.hpp>
#include <cstdint>
#include <random>
#include <vector>

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
  CHECK(mask.covers({2.1, 2.1, 2.1}, {3.9, 2.9, 2.9}));
  CHECK_FALSE(mask.covers({2.1, 2.1, 2.1}, {4.1, 2.9, 2.9}));
  CHECK_FALSE(mask.covers({2.1, 2.1, 2.1}, {3.9, 3.1, 2.9}));
  CHECK_FALSE(mask.covers({2.1, 2.1, 1.9}, {3.9, 2.9, 2.9}));
}

TEST_CASE("box mask: what lies outside counts with the nearest cell, a flat box with its one layer",
          "[unit]") {
  BoxMask mask({0, 0, 5}, {4, 4, 5}, 4);  // no extent along z
  mask.mark({-9, -9, 5}, {-8, -8, 5});
  CHECK(mask.meets({0.5, 0.5, 5}, {0.5, 0.5, 5}));
  CHECK(mask.meets({-100, -100, -100}, {-50, -50, 100}));
  CHECK_FALSE(mask.meets({1.5, 0.5, 5}, {100, 100, 5}));
}

TEST_CASE("box mask: faces asked for all at once are those asked for one by one", "[unit]") {
  std::mt19937 random(5);
  std::uniform_real_distribution<double> at(-0.3, 1.3), size(0.0, 0.1);
  std::vector<Double3> points;
  std::vector<std::array<std::uint32_t, 3>> faces;
  for (std::uint32_t f = 0; f < 2000; ++f) {
    const Double3 p = {at(random), at(random), at(random)};
    for (std::uint32_t k = 0; k < 3; ++k)
      points.push_back(p + Double3{size(random), size(random), size(random)});
    faces.push_back({3 * f, 3 * f + 1, 3 * f + 2});
  }
  BoxMask mask({0, 0, 0}, {1, 1, 1}, 64);
  for (int i = 0; i < 40; ++i) {
    const Double3 p = {at(random), at(random), at(random)};
    mask.mark(p, p + Double3{0.1, 0.2, 0.05});
  }
  const std::vector<std::uint8_t> sides = beyond_sides(points, {0, 0, 0}, {1, 1, 1});
  std::vector<std::uint32_t> expected;
  for (std::uint32_t f = 0; f < faces.size(); ++f) {
    Double3 low = points[faces[f][0]], high = low;
    for (const std::uint32_t v : faces[f]) {
      unsigned bits = 0;
      for (std::size_t k = 0; k < 3; ++k) {
        low[k] = std::min(low[k], points[v][k]), high[k] = std::max(high[k], points[v][k]);
        bits |= (points[v][k] < 0.0 ? 1u << k : 0u) | (points[v][k] > 1.0 ? 8u << k : 0u);
      }
      CHECK(sides[v] == bits);
    }
    if (mask.meets(low, high)) expected.push_back(f);
  }
  CHECK(expected.size() > 50);
  CHECK(expected.size() < 1900);
  CHECK(mask.faces_that_meet(points, faces) == expected);
}

}  // namespace tessera::box_mask_test
