#include <algorithm>
#include <array>
#include <cmath>
#include <filesystem>
#include <limits>
#include <set>
#include <string>
#include <vector>

#include "kernels/points/terrain.h"
#include "octree/lattice.h"
#include "stream/files/direct_file.h"
#include "stream/files/json.h"
#include "stream/files/record_file.h"
#include "stream/files/task_files.h"
#include "stream/points/ground_store.h"
#include "stream/points/point_store.h"
#include "stream/points/top_store.h"
#include "stream/runtime/task_counts.h"
#include "stream/stages/plan/planned_scan.h"
#include "stream/stages/scan/ground_stages.h"

namespace tessera {
namespace {

/// Of the core of a block, cells. Blocks begin a margin before the first brick column and have one size, so that what a
/// membrane over a very wide hole looks like hangs on the scan alone.
constexpr std::int64_t kCoreCells = 512;
/// Margins and halos are multiples of it, so that coarse levels of the membrane lie alike in all blocks; no brick is larger.
constexpr std::int64_t kMarginStep = 64;
/// Of a raster in fit_terrain(), with its input.
constexpr std::uint64_t kTerrainCellBytes = 60;
constexpr std::uint64_t kTerrainFixedBytes = std::uint64_t{2} << 20;

std::int64_t whole_margins(std::int64_t cells) {
  return (cells + kMarginStep - 1) / kMarginStep * kMarginStep;
}
/// Around the scene, so that no window meets its end.
std::int64_t margin_of(const GroundRules& rules) {
  return whole_margins(rules.max_window + 2);
}
std::int64_t halo_of(const GroundSetup& setup) {
  return whole_margins(terrain_halo(setup.rules, setup.roofs) + 2);
}
int cells_a_brick(const GroundSetup& setup) {
  return kBrickCells / setup.cell_columns;
}

/// Cells [begin, end) of one axis, from the first brick column on.
struct CellRange {
  std::int64_t begin = 0, end = 0;
  std::int64_t size() const { return end - begin; }
};

/// Where blocks lie along one axis.
class BlockAxis {
 public:
  /// \param bricks  brick columns of the scene
  BlockAxis(const GroundSetup& setup, std::int64_t bricks)
      : margin_(margin_of(setup.rules)),
        halo_(halo_of(setup)),
        end_(bricks * cells_a_brick(setup) + margin_) {}
  CellRange core(std::int64_t block) const { return window(block, 0); }
  CellRange all(std::int64_t block) const { return window(block, halo_); }
  /// The blocks whose core lies within the margin of cells [begin, end).
  CellRange near(std::int64_t begin, std::int64_t end) const {
    const std::int64_t last = (std::min(end + margin_, end_) - 1 + margin_) / kCoreCells;
    return {(std::max(begin - margin_, -margin_) + margin_) / kCoreCells, last + 1};
  }
  /// Cells of the largest window.
  std::int64_t largest() const { return std::min(end_ + margin_, kCoreCells + 2 * halo_); }
  std::int64_t blocks() const { return (end_ + margin_ + kCoreCells - 1) / kCoreCells; }

 private:
  CellRange window(std::int64_t block, std::int64_t halo) const {
    const std::int64_t begin = block * kCoreCells - margin_;
    return {std::max(begin - halo, -margin_), std::min(begin + kCoreCells + halo, end_)};
  }
  std::int64_t margin_, halo_, end_;
};

class GroundStage : public Stage {
 public:
  explicit GroundStage(const JobState& state)
      : work_(state.work),
        axes_(ViewAxes::along(reconstruct_options(state).up.value_or(Double3{0, 0, 1}))),
        setup_(ground_setup(state)),
        h_(Plan::of_work(state.work).lattice.h),
        asks_unit_(asks_unit(state)),
        ground_alone_(reconstruct_options(state).surface == "ground"),
        cells_(open_ground_cells(state.work)),
        edge_(cells_a_brick(setup_)),
        u_(setup_, 0),
        v_(setup_, 0) {
    constexpr std::int32_t kMax = std::numeric_limits<std::int32_t>::max();
    std::array<std::int32_t, 2> low = {kMax, kMax}, high = {-1, -1};
    const std::vector<std::uint64_t> keys = cells_.keys();
    for (const std::uint64_t key : keys) {
      const auto at = position(key);
      for (std::size_t a = 0; a < 2; ++a)
        low[a] = std::min(low[a], at[a]), high[a] = std::max(high[a], at[a]);
    }
    if (keys.empty()) return;
    first_ = low;
    u_ = BlockAxis(setup_, high[0] - low[0] + 1), v_ = BlockAxis(setup_, high[1] - low[1] + 1);
    width_ = high[0] - low[0] + 1, height_ = high[1] - low[1] + 1;
    for (const std::uint64_t key : keys) {
      const auto at = position(key);
      const std::int64_t u = (at[0] - low[0]) * edge_, v = (at[1] - low[1]) * edge_;
      const CellRange blocks_u = u_.near(u, u + edge_), blocks_v = v_.near(v, v + edge_);
      for (std::int64_t bv = blocks_v.begin; bv < blocks_v.end; ++bv)
        for (std::int64_t bu = blocks_u.begin; bu < blocks_u.end; ++bu) blocks_.insert({bv, bu});
    }
    tasks_.assign(blocks_.begin(), blocks_.end());
  }

  std::string name() const override { return "ground"; }
  std::size_t task_count() const override { return tasks_.size(); }
  std::uint64_t units() const override { return tasks_.size(); }
  std::string unit_name() const override { return "blocks"; }
  std::uint64_t task_bytes(std::size_t) const override { return ground_task_bytes(setup_, width_, height_); }

  Json run(std::size_t task, TaskContext& context) const override {
    const auto [bv, bu] = tasks_[task];
    const CellRange all_u = u_.all(bu), all_v = v_.all(bv);
    const std::vector<TerrainNode> nodes = fit(all_u, all_v, context);
    context.check_stop();
    GroundFileWriter writer(
        context.create(std::string(kGroundFolder) + "/" + task_file_stem(task) + kGroundExtension),
        kGroundKind);
    Tally tally;
    const CellRange core_u = u_.core(bu), core_v = v_.core(bv);
    for (std::int64_t v = core_v.begin; v < core_v.end; v += edge_)
      for (std::int64_t u = core_u.begin; u < core_u.end; u += edge_)
        write(nodes, all_u, all_v, u, v, writer, tally);
    context.count_written(writer.finish());
    context.advance(1);
    return {{"cells_seen", tally.seen}, {"cells_below_objects", tally.below}, {"cells_filled", tally.filled}};
  }

  std::uint64_t finish_bytes() const override { return ground_finish_bytes(cells_.keys().size()); }
  Json finish(const std::vector<Json>& summaries, TaskContext& context) const override {
    if (tasks_.empty()) return {{"needed", false}};
    if (ground_alone_ && std::filesystem::exists(work_ / kSeenSampleFile)) keep_ground_sample(context);
    Json sum = {{"needed", true},
                {"cell", h_ * setup_.cell_columns},
                {"window", h_ * setup_.cell_columns * setup_.rules.max_window},
                {"slope", setup_.rules.slope}};
    if (asks_unit_)
      sum["warnings"] = {
          "the scan does not name the unit of its coordinates, which are taken as metres: else give "
          "--ground-window and --ground-threshold"};
    return sum_counts(summaries, std::move(sum));
  }
  std::vector<std::string> obsolete() const override { return {std::string(kGroundCellFolder) + "/"}; }

 private:
  struct Tally {
    std::uint64_t seen = 0;    ///< cells in which ground was measured
    std::uint64_t below = 0;   ///< in which something stands on it
    std::uint64_t filled = 0;  ///< in which nothing was measured
  };

  /// Of what the scan saw the ground alone is to be in the mesh.
  void keep_ground_sample(TaskContext& context) const {
    constexpr std::size_t kPage = 4096;
    constexpr std::int32_t kMask = kBrickCells - 1;
    const GroundFiles<TerrainNode> ground = open_ground(work_);
    DirectFile file(context.create(kSeenGroundFile), kPage * sizeof(Int3));
    std::uint64_t shown = ~std::uint64_t{0};
    BrickTerrain terrain({}, setup_.rules);
    for_each_page<Int3>(work_ / kSeenSampleFile, kPage, [&](std::span<const Int3> sample) {
      context.check_stop();
      for (const Int3& q : sample) {
        Int3 at = {0, 0, 0};
        at[axes_.u] = q[axes_.u] >> (kBrickBits + kQuantumBits);
        at[axes_.v] = q[axes_.v] >> (kBrickBits + kQuantumBits);
        if (const std::uint64_t key = brick_key(at); key != shown) {
          terrain = BrickTerrain(ground.load(key), setup_.rules);
          shown = key;
        }
        if (!terrain.known()) continue;
        const GroundAt below =
            terrain.at(q[axes_.u] >> kQuantumBits & kMask, q[axes_.v] >> kQuantumBits & kMask);
        if (std::fabs(axes_.sign * q[axes_.up] - below.height) <= below.tolerance) file.write(&q, sizeof q);
      }
    });
    context.count_written(file.finish());
  }

  static bool asks_unit(const JobState& state) {
    const ReconstructOptions options = reconstruct_options(state);
    const bool given = options.ground_window > 0.0 && options.ground_threshold > 0.0;
    return !given && Plan::of_work(state.work).metres == 0.0;
  }
  /// (u, v) of a brick column.
  std::array<std::int32_t, 2> position(std::uint64_t key) const {
    const Int3 at = brick_of_key(key);
    return {at[axes_.u], at[axes_.v]};
  }
  /// Of the brick column that begins at these cells; none below the lattice.
  std::uint64_t key(std::int64_t u, std::int64_t v) const {
    Int3 at = {0, 0, 0};
    at[axes_.u] = first_[0] + static_cast<std::int32_t>(u / edge_);
    at[axes_.v] = first_[1] + static_cast<std::int32_t>(v / edge_);
    return brick_key(at);
  }
  bool in_scene(std::int64_t u, std::int64_t v) const {
    return u >= 0 && v >= 0 && u < width_ * edge_ && v < height_ * edge_;
  }

  std::vector<TerrainNode> fit(const CellRange& all_u, const CellRange& all_v,
                               const TaskContext& context) const {
    std::vector<TerrainCell> raster(static_cast<std::size_t>(all_u.size() * all_v.size()));
    for (std::int64_t v = all_v.begin; v < all_v.end; v += edge_)
      for (std::int64_t u = all_u.begin; u < all_u.end; u += edge_) {
        if (!in_scene(u, v)) continue;
        const std::vector<TerrainCell> brick = cells_.load(key(u, v));
        if (brick.empty()) continue;
        for (std::int64_t row = 0; row < edge_; ++row)
          std::copy_n(brick.begin() + row * edge_, edge_,
                      raster.begin() + (v - all_v.begin + row) * all_u.size() + u - all_u.begin);
      }
    context.check_stop();
    return fit_terrain(raster, static_cast<int>(all_u.size()), static_cast<int>(all_v.size()), setup_.rules,
                       setup_.roofs);
  }

  /// Of one brick column, with the cells around it, where it has points or lies inside.
  void write(const std::vector<TerrainNode>& nodes, const CellRange& all_u, const CellRange& all_v,
             std::int64_t u, std::int64_t v, GroundFileWriter& writer, Tally& tally) const {
    if (!in_scene(u, v)) return;
    std::vector<TerrainNode> own;
    own.reserve(static_cast<std::size_t>((edge_ + 2) * (edge_ + 2)));
    bool wanted = cells_.has(key(u, v));
    for (std::int64_t y = v - 1; y <= v + edge_; ++y)
      for (std::int64_t x = u - 1; x <= u + edge_; ++x) {
        const TerrainNode& node =
            nodes[static_cast<std::size_t>((y - all_v.begin) * all_u.size() + x - all_u.begin)];
        own.push_back(node);
        if (y < v || x < u || y == v + edge_ || x == u + edge_) continue;
        wanted = wanted || (node.flags & kTerrainInside) != 0;
        if ((node.flags & kTerrainSeen) != 0)
          ++tally.seen;
        else if ((node.flags & kTerrainStands) != 0)
          ++tally.below;
        else if ((node.flags & kTerrainInside) != 0)
          ++tally.filled;
      }
    if (wanted) writer.column(key(u, v), own);
  }

  std::filesystem::path work_;
  ViewAxes axes_;
  GroundSetup setup_;
  double h_;
  bool asks_unit_;     ///< lengths were not given, and nobody says what metres are
  bool ground_alone_;  ///< nothing but it is wanted in the mesh
  GroundFiles<TerrainCell> cells_;
  std::int64_t edge_;  ///< cells of a brick
  BlockAxis u_, v_;
  std::array<std::int32_t, 2> first_ = {0, 0};  ///< brick column
  std::int64_t width_ = 0, height_ = 0;         ///< of the scene, brick columns
  std::set<std::pair<std::int64_t, std::int64_t>> blocks_;
  std::vector<std::pair<std::int64_t, std::int64_t>> tasks_;  ///< blocks by (v, u)
};

}  // namespace

std::uint64_t ground_task_bytes(const GroundSetup& setup, std::int64_t width, std::int64_t height) {
  const std::int64_t cells = BlockAxis(setup, width).largest() * BlockAxis(setup, height).largest();
  return static_cast<std::uint64_t>(cells) * kTerrainCellBytes + DirectFile::kDefaultBuffer +
         kTerrainFixedBytes;
}

std::uint64_t ground_finish_bytes(std::uint64_t columns) {
  return GroundFiles<TerrainNode>::bytes(columns) + (std::uint64_t{1} << 20);
}

std::uint64_t ground_tasks(const GroundSetup& setup, std::int64_t width, std::int64_t height) {
  return static_cast<std::uint64_t>(BlockAxis(setup, width).blocks() * BlockAxis(setup, height).blocks());
}

std::unique_ptr<Stage> make_ground_stage(const JobState& state) {
  return std::make_unique<GroundStage>(state);
}

namespace {

constexpr double kGroundTime = 0.012;  ///< microseconds a byte of its blocks

}  // namespace

StageForecast forecast_ground(const PlannedScan& scan) {
  if (!scan.columns) return idle_forecast();
  const GroundSetup setup = ground_setup(scan.options, scan.plan);
  const std::uint64_t columns = scan.columns->points.size();
  const auto edge = static_cast<std::uint64_t>(kBrickCells / setup.cell_columns);
  const std::uint64_t tasks = ground_tasks(setup, scan.columns->width, scan.columns->height);
  const std::uint64_t block = ground_task_bytes(setup, scan.columns->width, scan.columns->height);
  const std::uint64_t nodes = columns * (edge + 2) * (edge + 2) * sizeof(TerrainNode);
  return {.tasks = tasks,
          .task_bytes = block,
          .finish_bytes = ground_finish_bytes(columns),
          .sure_bytes = block,
          .disk_bytes = nodes,
          .files = tasks,
          .processor_us = static_cast<double>(tasks * block) * kGroundTime,
          .moved_bytes = static_cast<double>(columns * edge * edge * sizeof(TerrainCell) + nodes)};
}

}  // namespace tessera
