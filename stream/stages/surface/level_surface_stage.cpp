#include "stream/stages/surface/level_surface_stage.h"

#include <algorithm>
#include <array>
#include <vector>

#include "kernels/extract/extended_marching_cubes.h"
#include "stream/files/json.h"
#include "stream/files/task_files.h"
#include "stream/points/normal_sample.h"
#include "stream/points/plan.h"
#include "stream/points/point_overlay.h"
#include "stream/points/point_store.h"
#include "stream/points/reconstruct_options.h"
#include "stream/stages/plan/planned_scan.h"
#include "stream/stages/scan/normals_mode.h"
#include "stream/stages/surface/first_pass.h"
#include "stream/stages/surface/level_fields.h"
#include "stream/stages/surface/level_files.h"
#include "stream/stages/surface/surface_stage.h"

namespace tessera {
namespace {

/// Cells of the points' lattice: no part of a brick is loaded that is smaller.
constexpr int kLoadedEdge = 8;
// Per point: record and its arrays; the points of a brick and one below it as they are handed down; on a level, with
// normals of that level and neighbourhoods. Held by tests/tools/caps_test.
constexpr std::uint64_t kLevelBytesPerPoint = 40 + 28 + 28 + 28 + 120;
/// Leaves of 8^3 nodes of one brick, those shared with other levels too, and what becomes of them.
constexpr std::uint64_t kBytesPerLeaf = 32'000;
constexpr std::uint64_t kMaxLeaves = 2000;
constexpr std::uint64_t kMaxBrickFaces = std::uint64_t{1} << 16;  ///< of one brick
constexpr std::uint64_t kLevelFixedBytes = std::uint64_t{16} << 20;

class LevelSurfaceStage : public Stage {
 public:
  explicit LevelSurfaceStage(const JobState& state)
      : state_(state),
        options_(reconstruct_options(state)),
        levels_(static_cast<int>(options_.levels)),
        plan_(Plan::of_work(state.work)),
        store_(PointStore::of_surface(state.work)),
        tree_(level_tree_of_work(state.work, levels_)),
        maker_(levels_, field_options(plan_, options_.feature_angle_deg), normal_options(plan_),
               NormalsMode(options_, state.inputs.size(), plan_, agreement_of_work(state.work)).estimate),
        extract_(extract_options(options_, true)) {
    TilingOptions tiling;
    tiling.halo_cells = maker_.halo();
    tiling.tile_bricks = 1;
    groups_ = make_tile_groups(store_.bricks(), tiling);
    load_bytes_ = state.run.memory_bytes / 4 / static_cast<std::uint64_t>(state.run.threads);
  }

  std::string name() const override { return "surface"; }
  std::size_t task_count() const override { return groups_.size(); }
  std::uint64_t units() const override { return store_.point_count(); }
  std::string unit_name() const override { return "points"; }

  std::uint64_t task_bytes(std::size_t task) const override {
    std::uint64_t maximum = 0;
    for (const Tile& tile : groups_[task])
      maximum = std::max(maximum, loaded_points(tile.brick, levels_ - 1));
    return level_surface_task_bytes(maximum);
  }

  Json run(std::size_t task, TaskContext& context) const override {
    Work work{context, {state_, context, task}, {}};
    for (const Tile& tile : groups_[task]) {
      context.check_stop();
      visit(tile.brick, levels_ - 1, nullptr, work);
      const BrickEntry* brick = store_.find(brick_key(tile.brick));
      if (brick) context.advance(brick->points);
    }
    Json summary = {{"bricks", work.bricks},
                    {"faces_of_level", work.faces},
                    {"loops", work.report.loops},
                    {"crease_samples", work.report.crease_samples},
                    {"corner_samples", work.report.corner_samples},
                    {"flips", work.report.flips},
                    {"rejected_samples", work.report.rejected_samples}};
    summary["first_pass"] = work.pass.finish();
    return summary;
  }

  std::uint64_t finish_bytes() const override { return 1u << 20; }

  /// Bricks and faces by level, the finest first.
  Json finish(const std::vector<Json>& summaries, TaskContext&) const override {
    Json sum = {{"h", plan_.lattice.h},
                {"finest_h", finest_lattice(plan_.lattice, options_).h},
                {"radius_cells", plan_.radius_cells}};
    std::array<std::uint64_t, kMaxLevels> bricks{}, faces{};
    for (const Json& s : summaries) {
      for (std::size_t l = 0; l < kMaxLevels; ++l) {
        bricks[l] += s.at("bricks").at(l).get<std::uint64_t>();
        faces[l] += s.at("faces_of_level").at(l).get<std::uint64_t>();
      }
      for (const char* count : {"loops", "crease_samples", "corner_samples", "flips", "rejected_samples"})
        sum[count] = sum.value(count, std::uint64_t{0}) + s.at(count).get<std::uint64_t>();
    }
    const auto used = static_cast<std::ptrdiff_t>(levels_);
    sum["bricks"] = std::vector<std::uint64_t>(bricks.begin(), bricks.begin() + used);
    sum["faces_of_level"] = std::vector<std::uint64_t>(faces.begin(), faces.begin() + used);
    return sum;
  }

 private:
  static NormalOptions normal_options(const Plan& plan) {
    NormalOptions normals;
    normals.radius_cells = plan.radius_cells;
    return normals;
  }
  struct Work {
    TaskContext& context;
    FirstPass pass;
    ExtractReport report;
    std::array<std::uint64_t, kMaxLevels> bricks{}, faces{};
  };

  static Int3 times(const Int3& at, int by) { return {at[0] * by, at[1] * by, at[2] * by}; }
  std::uint64_t point_bound(const Int3& node, int level) const {
    const int e = maker_.edge(level);
    return store_.count_bound(times(node, e), {e, e, e}, maker_.halo());
  }
  bool is_leaf(const Int3& node, int level) const { return level == 0 || !tree_.is_split(node, level); }
  bool loads(const Int3& node, int level, std::uint64_t points) const {
    return points * kLevelBytesPerPoint <= load_bytes_ || maker_.edge(level) <= kLoadedEdge ||
           is_leaf(node, level);
  }
  static Int3 child(const Int3& node, int c) {
    return {2 * node[0] + (c & 1), 2 * node[1] + (c >> 1 & 1), 2 * node[2] + (c >> 2)};
  }

  /// Most points that visit() loads at once.
  std::uint64_t loaded_points(const Int3& node, int level) const {
    const std::uint64_t points = point_bound(node, level);
    if (points == 0 || loads(node, level, points)) return points;
    std::uint64_t maximum = 0;
    for (int c = 0; c < 8; ++c) maximum = std::max(maximum, loaded_points(child(node, c), level - 1));
    return maximum;
  }

  /// \param around  what holds the node's points; null: not loaded yet
  void visit(const Int3& node, int level, const PointBlock* around, Work& work) const {
    const int e = maker_.edge(level);
    PointBlock own;
    if (around) {
      const std::size_t points = count_part(*around, times(node, e), {e, e, e}, maker_.halo());
      if (points == 0) return;
      if (2 * points <= around->size()) {
        own = scaled_part(*around, 1, times(node, e), {e, e, e}, maker_.halo());
        around = &own;
      }
    } else {
      const std::uint64_t bound = point_bound(node, level);
      if (bound == 0) return;
      if (loads(node, level, bound)) {
        own = store_.load(times(node, e), {e, e, e}, maker_.halo());
        if (own.size() == 0) return;
        work.context.count_read(own.size() * sizeof(PointRecord));
        around = &own;
      }
    }
    if (is_leaf(node, level)) {
      extract(node, level, *around, work);
      return;
    }
    for (int c = 0; c < 8; ++c) visit(child(node, c), level - 1, around, work);
  }

  void extract(const Int3& leaf, int level, const PointBlock& around_points, Work& work) const {
    work.context.check_stop();
    LevelSurroundings around;
    around.step = tree_.steps_around(leaf, level);
    const LevelFields fields =
        maker_.fields_of(leaf, level, around, around_points, [&work] { work.context.check_stop(); });
    Patch patch = extract_level_brick(fields, around, level, extract_, work.report);
    if (patch.empty()) return;
    ++work.bricks[static_cast<std::size_t>(level)];
    work.faces[static_cast<std::size_t>(level)] += patch.faces.size();
    work.pass.add(patch);
  }

  JobState state_;
  ReconstructOptions options_;
  int levels_;
  Plan plan_;
  PointStore store_;
  LevelTree tree_;
  LevelFieldMaker maker_;
  ExtractOptions extract_;
  std::vector<TileGroup> groups_;
  std::uint64_t load_bytes_ = 0;
};

}  // namespace

double expected_level_faces(const Plan& plan, const ReconstructOptions& options) {
  const auto one = static_cast<double>(plan.faces_estimate);
  if (!options.has_levels()) return one;
  return std::max(one, std::min(one * static_cast<double>(std::uint64_t{1} << 2 * (options.levels - 1)),
                                2.0 * static_cast<double>(plan.points())));
}

std::uint64_t max_points_near(std::span<const BrickEntry> bricks) {
  std::uint64_t maximum = 0;
  for (const BrickEntry& brick : bricks) {
    const Int3 at = brick_of_key(brick.key);
    std::uint64_t points = 0;
    for (int d = 0; d < 27; ++d) {
      const Int3 n = {at[0] + d % 3 - 1, at[1] + d / 3 % 3 - 1, at[2] + d / 9 - 1};
      if (n[0] < 0 || n[1] < 0 || n[2] < 0) continue;
      if (const BrickEntry* e = find_brick(bricks, brick_key(n)))
        points += d == 13 ? e->points : e->points / 4;
    }
    maximum = std::max(maximum, points);
  }
  return maximum;
}

std::uint64_t level_surface_task_bytes(std::uint64_t points) {
  const std::uint64_t leaves = std::min(kMaxLeaves, 27 * points);
  const std::uint64_t faces = std::min(kMaxBrickFaces, 64 * leaves);
  return points * kLevelBytesPerPoint + leaves * kBytesPerLeaf + FirstPass::bytes(2 * faces, faces) +
         kLevelFixedBytes;
}

std::unique_ptr<Stage> make_level_surface_stage(const JobState& state) {
  return std::make_unique<LevelSurfaceStage>(state);
}

StageForecast forecast_level_surface(const PlannedScan& scan) {
  return all_sure(
      {.tasks = scan.groups.size(),
       .task_bytes = level_surface_task_bytes(max_points_near(scan.bricks)),
       .disk_bytes = scan.surface_bytes,
       .files = scan.groups.size(),
       .processor_us = scan.faces * surface_face_time(scan),
       .moved_bytes = static_cast<double>(scan.store_bytes + scan.overlay_bytes + scan.surface_bytes)});
}

}  // namespace tessera
