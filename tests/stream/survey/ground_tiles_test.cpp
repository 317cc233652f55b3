// Ground found block by block is the ground of the whole raster.
#include <catch2/catch.hpp>

#include <cmath>
#include <vector>

#include "stream/survey/ground_tiles.h"
#include "tests/helpers/aerial_scene.h"
#include "tests/helpers/temp_folder.h"

namespace ground_tiles_test {

using namespace tessera;
using namespace tessera::test;

namespace {

/// A strip of 2300 x 30 cells, from below zero on, with boxes; every cell has one point.
std::vector<ScenePoint> strip() {
  std::vector<ScenePoint> points;
  for (int v = 0; v < 30; ++v)
    for (int u = 0; u < 2300; ++u) {
      const double x = u - 700 + 0.5, y = v - 10 + 0.5;
      const bool box = u % 60 < 8 && v > 8 && v < 20;
      points.push_back({x, y, scene_terrain(x, y) + (box ? 5.0 : 0.0), 2, 1});
    }
  return points;
}

}  // namespace

TEST_CASE("ground tiles: blocks with their halo give what the whole raster gives", "[unit]") {
  const TempFolder folder;
  SceneFile file;
  file.east = 100.0, file.north = -3000.0;
  const LasRecords scan(folder.write("strip.las", las_of(strip(), file)));
  const ScanCells cells{1.0};
  LowestHeights lowest(cells, folder / "lowest");
  lowest.hold(LowestHeights::kTileBytes * 2);
  std::vector<LowestHeights::Sample> samples;
  scan.read(
      1, [&](LasBatch& b) { lowest.place(scan, b, false, samples); },
      [&](LasBatch&) { lowest.add(samples); });
  lowest.finish();
  CHECK(lowest.points() == 2300u * 30u);
  const CellWindow& all = lowest.window();
  CHECK(all.u == -600);
  CHECK(all.v == -3010);
  CHECK(all.width == 2300);
  CHECK(all.height == 30);
  CHECK(lowest.density() > 0.5);

  const std::int32_t factor = GENERATE(1, 2);
  GroundRules rules;
  rules.max_window = 6;
  const RoofRules roofs = {2000.0, 150.0};
  GroundTiles ground(lowest, factor, rules, roofs, {}, folder / "ground");
  WorkerPool pool(2);
  MemoryBudget budget(std::uint64_t{1} << 30, 0);
  ground.find(lowest, pool, budget);
  ground.hold(GroundTiles::tile_bytes());
  const CellWindow& wide = ground.window();
  CHECK(wide.width == 2300 / factor);
  const std::vector<std::int32_t> heights = lowest.read(wide, factor);
  const GroundSurface want = find_ground(heights, wide.width, wide.height, ground.rules());
  const std::vector<std::uint8_t> want_roofs = find_roofs(heights, want, roofs);
  std::size_t differ = 0, objects = 0, under_roofs = 0;
  for (std::int32_t v = 0; v < wide.height; ++v)
    for (std::int32_t u = 0; u < wide.width; ++u) {
      const auto i = static_cast<std::size_t>(v * wide.width + u);
      const GroundTiles::Below below =
          ground.below(ground.place((wide.u + u + 0.5) * factor, (wide.v + v + 0.5) * factor));
      if (below.kind != want.kind[i] || below.ground.height != want.ground[i] ||
          below.roof != (want_roofs[i] != 0))
        ++differ;
      if (below.roof) ++under_roofs;
      if (below.kind == kGroundObject) ++objects;
    }
  CHECK(differ == 0);
  CHECK(objects > 400);
  if (factor == 1) CHECK(under_roofs > 400);
}

TEST_CASE("ground tiles: water is that of the whole raster, with points counted by cells", "[unit]") {
  const TempFolder folder;
  // Four points a cell; a canal with one in four cells, across the border of two blocks.
  std::vector<ScenePoint> points;
  for (int v = 0; v < 60; ++v)
    for (int u = 0; u < 1200; ++u) {
      const bool canal = u > 900 && u < 1150 && v > 20 && v < 40;
      const int shown = canal ? ((u * 7 + v * 3) % 4 == 0 ? 1 : 0) : 8;
      for (int k = 0; k < shown; ++k)
        points.push_back({u + 0.1 + 0.1 * k, v + 0.5, canal ? 5.0 : 5.5 + 0.001 * v, 2, 1});
    }
  const LasRecords scan(folder.write("canal.las", las_of(points, {})));
  const ScanCells cells{1.0};
  LowestHeights lowest(cells, folder / "lowest");
  lowest.hold(LowestHeights::kTileBytes * 2);
  std::vector<LowestHeights::Sample> samples;
  scan.read(
      1, [&](LasBatch& b) { lowest.place(scan, b, false, samples); },
      [&](LasBatch&) { lowest.add(samples); });
  lowest.finish();
  CHECK(lowest.median_count(1) == 8);
  CHECK(lowest.median_count(2) == 32);
  GroundRules rules;
  rules.max_window = 2;
  WaterRules water;
  water.max_count = 4, water.width = 6, water.relief = 300, water.reach = 24;
  GroundTiles ground(lowest, 1, rules, {}, water, folder / "ground");
  WorkerPool pool(2);
  MemoryBudget budget(std::uint64_t{1} << 30, 0);
  ground.find(lowest, pool, budget);
  ground.hold(GroundTiles::tile_bytes());
  const CellWindow& all = ground.window();
  const std::vector<std::uint32_t> counts = lowest.read_counts(all, 1);
  const std::vector<std::uint8_t> want =
      find_water(lowest.read(all, 1), counts, all.width, all.height, water);
  std::size_t differ = 0, wet = 0;
  for (std::int32_t v = 0; v < all.height; ++v)
    for (std::int32_t u = 0; u < all.width; ++u) {
      const auto i = static_cast<std::size_t>(v * all.width + u);
      const bool found = ground.below(ground.place(all.u + u + 0.5, all.v + v + 0.5)).water;
      differ += found == (want[i] != 0) ? 0 : 1;
      wet += found ? 1 : 0;
    }
  CHECK(differ == 0);
  CHECK(wet > 3500);  // of 4731
}

}  // namespace ground_tiles_test
