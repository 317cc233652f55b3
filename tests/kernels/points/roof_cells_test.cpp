// Roofs among what stands on the ground: planes are, crowns are not.
#include <catch2/catch.hpp>

#include <cstdlib>
#include <random>
#include <vector>

#include "kernels/points/roof_cells.h"

namespace roof_cells_test {

using namespace tessera;

namespace {

constexpr int kWidth = 60, kHeight = 50;

struct Scene {
  std::vector<std::int32_t> lowest = std::vector<std::int32_t>(kWidth * kHeight, 0);
  GroundSurface surface;
  Scene() {
    surface.width = kWidth, surface.height = kHeight;
    surface.ground.assign(lowest.size(), 0);
    surface.kind.assign(lowest.size(), kGroundMeasured);
  }
  void stand(int u, int v, std::int32_t height) {
    lowest[static_cast<std::size_t>(v * kWidth + u)] = height;
    surface.kind[static_cast<std::size_t>(v * kWidth + u)] = kGroundObject;
  }
};

std::size_t count(const std::vector<std::uint8_t>& roofs, int u0, int v0, int u1, int v1) {
  std::size_t sum = 0;
  for (int v = v0; v < v1; ++v)
    for (int u = u0; u < u1; ++u) sum += roofs[static_cast<std::size_t>(v * kWidth + u)];
  return sum;
}

}  // namespace

TEST_CASE("roof cells: a gable roof with its eaves, no crowns, no low walls, no lone flat tree", "[unit]") {
  Scene scene;
  std::mt19937 random(1);
  for (int v = 10; v < 24; ++v)
    for (int u = 5; u < 17; ++u) scene.stand(u, v, 6000 - 600 * std::abs(u - 11));
  for (int v = 10; v < 30; ++v)
    for (int u = 30; u < 50; ++u) scene.stand(u, v, 4000 + static_cast<std::int32_t>(random() % 6000));
  for (int v = 35; v < 45; ++v)
    for (int u = 5; u < 20; ++u) scene.stand(u, v, 1500);
  for (int v = 38; v < 41; ++v)
    for (int u = 40; u < 43; ++u) scene.stand(u, v, 9000);
  const std::vector<std::uint8_t> roofs = find_roofs(scene.lowest, scene.surface, {2000.0, 150.0});
  CHECK(count(roofs, 5, 10, 17, 24) == 12 * 14);
  CHECK(count(roofs, 3, 8, 19, 26) < 16 * 18);
  CHECK(count(roofs, 25, 0, 60, 33) == 0);
  CHECK(count(roofs, 0, 30, 60, 50) == 0);
}

TEST_CASE("roof cells: planar areas are told by how many cells hang together", "[unit]") {
  Scene scene;
  for (int v = 10; v < 14; ++v)
    for (int u = 5; u < 9; ++u) scene.stand(u, v, 5000 + 300 * u);
  for (int v = 10; v < 14; ++v)
    for (int u = 20; u < 23; ++u) scene.stand(u, v, 5000);
  for (int v = 30; v < 44; ++v)  // only corners touch
    for (int u = 30; u < 44; ++u)
      if ((u - 30) % 4 != 3 && (v - 30) % 4 != 3) scene.stand(u, v, 5000);
  const RoofRules rules = {2000.0, 50.0, 13};
  const std::vector<std::uint8_t> areas = find_planar_areas(scene.lowest, scene.surface, rules);
  CHECK(count(areas, 5, 10, 9, 14) == 16);
  CHECK(count(areas, 0, 0, 60, 50) == 8 * 8);  // two cells around, for eaves and walls
}

}  // namespace roof_cells_test
