#include <algorithm>

#include "octree/morton.h"
#include "stream/files/json.h"
#include "stream/files/task_files.h"
#include "stream/points/closing_store.h"
#include "stream/points/multipole_store.h"
#include "stream/points/point_overlay.h"
#include "stream/points/reconstruct_options.h"
#include "stream/runtime/task_counts.h"
#include "stream/stages/plan/planned_scan.h"
#include "stream/stages/surface/closing_stages.h"
#include "stream/stages/surface/dense_bricks.h"
#include "stream/stages/surface/surface_stage.h"

namespace tessera {
namespace {

constexpr std::uint64_t kBoundaryTaskBytes = 8u << 20;

class BoundariesStage : public Stage {
 public:
  explicit BoundariesStage(const JobState& state)
      : plan_(Plan::of_work(state.work)),
        store_(PointStore::of_surface(state.work)),
        field_(field_options(plan_, reconstruct_options(state).feature_angle_deg)) {
    if (!HolesMode(reconstruct_options(state).holes).close) return;
    field_.firm_boundary = true;
    bytes_limit_ = tile_bytes_limit(state.run);
    groups_ = make_tile_groups(store_.bricks(), surface_tiling(state, field_));
  }

  std::string name() const override { return "rims"; }
  std::size_t task_count() const override { return groups_.size(); }
  std::uint64_t units() const override { return groups_.empty() ? 0 : store_.point_count(); }
  std::string unit_name() const override { return "points"; }

  std::uint64_t task_bytes(std::size_t task) const override {
    std::uint64_t maximum = 0;
    for (const Tile& tile : groups_[task]) maximum = std::max(maximum, cut(tile).bytes);
    return maximum + kBoundaryTaskBytes;
  }

  Json run(std::size_t task, TaskContext& context) const override {
    BrickSectionWriter writer(context.create("rims/" + task_file_stem(task) + ".tsr"));
    FieldOptions options = field_;
    options.pause = [&context] { context.check_stop(); };
    std::uint64_t boundaries = 0;
    for (const Tile& tile : groups_[task]) {
      context.check_stop();
      std::uint64_t own_points = 0;
      const DirectedField field = field_in_parts(store_, tile, cut(tile).edge, options, own_points, context);
      if (field.leaves.empty()) continue;
      std::vector<Int3> cells = boundary_cells(field);
      boundaries += cells.size();
      const auto count = static_cast<std::uint64_t>(tile.bricks) * static_cast<std::uint64_t>(tile.bricks) *
                         static_cast<std::uint64_t>(tile.bricks);
      for (std::uint64_t code = 0; code < count; ++code) {
        const auto at = morton_decode(code);
        const Int3 brick = {static_cast<int>(at[0]), static_cast<int>(at[1]), static_cast<int>(at[2])};
        const std::vector<BandSigns> signs = signs_of_brick(field, brick);
        if (signs.empty()) continue;
        writer.signs(
            brick_key({tile.brick[0] + brick[0], tile.brick[1] + brick[1], tile.brick[2] + brick[2]}), signs,
            cells);
        cells.clear();  // global names: any brick of the tile may hold them
      }
      context.advance(own_points);
    }
    context.count_written(writer.finish());
    return {{"rim_cells", boundaries}};
  }

  std::uint64_t finish_bytes() const override { return 1u << 20; }

  Json finish(const std::vector<Json>& summaries, TaskContext&) const override {
    if (groups_.empty()) return {{"needed", false}};
    return sum_counts(summaries, {{"needed", true}});
  }

 private:
  TileCut cut(const Tile& tile) const {
    return cut_tile(store_, nullptr, tile, field_halo_cells(field_), bytes_limit_);
  }

  Plan plan_;
  PointStore store_;
  FieldOptions field_;
  std::uint64_t bytes_limit_ = 0;  ///< of a tile
  std::vector<TileGroup> groups_;
};

}  // namespace

std::unique_ptr<Stage> make_boundaries_stage(const JobState& state) {
  return std::make_unique<BoundariesStage>(state);
}

namespace {

// Microseconds a point, and a face of the open surface; what closing itself takes only the holes know.
constexpr double kMultipoleTime = 0.1, kBoundaryTime = 0.4;
constexpr double kMultipoleBytes = 0.96, kBoundaryBytes = 1.5;  ///< on disk, a face

}  // namespace

StageForecast forecast_multipole(const PlannedScan& scan) {
  if (!scan.closes) return idle_forecast();
  const std::uint64_t buckets = scan.plan.buckets.size();
  return all_sure({.tasks = buckets,
                   .task_bytes = multipole_task_bytes(scan.largest_brick),
                   .disk_bytes = bytes_of(scan.faces, kMultipoleBytes),
                   .files = buckets,
                   .processor_us = scan.points * kMultipoleTime,
                   .moved_bytes = static_cast<double>(scan.store_bytes + scan.overlay_bytes)});
}
StageForecast forecast_boundaries(const PlannedScan& scan) {
  if (!scan.closes) return idle_forecast();
  std::uint64_t task = 0;
  scan.for_each_tile([&](const Tile& t) {
    task =
        std::max(task, expected_tile_bytes(scan.bricks, nullptr, t, scan.halo, tile_bytes_limit(scan.run)));
  });
  return all_sure({.tasks = scan.groups.size(),
                   .task_bytes = task + kBoundaryTaskBytes,
                   .disk_bytes = bytes_of(scan.faces, kBoundaryBytes),
                   .files = scan.groups.size(),
                   .processor_us = scan.faces * kBoundaryTime,
                   .moved_bytes = static_cast<double>(scan.store_bytes + scan.overlay_bytes)});
}
StageForecast forecast_close(const PlannedScan& scan) {
  if (!scan.closes) return idle_forecast();
  // What a brick's neighbours lend depends on where in them the points lie: about a quarter.
  std::uint64_t lent = 0;
  for (const BrickEntry& b : scan.bricks) {
    const Tile tile{brick_of_key(b.key), 1};
    CloseCounts counts;
    for (int d = 0; d < 27; ++d) {
      const Int3 n = {tile.brick[0] + d % 3 - 1, tile.brick[1] + d / 3 % 3 - 1, tile.brick[2] + d / 9 - 1};
      if (n[0] < 0 || n[1] < 0 || n[2] < 0) continue;
      if (const BrickEntry* e = find_brick(scan.bricks, brick_key(n)))
        counts.visit_points += d == 13 ? e->points : e->points / 4;
    }
    counts.near_bytes = MultipoleStore::near_bytes(scan.bricks, tile.corner(), tile.edges());
    counts.far_bytes = 2 * sizeof(Multipole) * scan.bricks.size();
    lent = std::max(lent, close_bytes(scan.run, counts));
  }
  return {.finish_bytes = lent, .sure_bytes = close_bytes(scan.run, {}), .files = 1};
}

}  // namespace tessera
