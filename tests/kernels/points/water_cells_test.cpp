// Water: ponds with hardly any returns are found, and nothing that only looks a little like one.
#include <catch2/catch.hpp>

#include <algorithm>
#include <cmath>
#include <functional>
#include <vector>

#include "kernels/points/ground_filter.h"
#include "kernels/points/water_cells.h"
#include "tests/helpers/random.h"

namespace water_cells_test {

using namespace tessera;
using namespace tessera::test;

namespace {

constexpr std::uint32_t kTypical = 40;

/// Cells of a metre, heights in millimetres.
struct Scene {
  int width = 90, height = 80;
  std::vector<std::int32_t> lowest;
  std::vector<std::uint32_t> counts;
  Random random{7};

  Scene() {
    for (int v = 0; v < height; ++v)
      for (int u = 0; u < width; ++u) {
        lowest.push_back(2000 + 20 * u + noise(30));
        counts.push_back(kTypical - 10 + static_cast<std::uint32_t>(random.below(20)));
      }
  }
  std::int32_t noise(int range) {
    return static_cast<std::int32_t>(random.below(static_cast<std::uint64_t>(range))) - range / 2;
  }
  std::size_t at(int u, int v) const { return static_cast<std::size_t>(v * width + u); }
  void fill(int u0, int v0, int u1, int v1, const std::function<void(std::size_t)>& cell) {
    for (int v = v0; v < v1; ++v)
      for (int u = u0; u < u1; ++u) cell(at(u, v));
  }
  void empty(std::size_t i) { lowest[i] = kNoGround, counts[i] = 0; }
  /// One cell of three shows something, at this height.
  void sparse(std::size_t i, std::int32_t level, int range = 100) {
    if (random.below(3) > 0) return empty(i);
    lowest[i] = level + noise(range), counts[i] = 1 + static_cast<std::uint32_t>(random.below(3));
  }
  std::vector<std::uint8_t> water(int reach = 128) const {
    WaterRules rules;
    rules.max_count = 0.5 * kTypical, rules.width = 10, rules.relief = 300, rules.reach = reach;
    return find_water(lowest, counts, width, height, rules);
  }
  std::ptrdiff_t wet(int reach = 128) const {
    const auto all = water(reach);
    return std::count(all.begin(), all.end(), 1);
  }
};

}  // namespace

TEST_CASE("water cells: a pond is found up to its rim, and no cell of the land", "[unit]") {
  Scene scene;
  scene.fill(30, 30, 55, 50, [&](std::size_t i) { scene.sparse(i, 1900); });
  const std::vector<std::uint8_t> water = scene.water();
  std::size_t inside = 0, outside = 0;
  for (int v = 0; v < scene.height; ++v)
    for (int u = 0; u < scene.width; ++u) {
      const bool pond = u >= 30 && u < 55 && v >= 30 && v < 50;
      (pond ? inside : outside) += water[scene.at(u, v)];
    }
  CHECK(inside > 480);  // of 500
  CHECK(outside == 0);
}

TEST_CASE("water cells: flat land, roads, voids, steep and raised places are none", "[unit]") {
  Scene scene;
  CHECK(scene.wet() == 0);
  SECTION("a car park at full density") {
    scene.fill(30, 30, 60, 60, [&](std::size_t i) { scene.lowest[i] = 1900 + scene.noise(20); });
  }
  SECTION("a road with half of the points") {
    scene.fill(0, 30, 90, 45, [&](std::size_t i) { scene.lowest[i] = 1900, scene.counts[i] = 18; });
  }
  SECTION("a void behind a building, whose rim cells are cut") {
    scene.fill(30, 30, 55, 50, [&](std::size_t i) { scene.counts[i] = 2; });
    scene.fill(31, 31, 54, 49, [&](std::size_t i) { scene.empty(i); });
  }
  SECTION("what comes back from within a wood, at all heights") {
    scene.fill(30, 30, 55, 50, [&](std::size_t i) { scene.sparse(i, 2600, 3000); });
  }
  SECTION("a flat roof that hardly reflects") {
    scene.fill(30, 30, 55, 50, [&](std::size_t i) { scene.sparse(i, 9000); });
  }
  SECTION("the thin end of a scan, level") {
    scene.fill(60, 0, 90, 80, [&](std::size_t i) { scene.sparse(i, 2500); });
  }
  SECTION("something narrower than the square") {
    scene.fill(30, 30, 39, 60, [&](std::size_t i) { scene.sparse(i, 1900); });
  }
  CHECK(scene.wet() == 0);
}

TEST_CASE("water cells: a river runs off the scan on two sides", "[unit]") {
  Scene scene;
  scene.fill(0, 30, 90, 50, [&](std::size_t i) { scene.sparse(i, 1500); });
  CHECK(scene.wet() > 1000);  // of 1800: near the ends more than two directions leave the scan
}

TEST_CASE("water cells: a cell depends on nothing beyond the halo", "[property]") {
  Scene scene;
  scene.fill(30, 30, 55, 50, [&](std::size_t i) { scene.sparse(i, 1900); });
  constexpr int kReach = 16;
  WaterRules rules;
  rules.max_count = 0.5 * kTypical, rules.width = 6, rules.relief = 300, rules.reach = kReach;
  const auto whole = find_water(scene.lowest, scene.counts, scene.width, scene.height, rules);
  CHECK(std::count(whole.begin(), whole.end(), 1) > 200);
  // The right part, from column 40 on, with its halo.
  const int begin = 75 - rules.halo(), wide = scene.width - begin;
  REQUIRE(begin > 30);
  std::vector<std::int32_t> lowest;
  std::vector<std::uint32_t> counts;
  for (int v = 0; v < scene.height; ++v)
    for (int u = begin; u < scene.width; ++u)
      lowest.push_back(scene.lowest[scene.at(u, v)]), counts.push_back(scene.counts[scene.at(u, v)]);
  const auto part = find_water(lowest, counts, wide, scene.height, rules);
  std::size_t differ = 0;
  for (int v = 0; v < scene.height; ++v)
    for (int u = 75; u < scene.width; ++u)
      differ += part[static_cast<std::size_t>(v * wide + u - begin)] != whole[scene.at(u, v)];
  CHECK(differ == 0);
}

}  // namespace water_cells_test
