#include <fmt/format.h>
#include <algorithm>
#include <cmath>
#include <string>
#include <vector>

#include "kernels/points/terrain.h"
#include "octree/error.h"
#include "stream/files/json.h"
#include "stream/files/task_files.h"
#include "stream/points/ground_store.h"
#include "stream/stages/plan/planned_scan.h"
#include "stream/stages/scan/brick_columns.h"
#include "stream/stages/scan/ground_stages.h"

namespace tessera {
namespace {

/// Brick columns along an edge of a task.
constexpr int kTaskColumns = 8;
static_assert(kTaskColumns * kTaskColumns == kGroundTaskColumns);
constexpr std::uint64_t kCellsFixedBytes = std::uint64_t{2} << 20;

/// Of a cell, metres: as of tessera classify. And spacings, so that most cells hold a point that has reached the ground.
constexpr double kCellMetres = 1.0, kCellSpacings = 2.0;
constexpr int kMaxCellColumns = kBrickCells;
constexpr double kMaxGroundWindow = 256.0;
/// Defaults of SMRF, metres; so many times the threshold is the one that its slope is multiplied by.
constexpr double kDefaultThreshold = 0.5, kDefaultWindow = 18.0;
constexpr double kSlopeThresholds = 2.5;
/// Of roofs among crowns, metres and square metres: as of tessera classify, and the smallest hut.
constexpr double kRoofHeight = 2.0, kRoofResidual = 0.15, kRoofArea = 10.0, kMaxRoofCells = 256.0;

class GroundCellsStage : public Stage {
 public:
  explicit GroundCellsStage(const JobState& state) : columns_(state), setup_(ground_setup(state)) {
    for (const auto& [at, bricks] : columns_.bricks())
      groups_.emplace_back(at.first / kTaskColumns, at.second / kTaskColumns);
    std::sort(groups_.begin(), groups_.end());
    groups_.erase(std::unique(groups_.begin(), groups_.end()), groups_.end());
  }

  std::string name() const override { return "ground-cells"; }
  std::size_t task_count() const override { return groups_.size(); }
  std::uint64_t units() const override { return columns_.bricks().size(); }
  std::string unit_name() const override { return "brick columns"; }

  std::uint64_t task_bytes(std::size_t task) const override {
    const int u = groups_[task].first * kTaskColumns, v = groups_[task].second * kTaskColumns;
    const BrickColumns::Fullest fullest = columns_.fullest(u, u + kTaskColumns, v, v + kTaskColumns);
    return ground_cells_task_bytes(fullest.column, fullest.brick);
  }

  Json run(std::size_t task, TaskContext& context) const override {
    GroundFileWriter writer(
        context.create(std::string(kGroundCellFolder) + "/" + task_file_stem(task) + kGroundExtension),
        kGroundCellKind);
    const auto edge = static_cast<std::size_t>(kBrickCells / setup_.cell_columns);
    const int u0 = groups_[task].first * kTaskColumns, v0 = groups_[task].second * kTaskColumns;
    for (int u = u0; u < u0 + kTaskColumns; ++u)
      for (int v = v0; v < v0 + kTaskColumns; ++v) {
        if (columns_.bricks().count({u, v}) == 0) continue;
        std::vector<ColumnPoint> points = columns_.load(u, v, context);
        std::vector<TerrainCell> cells(edge * edge);
        find_terrain_cells(points, setup_.cell_columns, setup_.depth, cells);
        writer.column(columns_.key(u, v), cells);
        context.advance(1);
      }
    context.count_written(writer.finish());
    return Json::object();
  }

  std::uint64_t finish_bytes() const override { return std::uint64_t{1} << 20; }
  Json finish(const std::vector<Json>&, TaskContext&) const override {
    return {{"brick_columns", columns_.bricks().size()}};
  }

 private:
  BrickColumns columns_;
  GroundSetup setup_;
  std::vector<std::pair<int, int>> groups_;
};

}  // namespace

GroundSetup ground_setup(const ReconstructOptions& options, const Plan& plan) {
  GroundSetup setup;
  const double h = plan.lattice.h, metre = plan.metres > 0.0 ? 1.0 / plan.metres : 1.0;
  const double wanted = std::max(kCellMetres * metre, kCellSpacings * plan.spacing);
  while (setup.cell_columns < kMaxCellColumns && setup.cell_columns * h < wanted) setup.cell_columns *= 2;
  const double cell = setup.cell_columns * h;
  const double length = options.ground_window > 0.0 ? options.ground_window : kDefaultWindow * metre;
  // What nobody has asked for must not be too much for a scene of another scale.
  const double asked = std::ceil(length / cell);
  const double window = options.ground_window > 0.0 ? asked : std::min(asked, kMaxGroundWindow);
  if (!(window <= kMaxGroundWindow))
    throw UsageError(
        fmt::format("--ground-window {:g}: is {:.0f} cells of {:g}, at most {:.0f} are possible; give a "
                    "smaller one, or a "
                    "larger --resolution",
                    length, window, cell, kMaxGroundWindow));
  setup.rules.cell = setup.cell_columns * kQuantaPerCell;
  setup.rules.max_window = std::max(1, static_cast<int>(window));
  setup.rules.slope = options.ground_slope;
  const double threshold =
      options.ground_threshold > 0.0 ? options.ground_threshold : kDefaultThreshold * metre;
  setup.rules.tolerance = threshold / cell;
  setup.rules.slope_tolerance = kSlopeThresholds * threshold / cell;
  const double depth = std::min(setup.rules.tolerance * setup.rules.cell, 1.0 * kBrickCells * kQuantaPerCell);
  setup.depth = static_cast<std::int32_t>(depth);
  if (options.clears_ground()) {
    const double metres = metre / h * kQuantaPerCell, area = kRoofArea * metre * metre;
    setup.roofs = {kRoofHeight * metres, kRoofResidual * metres,
                   static_cast<int>(std::clamp(std::ceil(area / (cell * cell)), 1.0, kMaxRoofCells))};
  }
  return setup;
}

GroundSetup ground_setup(const JobState& state) {
  return ground_setup(reconstruct_options(state), Plan::of_work(state.work));
}

std::uint64_t ground_cells_task_bytes(std::uint64_t column_points, std::uint64_t brick_points) {
  return column_points * sizeof(ColumnPoint) + BrickColumns::load_bytes(brick_points) + kCellsFixedBytes;
}

std::unique_ptr<Stage> make_ground_cells_stage(const JobState& state) {
  return std::make_unique<GroundCellsStage>(state);
}

namespace {

constexpr double kGroundCellsTime = 0.2;  ///< microseconds a point

}  // namespace

StageForecast forecast_ground_cells(const PlannedScan& scan) {
  if (!scan.columns) return idle_forecast();
  const std::uint64_t columns = scan.columns->points.size(), tasks = columns / kGroundTaskColumns + 1;
  const auto edge =
      static_cast<std::uint64_t>(kBrickCells / ground_setup(scan.options, scan.plan).cell_columns);
  return {.tasks = tasks,
          .task_bytes = ground_cells_task_bytes(scan.columns->fullest, scan.largest_brick),
          .disk_bytes = columns * edge * edge * sizeof(TerrainCell),
          .files = tasks,
          .processor_us = scan.points * kGroundCellsTime,
          .moved_bytes = static_cast<double>(scan.store_bytes + scan.overlay_bytes)};
}

}  // namespace tessera
