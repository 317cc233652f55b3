#include "kernels/points/terrain.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cstdlib>
#include <limits>
#include <set>

#include "kernels/points/column_filters.h"

namespace tessera {
namespace {

/// Of follow_measured(): each takes the mean of the neighbours of the round before, then sweeps even that out.
constexpr int kGrowRounds = 14;
/// Cells on either side of the widest window at rims.
constexpr int kRimWindow = 4;

/// Colours of the cells whose ground was seen, spread over the others as heights are.
void spread_colours(std::span<const TerrainCell> cells, int width, int height,
                    std::vector<TerrainNode>& nodes) {
  constexpr int kShift = 8;  // parts of a shade, so that a membrane between near ones is smooth
  std::vector<std::uint8_t> coloured(cells.size());
  for (std::size_t i = 0; i < cells.size(); ++i)
    coloured[i] = (nodes[i].flags & kTerrainSeen) != 0 && (cells[i].rgba >> 24) != 0;
  if (std::find(coloured.begin(), coloured.end(), 1) == coloured.end()) return;
  std::vector<std::int32_t> shade(cells.size());
  for (TerrainNode& node : nodes) node.rgba = 0xff000000u;
  for (unsigned channel = 0; channel < 24; channel += 8) {
    for (std::size_t i = 0; i < cells.size(); ++i)
      shade[i] = static_cast<std::int32_t>(cells[i].rgba >> channel & 0xff) << kShift;
    fill_membrane(shade, coloured, width, height);
    for (std::size_t i = 0; i < cells.size(); ++i)
      nodes[i].rgba |= static_cast<std::uint32_t>(shade[i] >> kShift & 0xff) << channel;
  }
}

/// Removes objects at the rim of the scan or of a hole. Beyond the rim the ground filter continues at the object's height, as it
/// must on a slope, so that none of its windows reaches around it. Windows over measured cells alone do; they stay small,
/// because they cut slopes as well.
void drop_rim_objects(std::vector<std::int32_t>& lowest, int width, int height, const GroundRules& rules) {
  constexpr std::int32_t kHighest = std::numeric_limits<std::int32_t>::max();
  std::vector<std::uint8_t> stands(lowest.size(), 0);
  std::vector<std::int32_t> surface = lowest;
  for (int radius = 1; radius <= std::min(kRimWindow, rules.max_window); ++radius) {
    std::vector<std::int32_t> open = surface;
    for (std::int32_t& h : open) h = h == kNoGround ? kHighest : h;
    erode_raster(open, width, height, radius);
    for (std::size_t i = 0; i < open.size(); ++i)
      if (lowest[i] == kNoGround) open[i] = kNoGround;
    dilate_raster(open, width, height, radius);
    const auto max_step = static_cast<std::int64_t>(rules.slope * radius * rules.cell + 0.5);
    for (std::size_t i = 0; i < lowest.size(); ++i) {
      if (lowest[i] == kNoGround) continue;
      stands[i] = stands[i] != 0 || std::int64_t{surface[i]} - open[i] > max_step;
      surface[i] = open[i];
    }
  }
  for (std::size_t i = 0; i < lowest.size(); ++i)
    if (stands[i] != 0) lowest[i] = kNoGround;
}

/// Cells inside the outline of what was measured, whose holes no wider than the window count, and so do all cells around them.
void mark_inside(std::span<const TerrainCell> cells, int width, int height, int max_window,
                 std::vector<TerrainNode>& nodes) {
  std::vector<std::int32_t> inside(nodes.size());
  for (std::size_t i = 0; i < nodes.size(); ++i) inside[i] = cells[i].lowest != kNoGround;
  dilate_raster(inside, width, height, max_window);
  erode_raster(inside, width, height, max_window + 1);
  for (std::size_t i = 0; i < nodes.size(); ++i)
    if (inside[i] != 0) nodes[i].flags |= kTerrainInside;
}

}  // namespace

void find_terrain_cells(std::span<ColumnPoint> points, int cell_columns, std::int32_t depth,
                        std::span<TerrainCell> cells) {
  const int shift = std::countr_zero(static_cast<unsigned>(cell_columns)), row = kBrickBits - shift;
  const auto cell = [&](const ColumnPoint& p) {
    return (p.column >> (kBrickBits + shift)) << row | (p.column & (kBrickCells - 1)) >> shift;
  };
  std::sort(points.begin(), points.end(), [&](const ColumnPoint& a, const ColumnPoint& b) {
    const int first = cell(a), second = cell(b);
    return first != second ? first < second : a.height < b.height;
  });
  for (std::size_t first = 0; first < points.size();) {
    const int at = cell(points[first]);
    const std::int64_t top = std::int64_t{points[first].height} + depth;
    std::size_t low = first, end = first;
    for (; end < points.size() && cell(points[end]) == at; ++end)
      if (points[end].height <= top) low = end + 1;
    const PointLayer layer = layer_of(points.subspan(first, low - first));
    cells[static_cast<std::size_t>(at)] = {points[first].height, layer.height, layer.rgba};
    first = end;
  }
}

std::vector<TerrainNode> fit_terrain(std::span<const TerrainCell> cells, int width, int height,
                                     const GroundRules& rules, const RoofRules& roofs) {
  std::vector<std::int32_t> heights(cells.size());
  for (std::size_t i = 0; i < cells.size(); ++i) heights[i] = cells[i].lowest;
  drop_rim_objects(heights, width, height, rules);
  GroundSurface found = find_ground(heights, width, height, rules);
  std::vector<TerrainNode> nodes(cells.size());
  std::vector<std::uint8_t> known(cells.size()), roof;
  if (roofs.min_height > 0.0) {
    for (std::size_t i = 0; i < cells.size(); ++i) {  // buildings at rims too
      heights[i] = cells[i].lowest;
      if (found.kind[i] == kGroundEmpty && heights[i] != kNoGround) found.kind[i] = kGroundObject;
    }
    roof = find_planar_areas(heights, found, roofs);
  }
  for (std::size_t i = 0; i < cells.size(); ++i) {
    known[i] = found.kind[i] == kGroundMeasured;
    if (known[i] != 0) heights[i] = cells[i].level;
    nodes[i].flags = known[i] != 0 ? kTerrainSeen : cells[i].lowest == kNoGround ? 0u : kTerrainStands;
    if (!roof.empty() && roof[i] != 0) nodes[i].flags |= kTerrainRoof;
  }
  fill_membrane(heights, known, width, height);
  for (std::size_t i = 0; i < cells.size(); ++i) nodes[i].level = heights[i];
  heights = {};
  mark_inside(cells, width, height, rules.max_window, nodes);
  spread_colours(cells, width, height, nodes);
  return nodes;
}

int terrain_halo(const GroundRules& rules, const RoofRules& roofs) {
  const int area = roofs.min_height > 0.0 ? roofs.min_cells + 4 : 0;
  return rules.max_window * (rules.max_window + 1) + 2 + kRimWindow * (kRimWindow + 1) + area;
}

BrickTerrain::BrickTerrain(std::span<const TerrainNode> nodes, const GroundRules& rules)
    : rules_(rules), nodes_(nodes.begin(), nodes.end()) {
  if (!known()) return;
  surface_.width = surface_.height = edge(rules);
  for (const TerrainNode& node : nodes_) surface_.ground.push_back(node.level);
}

GroundAt BrickTerrain::at(int u, int v) const {
  const double cells = static_cast<double>(kQuantaPerCell) / rules_.cell;
  return ground_at(surface_, rules_, 1.0 + (u + 0.5) * cells, 1.0 + (v + 0.5) * cells);
}

std::uint32_t BrickTerrain::rgba(int u, int v) const {
  // In half columns from the middle of the first node on: whole numbers.
  const int span = 2 * rules_.cell / kQuantaPerCell, x = span / 2 + 2 * u + 1, y = span / 2 + 2 * v + 1;
  const int s = x % span, t = y % span;
  const auto at = [&](int i, int j) {
    return nodes_[static_cast<std::size_t>((y / span + j) * surface_.width + x / span + i)].rgba;
  };
  std::uint32_t out = 0xff000000u;
  for (unsigned channel = 0; channel < 24; channel += 8) {
    const auto shade = [&](int i, int j) { return static_cast<int>(at(i, j) >> channel & 0xff); };
    const int low = shade(0, 0) * (span - s) + shade(1, 0) * s,
              high = shade(0, 1) * (span - s) + shade(1, 1) * s;
    out |= static_cast<std::uint32_t>((low * (span - t) + high * t) / (span * span)) << channel;
  }
  return (at(0, 0) >> 24) != 0 ? out : 0;
}

const TerrainNode& BrickTerrain::node(int u, int v) const {
  const int columns = rules_.cell / kQuantaPerCell;
  return nodes_[static_cast<std::size_t>((v / columns + 1) * surface_.width + u / columns + 1)];
}

namespace {

constexpr std::size_t kBrickColumns = std::size_t{kBrickCells} * kBrickCells;
/// Columns around one whose points say whether what stands there is strewn; and farther ones: flakes of crowns lie in a plane,
/// but four in five columns around are strewn.
constexpr int kStrewnRadius = 2, kCrownRadius = 16;
/// So many times the tolerance over the ground stands high; where more than one column in so many is strewn, it is no roof by itself.
constexpr std::int64_t kHighTolerances = 4, kAmongStrewn = 2;

/// The terrain at the columns of a brick column, quanta.
struct ColumnGround {
  std::vector<std::int32_t> height, tolerance;

  explicit ColumnGround(const BrickTerrain& terrain) : height(kBrickColumns), tolerance(kBrickColumns) {
    for (int v = 0; v < kBrickCells; ++v)
      for (int u = 0; u < kBrickCells; ++u) {
        const GroundAt ground = terrain.at(u, v);
        const auto i = static_cast<std::size_t>(v * kBrickCells + u);
        height[i] = static_cast<std::int32_t>(ground.height);
        tolerance[i] =
            static_cast<std::int32_t>(std::min<double>(ground.tolerance, kQuantaPerCell << kBrickBits));
      }
  }
  [[nodiscard]] std::int64_t above(const ColumnPoint& p) const {
    return std::int64_t{p.height} - height[p.column];
  }
  [[nodiscard]] bool holds(const ColumnPoint& p) const {
    return !p.steep && std::abs(above(p)) <= tolerance[p.column];
  }
};

/// Columns with points above the ground, most of which are strewn around there.
std::vector<std::uint8_t> strewn_columns(std::span<const ColumnPoint> points, const ColumnGround& ground,
                                         const BrickTerrain& terrain) {
  std::vector<std::int64_t> votes(kBrickColumns, 0);
  std::vector<std::uint8_t> out(kBrickColumns, 0), high(kBrickColumns, 0);
  for (const ColumnPoint& p : points) {
    if (ground.above(p) > kHighTolerances * ground.tolerance[p.column]) high[p.column] = 1;
    if (ground.above(p) <= ground.tolerance[p.column]) continue;
    votes[p.column] += p.volumetric ? 1 : -1;
    out[p.column] = 1;
  }
  std::vector<std::int64_t> all(out.begin(), out.end()), strewn(kBrickColumns);
  for (std::size_t i = 0; i < kBrickColumns; ++i) strewn[i] = votes[i] > 0;
  const std::vector<std::int64_t> sums = box_sums({kBrickCells}, votes, kStrewnRadius);
  all = box_sums({kBrickCells}, all, kCrownRadius), strewn = box_sums({kBrickCells}, strewn, kCrownRadius);
  for (std::size_t i = 0; i < kBrickColumns; ++i) {
    const int u = static_cast<int>(i) % kBrickCells, v = static_cast<int>(i) / kBrickCells;
    const bool crown =
        high[i] != 0 && kAmongStrewn * strewn[i] > all[i] && (terrain.node(u, v).flags & kTerrainRoof) == 0;
    out[i] &= static_cast<std::uint8_t>(sums[i] > 0 || 5 * strewn[i] > 4 * all[i] || crown);
  }
  return out;
}

}  // namespace

void find_ground_layers(std::span<ColumnPoint> points, const BrickTerrain& terrain,
                        std::span<ColumnLayers> layers) {
  const ColumnGround ground(terrain);
  std::vector<std::uint8_t> seen(kBrickColumns, 0);
  for (const ColumnPoint& p : points) seen[p.column] = 1;
  const auto above =
      std::partition(points.begin(), points.end(), [&](const ColumnPoint& p) { return ground.holds(p); });
  find_column_layers({points.begin(), above}, layers);
  for (int v = 0; v < kBrickCells; ++v)
    for (int u = 0; u < kBrickCells; ++u) {
      const auto i = static_cast<std::size_t>(v * kBrickCells + u);
      ColumnLayers& column = layers[i];
      const TerrainNode& node = terrain.node(u, v);
      if (column.bottom.height != kNoHeight) {
        column.top = column.bottom;
      } else if (seen[i] != 0 || (node.flags & kTerrainInside) != 0) {
        column.top = {ground.height[i], 0, 0, terrain.rgba(u, v)};
        column.synthetic = true;
      }
      column.bottom = {ground.height[i], 0, 0, 0};
      column.terrain = ground.height[i];
    }
}

void find_cleared_layers(std::span<ColumnPoint> points, const BrickTerrain& terrain,
                         std::span<ColumnLayers> layers) {
  const ColumnGround ground(terrain);
  const std::vector<std::uint8_t> strewn = strewn_columns(points, ground, terrain);
  const auto left = std::partition(points.begin(), points.end(), [&](const ColumnPoint& p) {
    return strewn[p.column] == 0 || ground.holds(p);
  });
  find_column_layers({points.begin(), left}, layers);
  // Cells below crowns, whose ground shows here and there, are filled whole.
  std::set<const TerrainNode*> below;
  for (int i = 0; i < static_cast<int>(kBrickColumns); ++i)
    if (strewn[static_cast<std::size_t>(i)] != 0)
      below.insert(&terrain.node(i % kBrickCells, i / kBrickCells));
  for (int v = 0; v < kBrickCells; ++v)
    for (int u = 0; u < kBrickCells; ++u) {
      const auto i = static_cast<std::size_t>(v * kBrickCells + u);
      ColumnLayers& column = layers[i];
      const TerrainNode& node = terrain.node(u, v);
      const bool unseen = (node.flags & (kTerrainSeen | kTerrainStands)) == 0;
      column.cleared = strewn[i] != 0;
      if (column.cleared && column.bottom.height != kNoHeight) column.top = column.bottom;
      if (column.top.height == kNoHeight &&
          (column.cleared || below.count(&node) > 0 || (unseen && (node.flags & kTerrainInside) != 0))) {
        column.top = column.bottom = {ground.height[i], 0, 0, terrain.rgba(u, v)};
        column.synthetic = true;
      }
      if (column.top.height != kNoHeight &&
          std::abs(std::int64_t{column.top.height} - ground.height[i]) <= ground.tolerance[i])
        column.terrain = ground.height[i];
    }
}

void follow_measured(std::span<ColumnLayers> layers, int edge) {
  const auto row = static_cast<std::ptrdiff_t>(edge);
  const std::array<std::ptrdiff_t, 4> around = {-row, -1, 1, row};
  std::vector<std::size_t> columns;  // synthetic
  std::vector<std::int32_t> off(layers.size(), kNoHeight);
  for (int v = 0; v < edge; ++v)
    for (int u = 0; u < edge; ++u) {
      const auto i = static_cast<std::size_t>(v * edge + u);
      if (layers[i].top.height == kNoHeight || layers[i].terrain == kNoHeight) continue;
      if (!layers[i].synthetic)
        off[i] = layers[i].top.height - layers[i].terrain;
      else if (u > 0 && v > 0 && u + 1 < edge && v + 1 < edge)
        columns.push_back(i);
    }
  std::vector<std::int32_t> next(columns.size());
  for (int round = 0; round < kFollowColumns; ++round) {
    const bool grows = round < kGrowRounds;
    const std::int64_t before = kGrowRounds - round;  // offsets fade to nothing by the last growing round
    for (std::size_t c = 0; c < columns.size(); ++c) {
      next[c] = off[columns[c]];
      if (grows == (next[c] != kNoHeight)) continue;
      std::int64_t sum = 0, count = 0;
      for (const std::ptrdiff_t d : around) {
        const std::int32_t near = off[static_cast<std::size_t>(static_cast<std::ptrdiff_t>(columns[c]) + d)];
        if (near == kNoHeight) continue;
        sum += near;
        ++count;
      }
      if (count > 0)
        next[c] = static_cast<std::int32_t>(grows ? sum * (before - 1) / (count * before) : sum / count);
    }
    for (std::size_t c = 0; c < columns.size(); ++c) off[columns[c]] = next[c];
  }
  for (const std::size_t i : columns)
    if (off[i] != kNoHeight) layers[i].top.height += off[i];
}

}  // namespace tessera
