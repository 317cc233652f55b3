#include "stream/stages/reconstruct/brick_needs.h"

#include <algorithm>
#include <map>
#include <set>
#include <utility>

#include "stream/points/multipole_store.h"
#include "stream/points/top_store.h"
#include "stream/stages/coverage/coverage_stage.h"
#include "stream/stages/coverage/seen_stages.h"
#include "stream/stages/decimate/simplify_needs.h"
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

TopNeeds planned_top_needs(const RunOptions& run, const ReconstructOptions& options,
                           std::span<const BrickEntry> bricks) {
  const ViewAxes axes = ViewAxes::along(options.up.value_or(Double3{0, 0, 1}));
  const bool skin = options.surface == "top";
  const ModelUse use = skin ? ModelUse::kSkin : ModelUse::kStandIn;
  const int edge = top_group_columns(run, use);
  std::map<std::pair<int, int>, std::uint64_t> columns;
  std::set<std::pair<int, int>> groups;
  std::uint64_t brick = 0, column = 0;
  for (const BrickEntry& b : bricks) {
    const Int3 at = brick_of_key(b.key);
    std::uint64_t& points = columns[{at[axes.u], at[axes.v]}];
    points += b.points;
    column = std::max(column, points), brick = std::max(brick, b.points);
    groups.emplace(at[axes.u] / edge, at[axes.v] / edge);
  }
  return {groups.size(), top_task_bytes(edge, column, brick, use),
          top_points_task_bytes(brick, (skin ? 2 : 1) * kBrickSamples)};
}

bool may_have_top(const ReconstructOptions& options) {
  const bool above = options.from == "auto" || options.from == "above";
  return options.models_top() && (options.vegetation == "top" || above);
}

}  // namespace tessera
