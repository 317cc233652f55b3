#include "stream/stages/reconstruct/brick_needs.h"

#include <algorithm>
#include <array>
#include <map>
#include <set>
#include <utility>

#include "kernels/points/terrain.h"
#include "stream/points/multipole_store.h"
#include "stream/points/top_store.h"
#include "stream/stages/coverage/coverage_stage.h"
#include "stream/stages/coverage/seen_stages.h"
#include "stream/stages/decimate/simplify_needs.h"
#include "stream/stages/reconstruct/forecast_rates.h"
#include "stream/stages/scan/ground_stages.h"
#include "stream/stages/scan/top_stage.h"
#include "stream/stages/surface/closing_stages.h"
#include "stream/stages/surface/surface_stage.h"

namespace tessera {
namespace {

/// Samples of a brick that its top surface crosses, steps too; of a skin twice as many.
constexpr std::uint64_t kBrickSamples = std::uint64_t{4} * kBrickCells * kBrickCells;

}  // namespace

std::uint64_t planned_close_bytes(const RunOptions& run, std::span<const BrickEntry> bricks) {
  // What a brick's neighbours lend depends on where in them the points lie: about a quarter.
  std::uint64_t lent = 0;
  for (const BrickEntry& b : bricks) {
    const Tile tile{brick_of_key(b.key), 1};
    CloseCounts counts;
    for (int d = 0; d < 27; ++d) {
      const Int3 n = {tile.brick[0] + d % 3 - 1, tile.brick[1] + d / 3 % 3 - 1, tile.brick[2] + d / 9 - 1};
      if (n[0] < 0 || n[1] < 0 || n[2] < 0) continue;
      if (const BrickEntry* e = find_brick(bricks, brick_key(n)))
        counts.visit_points += d == 13 ? e->points : e->points / 4;
    }
    counts.near_bytes = MultipoleStore::near_bytes(bricks, tile.corner(), tile.edges());
    counts.far_bytes = 2 * sizeof(Multipole) * bricks.size();
    lent = std::max(lent, close_bytes(run, counts));
  }
  return lent;
}

std::uint64_t planned_seen_bytes(const Plan& plan, std::span<const BrickEntry> bricks) {
  std::uint64_t maximum = 0;
  for (const PlanBucket& b : plan.buckets)
    maximum = std::max(maximum, seen_task_bytes(bricks, b.first_brick, b.first_brick + b.bricks));
  return maximum;
}

std::uint64_t planned_coverage_bytes(bool stored, const PatchEntry& largest, std::uint64_t filling_bytes) {
  return coverage_task_bytes(stored ? stored_faces_bytes(surface_block_bytes(largest.faces))
                                    : welded_faces_bytes(std::uint64_t{largest.vertices} + largest.foreign,
                                                         largest.faces, filling_bytes));
}

namespace {

/// Brick columns of a plan, by the axes as one sees them from above.
struct PlannedColumns {
  std::uint64_t fullest_brick = 0, fullest = 0;  ///< points
  std::map<std::pair<int, int>, std::uint64_t> points;
  std::int64_t width = 0, height = 0;  ///< of all

  PlannedColumns(const ViewAxes& axes, std::span<const BrickEntry> bricks) {
    if (bricks.empty()) return;
    const Int3 first = brick_of_key(bricks.front().key);
    std::array<int, 2> low = {first[axes.u], first[axes.v]}, high = low;
    for (const BrickEntry& b : bricks) {
      const Int3 at = brick_of_key(b.key);
      const std::array<int, 2> position = {at[axes.u], at[axes.v]};
      std::uint64_t& column = points[{position[0], position[1]}];
      column += b.points;
      fullest = std::max(fullest, column), fullest_brick = std::max(fullest_brick, b.points);
      for (std::size_t a = 0; a < 2; ++a)
        low[a] = std::min(low[a], position[a]), high[a] = std::max(high[a], position[a]);
    }
    width = high[0] - low[0] + 1, height = high[1] - low[1] + 1;
  }
};

/// \returns what they keep on disk
std::uint64_t forecast_ground(const GroundSetup& setup, const PlannedColumns& columns, double points,
                              double moved, ForecastList& list) {
  const std::uint64_t tasks = ground_tasks(setup, columns.width, columns.height);
  const auto edge = static_cast<std::uint64_t>(kBrickCells / setup.cell_columns);
  const std::uint64_t cells = columns.points.size() * edge * edge * sizeof(TerrainCell);
  const std::uint64_t nodes = columns.points.size() * (edge + 2) * (edge + 2) * sizeof(TerrainNode);
  const std::uint64_t block = ground_task_bytes(setup, columns.width, columns.height);
  list.add("ground-cells", columns.points.size() / kGroundTaskColumns + 1,
           {ground_cells_task_bytes(columns.fullest, columns.fullest_brick), 0, 0}, cells,
           columns.points.size() / kGroundTaskColumns + 1, points * rates::kGroundCellsTime, moved);
  list.add("ground", tasks, {block, ground_finish_bytes(columns.points.size()), block}, nodes, tasks,
           static_cast<double>(tasks * block) * rates::kGroundTime, static_cast<double>(cells + nodes));
  return cells + nodes;
}

}  // namespace

std::uint64_t forecast_top(const RunOptions& run, const ReconstructOptions& options, const Plan& plan,
                           std::span<const BrickEntry> bricks, std::uint64_t points_bytes,
                           std::uint64_t overlay_bytes, ForecastList& list) {
  const PlannedColumns columns(ViewAxes::along(options.up.value_or(Double3{0, 0, 1})), bricks);
  const auto points = static_cast<double>(plan.points());
  const auto read = static_cast<double>(points_bytes + overlay_bytes);
  const ModelUse use = model_use(options);
  const bool skin = use != ModelUse::kStandIn;
  std::uint64_t disk = 0;
  if (use == ModelUse::kGround)
    disk = forecast_ground(ground_setup(options, plan), columns, points, read, list);
  const int edge = top_group_columns(run, use);
  std::set<std::pair<int, int>> groups;
  for (const auto& [at, n] : columns.points) groups.emplace(at.first / edge, at.second / edge);
  const auto top = static_cast<std::uint64_t>(points * (skin ? rates::kSkinBytes : rates::kTopBytes));
  list.add("top", groups.size(), {top_task_bytes(edge, columns.fullest, columns.fullest_brick, use), 0, 0},
           top, groups.size(), points * rates::kTopTime, read);
  list.add("top-points", plan.buckets.size(),
           {top_points_task_bytes(columns.fullest_brick, (skin ? 2 : 1) * kBrickSamples), 0, 0}, points_bytes,
           plan.buckets.size(), points * rates::kTopPointsTime, read + static_cast<double>(points_bytes));
  return disk + top;
}

bool may_have_top(const ReconstructOptions& options) {
  const bool above = options.from == "auto" || options.from == "above";
  return options.models_top() && (options.vegetation == "top" || above);
}

}  // namespace tessera
