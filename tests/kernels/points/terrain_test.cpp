// Bare terrain: lowest heights of cells, membranes below what stands, layers of ground of a brick column.
#include <algorithm>
#include <catch2/catch.hpp>
#include <cmath>
#include <cstdlib>
#include <vector>

#include "kernels/points/terrain.h"
#include "tests/helpers/random.h"

namespace terrain_test {

using namespace tessera;
using test::Random;

namespace {

constexpr std::int32_t kColumn = kQuantaPerCell;
constexpr int kCellColumns = 4;
constexpr int kWidth = 100, kHeight = 80;

std::size_t at(int u, int v) {
  return static_cast<std::size_t>(v * kWidth + u);
}

/// Quanta; u, v in cells.
double slope(double u, double v) {
  return kCellColumns * kColumn * (0.1 * u - 0.05 * v) + 2.0 * kColumn * std::sin(0.1 * u);
}

GroundRules rules() {
  GroundRules r;
  r.cell = kCellColumns * kColumn;
  r.max_window = 12;
  return r;
}

std::vector<TerrainCell> cells_of_slope() {
  std::vector<TerrainCell> cells;
  for (int v = 0; v < kHeight; ++v)
    for (int u = 0; u < kWidth; ++u) {
      const auto h = static_cast<std::int32_t>(slope(u + 0.5, v + 0.5));
      cells.push_back({h - kColumn / 4, h, 0xff000000u | static_cast<std::uint32_t>(u)});
    }
  return cells;
}

template <class Change>
void change_square(std::vector<TerrainCell>& cells, int u0, int u1, int v0, int v1, const Change& change) {
  for (int v = v0; v < v1; ++v)
    for (int u = u0; u < u1; ++u) change(cells[at(u, v)]);
}

ColumnPoint point(int u, int v, double height, std::uint32_t rgba = 0) {
  ColumnPoint p;
  p.column = static_cast<std::uint16_t>(v * kBrickCells + u);
  p.height = static_cast<std::int32_t>(std::lround(height * kColumn));
  p.rgba = rgba;
  return p;
}

/// A level terrain of this height, quanta, below a brick column.
std::vector<TerrainNode> level_nodes(std::int32_t height, std::uint32_t flags) {
  const int edge = BrickTerrain::edge(rules());
  return std::vector<TerrainNode>(static_cast<std::size_t>(edge * edge), {height, 0xff112233u, flags});
}

}  // namespace

TEST_CASE("terrain cells: the lowest point, and the median of those close above it", "[unit]") {
  std::vector<ColumnPoint> points;
  for (int i = 0; i < 9; ++i) points.push_back(point(5, 9, 2.0 + 0.1 * i, 0xff000000u | 60u));
  for (int i = 0; i < 30; ++i) points.push_back(point(6, 10, 9.0 + 0.1 * i, 0xff000000u | 200u));  // a crown
  points.push_back(point(8, 9, 5.0));  // of the next cell
  std::reverse(points.begin(), points.end());
  constexpr std::size_t kEdge = kBrickCells / kCellColumns;
  std::vector<TerrainCell> cells(kEdge * kEdge);
  find_terrain_cells(points, kCellColumns, 2 * kColumn, cells);
  const TerrainCell& low = cells[2 * kEdge + 1];
  CHECK(low.lowest == 2 * kColumn);
  CHECK(std::abs(low.level - 2.4 * kColumn) <= 1);
  CHECK((low.rgba & 0xffu) == 60);
  CHECK(cells[2 * kEdge + 2].lowest == 5 * kColumn);
  CHECK(cells[2 * kEdge + 2].level == 5 * kColumn);
  CHECK(std::count_if(cells.begin(), cells.end(),
                      [](const TerrainCell& c) { return c.lowest != kNoGround; }) == 2);
}

TEST_CASE("terrain: below a building and in a hole a membrane goes on, coloured, without a step", "[unit]") {
  std::vector<TerrainCell> cells = cells_of_slope();
  change_square(cells, 30, 45, 30, 50, [](TerrainCell& c) {
    c = {c.lowest + 40 * kColumn, c.level + 40 * kColumn, 0xffffffffu};
  });
  change_square(cells, 60, 70, 20, 30, [](TerrainCell& c) { c = {}; });
  const std::vector<TerrainNode> nodes = fit_terrain(cells, kWidth, kHeight, rules());
  for (int v = 20; v < 60; ++v)
    for (int u = 20; u < 80; ++u) {
      const TerrainNode& n = nodes[at(u, v)];
      const bool building = u >= 30 && u < 45 && v >= 30 && v < 50,
                 hole = u >= 60 && u < 70 && v >= 20 && v < 30;
      REQUIRE(std::fabs(n.level - slope(u + 0.5, v + 0.5)) < (building || hole ? 2.0 * kColumn : 1.0));
      REQUIRE((n.flags & kTerrainInside) != 0);
      REQUIRE(((n.flags & kTerrainSeen) != 0) == !(building || hole));
      REQUIRE(((n.flags & kTerrainStands) != 0) == building);
      REQUIRE(std::abs(static_cast<int>(n.rgba & 0xff) - u) < 6);
    }
}

TEST_CASE("terrain: a hut has a roof, at the rim of the scan too, a flat crown of a few cells has none",
          "[unit]") {
  std::vector<TerrainCell> cells = cells_of_slope();
  const auto raise = [](TerrainCell& c) { c.lowest += 40 * kColumn, c.level += 40 * kColumn; };
  change_square(cells, 30, 34, 30, 33, raise);
  change_square(cells, 50, 53, 30, 33, raise);
  change_square(cells, 60, 62, 30, 39, raise);
  change_square(cells, 70, 74, 0, 4, raise);
  const RoofRules roofs = {10.0 * kColumn, 0.5 * kColumn, 12};
  const std::vector<TerrainNode> nodes = fit_terrain(cells, kWidth, kHeight, rules(), roofs);
  const auto roof = [&](int u, int v) { return (nodes[at(u, v)].flags & kTerrainRoof) != 0; };
  CHECK(roof(30, 30));
  CHECK(roof(33, 32));
  CHECK(roof(72, 1));
  CHECK_FALSE(roof(40, 31));
  CHECK_FALSE(roof(51, 31));  // nine cells
  CHECK_FALSE(roof(61, 35));  // long, but nowhere three wide
  const std::vector<TerrainNode> without = fit_terrain(cells, kWidth, kHeight, rules());
  CHECK((without[at(31, 31)].flags & kTerrainRoof) == 0);
}

TEST_CASE("terrain: crowns that the rim of the scan cuts do not stay on it", "[unit]") {
  std::vector<TerrainCell> cells = cells_of_slope();
  change_square(cells, 0, kWidth, 0, 10, [](TerrainCell& c) { c = {}; });
  for (int u = 5; u < kWidth - 5; u += 7)
    change_square(cells, u, u + 3, 10, 13,
                  [](TerrainCell& c) { c.lowest += 30 * kColumn, c.level += 30 * kColumn; });
  const std::vector<TerrainNode> nodes = fit_terrain(cells, kWidth, kHeight, rules());
  for (int u = 5; u < kWidth - 5; u += 7)
    for (int v = 10; v < 13; ++v) {
      CHECK((nodes[at(u + 1, v)].flags & kTerrainStands) != 0);
      CHECK(std::fabs(nodes[at(u + 1, v)].level - slope(u + 1.5, v + 0.5)) < 3.0 * kColumn);
    }
}

TEST_CASE("terrain: the outline and holes wider than the window are not inside", "[unit]") {
  std::vector<TerrainCell> cells = cells_of_slope();
  change_square(cells, 0, kWidth, 0, 20, [](TerrainCell& c) { c = {}; });
  change_square(cells, 40, 70, 35, 65, [](TerrainCell& c) { c = {}; });
  const std::vector<TerrainNode> nodes = fit_terrain(cells, kWidth, kHeight, rules());
  CHECK((nodes[at(55, 50)].flags & kTerrainInside) == 0);
  CHECK((nodes[at(50, 5)].flags & kTerrainInside) == 0);
  CHECK((nodes[at(50, 20)].flags & kTerrainInside) == 0);
  CHECK((nodes[at(50, 21)].flags & kTerrainInside) != 0);
  CHECK((nodes[at(20, 50)].flags & kTerrainInside) != 0);
}

TEST_CASE("terrain: beyond the halo nothing changes it, where it was measured around", "[unit]") {
  GroundRules small = rules();
  small.max_window = 4;
  const int halo = terrain_halo(small);
  std::vector<TerrainCell> cells = cells_of_slope();
  change_square(cells, 48, 54, 38, 43, [](TerrainCell& c) { c.lowest += 30 * kColumn; });
  const std::vector<TerrainNode> before = fit_terrain(cells, kWidth, kHeight, small);
  Random random(3);
  for (int v = 0; v < kHeight; ++v)
    for (int u = 0; u < kWidth; ++u)
      if (std::max(std::abs(u - 50), std::abs(v - 40)) > halo + 8)
        cells[at(u, v)].lowest = cells[at(u, v)].level =
            static_cast<std::int32_t>(random.in(0.0, 9.0 * kColumn));
  const std::vector<TerrainNode> after = fit_terrain(cells, kWidth, kHeight, small);
  for (int v = 36; v < 45; ++v)
    for (int u = 46; u < 56; ++u) {
      CHECK(after[at(u, v)].level == before[at(u, v)].level);
      CHECK(after[at(u, v)].flags == before[at(u, v)].flags);
    }
}

TEST_CASE("terrain: a brick column is as high as the slope below it", "[unit]") {
  const int edge = BrickTerrain::edge(rules());
  REQUIRE(edge == kBrickCells / kCellColumns + 2);
  std::vector<TerrainNode> nodes;
  for (int v = 0; v < edge; ++v)
    for (int u = 0; u < edge; ++u)
      nodes.push_back({kColumn * (2 * u + v), 0xff000000u | static_cast<std::uint32_t>(10 * u),
                       static_cast<std::uint32_t>(u)});
  const BrickTerrain terrain(nodes, rules());
  REQUIRE(terrain.known());
  for (const int u : {0, 1, 31, 62, 63})
    for (const int v : {0, 5, 63}) {
      const double cu = 0.5 + (u + 0.5) / kCellColumns, cv = 0.5 + (v + 0.5) / kCellColumns;
      CHECK(terrain.at(u, v).height == Approx(kColumn * (2 * cu + cv)));
      CHECK(static_cast<double>(terrain.rgba(u, v) & 0xffffffu) == Approx(10 * cu).margin(1.0));
      CHECK(terrain.node(u, v).flags == static_cast<std::uint32_t>(u / kCellColumns + 1));
    }
  CHECK_FALSE(BrickTerrain({}, rules()).known());
}

TEST_CASE("ground layers: what stands is left out, and below it a synthetic layer goes on", "[unit]") {
  std::vector<ColumnPoint> points;
  for (int i = 0; i < 6; ++i) {
    points.push_back(point(3, 3, 10.0 + 0.05 * i, 0xff000000u | 7u));  // ground
    points.push_back(point(3, 3, 25.0 + i, 0xff000000u | 99u));        // a crown above it
    points.push_back(point(4, 3, 18.0));                               // a roof
  }
  std::vector<ColumnLayers> layers(kBrickCells * kBrickCells);
  const auto column = [&](int u, int v) { return layers[static_cast<std::size_t>(v * kBrickCells + u)]; };
  const std::vector<TerrainNode> outside = level_nodes(10 * kColumn, 0);
  SECTION("outside nothing stands in for what was not seen") {
    find_ground_layers(points, BrickTerrain(outside, rules()), layers);
    CHECK(column(5, 3).top.height == kNoHeight);
  }
  SECTION("inside a layer does") {
    const std::vector<TerrainNode> inside = level_nodes(10 * kColumn, kTerrainInside);
    find_ground_layers(points, BrickTerrain(inside, rules()), layers);
    CHECK(column(5, 3).top.height == 10 * kColumn);
    CHECK(column(5, 3).synthetic);
  }
  CHECK(std::abs(column(3, 3).top.height - 10.15 * kColumn) < 0.1 * kColumn);
  CHECK(column(3, 3).bottom.height == 10 * kColumn);
  CHECK(column(3, 3).top.points == 6);
  CHECK((column(3, 3).top.rgba & 0xffu) == 7);
  CHECK_FALSE(column(3, 3).synthetic);
  CHECK(column(4, 3).synthetic);
  CHECK(column(4, 3).top.height == 10 * kColumn);
  CHECK(column(4, 3).top.rgba == 0xff112233u);
}

TEST_CASE("cleared layers: strewn points go, buildings and bare ground stay as they are", "[unit]") {
  std::vector<ColumnPoint> points;
  const auto strewn = [&](int u, int v, double height) {
    points.push_back(point(u, v, height));
    points.back().volumetric = true;
  };
  for (int v = 20; v < 30; ++v)
    for (int u = 0; u < 30; ++u)
      for (int i = 0; i < 4; ++i) {
        const double off = 0.05 * i;
        if (u < 10) strewn(u, v, 30.0 + 2.0 * off);                 // a crown
        if (u < 10 && i == 0) points.push_back(point(u, v, 26.0));  // a flake of it that lies in a plane
        if (u < 5 || u >= 20) points.push_back(point(u, v, 10.0 + off));
        if (u >= 10 && u < 20) points.push_back(point(u, v, 40.0 + off));  // a roof
      }
  std::vector<ColumnLayers> layers(kBrickCells * kBrickCells);
  const std::vector<TerrainNode> seen =
      level_nodes(10 * kColumn, kTerrainInside | kTerrainSeen | kTerrainRoof);
  find_cleared_layers(points, BrickTerrain(seen, rules()), layers);
  const auto column = [&](int u, int v) { return layers[static_cast<std::size_t>(v * kBrickCells + u)]; };
  for (const int u : {1, 3, 7, 9}) {
    CAPTURE(u);
    CHECK(column(u, 25).cleared);
    CHECK(column(u, 25).synthetic == (u >= 5));
    CHECK(std::abs(column(u, 25).top.height - 10 * kColumn) < kColumn / 2);
    CHECK(column(u, 25).terrain == 10 * kColumn);
  }
  for (const int u : {12, 15}) {
    CAPTURE(u);
    CHECK_FALSE(column(u, 25).cleared);
    CHECK_FALSE(column(u, 25).synthetic);
    CHECK(column(u, 25).top.height > 39 * kColumn);
    CHECK(column(u, 25).terrain == kNoHeight);  // nothing follows a roof
  }
  CHECK_FALSE(column(25, 25).cleared);
  CHECK_FALSE(column(25, 25).synthetic);
  CHECK(column(25, 25).top.points == 4);
  CHECK(column(50, 50).top.height == kNoHeight);  // between samples, as ever
  // Where a cell holds nothing at all the membrane goes on.
  const std::vector<TerrainNode> unseen = level_nodes(10 * kColumn, kTerrainInside);
  std::vector<ColumnLayers> filled(kBrickCells * kBrickCells);
  find_cleared_layers(points, BrickTerrain(unseen, rules()), filled);
  CHECK(filled[50 * kBrickCells + 50].synthetic);
  CHECK_FALSE(filled[50 * kBrickCells + 50].cleared);
  // A narrow surface among more that is strewn is a flat crown where no roof was found.
  std::erase_if(points, [](const ColumnPoint& p) { return p.column % kBrickCells >= 16; });
  for (const bool roof : {false, true}) {
    CAPTURE(roof);
    std::vector<ColumnLayers> narrow(kBrickCells * kBrickCells);
    find_cleared_layers(points, BrickTerrain(roof ? seen : unseen, rules()), narrow);
    CHECK(narrow[25 * kBrickCells + 14].cleared == !roof);
    CHECK(narrow[25 * kBrickCells + 14].synthetic == !roof);
  }
}

TEST_CASE("ground layers: synthetic ones follow the measured ones nearby, and the terrain far from them",
          "[unit]") {
  constexpr int kEdge = 120;
  const auto index = [](int u, int v) { return static_cast<std::size_t>(v * kEdge + u); };
  std::vector<ColumnLayers> layers(kEdge * kEdge);
  for (int v = 0; v < kEdge; ++v)
    for (int u = 0; u < kEdge; ++u) {
      ColumnLayers& c = layers[index(u, v)];
      c.bottom.height = c.terrain = 4 * kColumn;
      c.synthetic = u > 40 || (u % 4 != 0 || v % 4 != 0);
      c.top = {c.synthetic ? 4 * kColumn : 6 * kColumn, 3, 0, 0};  // ground two cells above the terrain
    }
  std::vector<ColumnLayers> moved = layers;
  for (int v = 0; v < kEdge; ++v)
    moved[index(90, v)].top.height = 40 * kColumn, moved[index(90, v)].synthetic = false;
  follow_measured(layers, kEdge);
  follow_measured(moved, kEdge);
  const auto height = [&](int u) { return layers[index(u, 60)].top.height / static_cast<double>(kColumn); };
  CHECK(height(20) == 6.0);
  CHECK(height(22) > 5.5);  // between them
  CHECK(height(44) > 5.0);
  CHECK(height(50) < height(44));
  CHECK(height(40 + kFollowColumns + 1) == 4.0);
  for (int u = 41; u < 90; ++u)
    CHECK(layers[index(u, 60)].top.height <= layers[index(u - 1, 60)].top.height + kColumn / 50);
  for (int u = 20; u < 90 - kFollowColumns; ++u)
    CHECK(moved[index(u, 60)].top.height == layers[index(u, 60)].top.height);
}

}  // namespace terrain_test
