#include "stream/stages/scan/top_stage.h"

#include <algorithm>
#include <map>
#include <set>
#include <utility>
#include <vector>

#include "kernels/points/surface_model.h"
#include "kernels/points/terrain.h"
#include "stream/files/json.h"
#include "stream/files/task_files.h"
#include "stream/points/ground_store.h"
#include "stream/points/point_sort.h"
#include "stream/points/reconstruct_options.h"
#include "stream/points/top_store.h"
#include "stream/runtime/task_counts.h"
#include "stream/stages/plan/planned_scan.h"
#include "stream/stages/scan/brick_columns.h"
#include "stream/stages/scan/ground_stages.h"

namespace tessera {
namespace {

/// Layers, the model and the rasters of its filters, a column.
constexpr std::uint64_t kModelColumnBytes = 2 * sizeof(ColumnLayers) + 35 + 12 * 8;
constexpr std::uint64_t kTopFixedBytes = 12u << 20;
/// Samples a column while they are put in order: steps between columns are few; a skin of a forest has five a column.
constexpr std::uint64_t kColumnSampleBytes = 3 * sizeof(PointRecord);
constexpr std::uint64_t kSkinColumnBytes = 12 * sizeof(PointRecord);

class TopStage : public Stage {
 public:
  explicit TopStage(const JobState& state)
      : columns_(state),
        axes_(columns_.axes()),
        use_(model_use(reconstruct_options(state))),
        edge_(top_group_columns(state.run, use_)) {
    if (!columns_.wanted()) return;
    const auto add = [&](int u, int v) { groups_.emplace_back(u / edge_, v / edge_); };
    for (const auto& [at, bricks] : columns_.bricks()) add(at.first, at.second);
    if (use_ == ModelUse::kGround || use_ == ModelUse::kCleared) {
      ground_ = std::make_unique<GroundFiles<TerrainNode>>(open_ground(state.work));
      rules_ = ground_setup(state).rules;
      for (const std::uint64_t key : ground_->keys()) {
        const Int3 at = brick_of_key(key);
        add(at[axes_.u], at[axes_.v]);
      }
    }
    std::sort(groups_.begin(), groups_.end());
    groups_.erase(std::unique(groups_.begin(), groups_.end()), groups_.end());
  }

  std::string name() const override { return "top"; }
  std::size_t task_count() const override { return groups_.size(); }
  std::uint64_t units() const override { return columns_.bricks().size(); }
  std::string unit_name() const override { return "brick columns"; }

  std::uint64_t task_bytes(std::size_t task) const override {
    const int u = groups_[task].first * edge_ - 1, v = groups_[task].second * edge_ - 1;
    const BrickColumns::Fullest fullest = columns_.fullest(u, u + edge_ + 2, v, v + edge_ + 2);
    return top_task_bytes(edge_, fullest.column, fullest.brick, use_);
  }

  Json run(std::size_t task, TaskContext& context) const override {
    const Window w = window(groups_[task].first * edge_, groups_[task].second * edge_);
    const int raster = (w.edge + 2) * kBrickCells;
    SurfaceModel model;
    {
      std::vector<ColumnLayers> layers(static_cast<std::size_t>(raster) * static_cast<std::size_t>(raster));
      std::vector<ColumnLayers> column(std::size_t{kBrickCells} * kBrickCells);
      for (int u = 0; u < w.edge + 2; ++u)
        for (int v = 0; v < w.edge + 2; ++v) {
          context.check_stop();
          if (!is_known(w.u + u, w.v + v)) continue;
          std::fill(column.begin(), column.end(), ColumnLayers{});
          find_layers(w.u + u, w.v + v, column, context);
          for (int row = 0; row < kBrickCells; ++row)
            std::copy_n(column.begin() + row * kBrickCells, kBrickCells,
                        layers.begin() + (v * kBrickCells + row) * raster + u * kBrickCells);
          const bool core = u >= 1 && v >= 1 && u <= w.edge && v <= w.edge;
          if (core && columns_.bricks().count({w.u + u, w.v + v}) > 0) context.advance(1);
        }
      context.check_stop();
      if (ground_) follow_measured(layers, raster);
      model = fit_surface_model(layers, raster, use_);
    }
    context.check_stop();
    TopFileWriter writer(
        context.create(std::string(TopStore::kFolder) + "/" + task_file_stem(task) + TopStore::kExtension));
    Json summary = write(model, w, writer);
    context.count_written(writer.finish());
    return summary;
  }

  std::uint64_t finish_bytes() const override { return 1u << 20; }

  Json finish(const std::vector<Json>& summaries, TaskContext&) const override {
    if (!columns_.wanted()) return {{"needed", false}};
    return sum_counts(summaries, {{"needed", true},
                                  {"skin_columns", 0},
                                  {"columns", 0},
                                  {"cleared_columns", 0},
                                  {"filled_columns", 0},
                                  {"samples", 0},
                                  {"step_samples", 0}});
  }

 private:
  /// A square of brick columns, with a rim one wide around those whose model it is for.
  struct Window {
    int u, v;  ///< of the corner of the rim
    int edge;  ///< without it
  };

  /// Whether points or the ground tell anything of a brick column.
  bool is_known(int u, int v) const {
    return columns_.bricks().count({u, v}) > 0 || (ground_ && ground_->has(columns_.key(u, v)));
  }

  /// Of a group the part that has all that is known in it, and around it: nothing is filled beyond that.
  Window window(int u, int v) const {
    int low_u = edge_, high_u = -1, low_v = edge_, high_v = -1;
    for (int du = -1; du <= edge_; ++du)
      for (int dv = -1; dv <= edge_; ++dv) {
        if (!is_known(u + du, v + dv)) continue;
        low_u = std::min(low_u, du), high_u = std::max(high_u, du);
        low_v = std::min(low_v, dv), high_v = std::max(high_v, dv);
      }
    low_u = std::max(low_u, 0), high_u = std::min(high_u, edge_ - 1);
    low_v = std::max(low_v, 0), high_v = std::min(high_v, edge_ - 1);
    const int edge = std::max(high_u - low_u, high_v - low_v) + 1;
    return {u + std::min(low_u, edge_ - edge) - 1, v + std::min(low_v, edge_ - edge) - 1, edge};
  }

  BrickTerrain terrain(int u, int v) const { return {ground_->load(columns_.key(u, v)), rules_}; }

  void find_layers(int u, int v, std::vector<ColumnLayers>& layers, TaskContext& context) const {
    std::vector<ColumnPoint> points = columns_.load(u, v, context);
    if (!ground_)
      find_column_layers(points, layers);
    else if (const BrickTerrain below = terrain(u, v); below.known())
      (use_ == ModelUse::kCleared ? find_cleared_layers : find_ground_layers)(points, below, layers);
  }

  Json write(const SurfaceModel& model, const Window& w, TopFileWriter& writer) const {
    std::uint64_t skin = 0, stands = 0, cleared = 0, filled = 0, samples = 0, steps = 0;
    for (int u = 1; u <= w.edge; ++u)
      for (int v = 1; v <= w.edge; ++v) {
        std::vector<ModelColumn> columns(std::size_t{kBrickCells} * kBrickCells);
        bool any = false;
        for (int row = 0; row < kBrickCells; ++row)
          for (int k = 0; k < kBrickCells; ++k) {
            const std::size_t i = model.at(u * kBrickCells + k, v * kBrickCells + row);
            if (model.flags[i] == 0) continue;
            any = true;
            skin += (model.flags[i] & kModelSkin) != 0;
            stands += (model.flags[i] & kModelStands) != 0;
            cleared += (model.flags[i] & kModelCleared) != 0;
            filled += (model.flags[i] & kModelFilled) != 0;
            ModelColumn& c = columns[static_cast<std::size_t>(row * kBrickCells + k)];
            c.height = model.height[i], c.flags = model.flags[i], c.foot = model.foot[i];
            c.reach = static_cast<std::uint32_t>(model.reach(i));
          }
        if (!any) continue;
        if (use_ == ModelUse::kGround) narrow_reach(w.u + u, w.v + v, columns);
        writer.model(columns_.key(w.u + u, w.v + v), columns);
      }
    std::map<std::uint64_t, std::vector<PointRecord>> bricks;
    sample_surface_model(model, kBrickCells, (w.edge + 1) * kBrickCells, [&](const ModelSample& m) {
      PointRecord r;
      r.q[axes_.u] = w.u * kBrickCells * kQuantaPerCell + m.u;
      r.q[axes_.v] = w.v * kBrickCells * kQuantaPerCell + m.v;
      r.q[axes_.up] = axes_.sign * m.height;
      Float3 n = {};
      n[axes_.u] = m.normal[0], n[axes_.v] = m.normal[1];
      n[axes_.up] = static_cast<float>(axes_.sign) * m.normal[2];
      r.normal = encode_normal(n[0], n[1], n[2]);
      r.rgba = m.rgba;
      r.flags = static_cast<std::uint16_t>(kPointSynthetic | (m.unseen ? kPointUnseen : 0));
      constexpr int kShift = kBrickBits + kQuantumBits;
      bricks[brick_key({r.q[0] >> kShift, r.q[1] >> kShift, r.q[2] >> kShift})].push_back(r);
      ++samples;
      steps += m.step;
    });
    BrickSorter sorter;
    for (const auto& [key, records] : bricks) {
      const std::span<const PointRecord> sorted = sorter.sort(records);
      writer.samples(key, {sorted.begin(), sorted.end()});
    }
    return {{"skin_columns", skin},     {"columns", stands},  {"cleared_columns", cleared},
            {"filled_columns", filled}, {"samples", samples}, {"step_samples", steps}};
  }

  /// Points of a column lie on ground no farther from it than those that told it.
  void narrow_reach(int u, int v, std::vector<ModelColumn>& columns) const {
    const BrickTerrain below = terrain(u, v);
    for (int row = 0; row < kBrickCells && below.known(); ++row)
      for (int k = 0; k < kBrickCells; ++k) {
        std::uint32_t& reach = columns[static_cast<std::size_t>(row * kBrickCells + k)].reach;
        reach = static_cast<std::uint32_t>(std::min<double>(reach, below.at(k, row).tolerance));
      }
  }

  BrickColumns columns_;
  ViewAxes axes_;
  ModelUse use_;
  int edge_;                                          ///< brick columns of a task along an edge
  std::unique_ptr<GroundFiles<TerrainNode>> ground_;  ///< null where the ground is not what is wanted
  GroundRules rules_;
  std::vector<std::pair<int, int>> groups_;
};

}  // namespace

int top_group_columns(const RunOptions& run, ModelUse use) {
  // The context around a task is fitted once more, so wide ones cost less, as long as enough of them fit side by side.
  const auto seconds = [&](int edge) {
    const std::uint64_t fit = run.memory_bytes * 3 / 4 / top_task_bytes(edge, 0, 0, use);
    const double beside = std::clamp(static_cast<double>(fit), 1.0, static_cast<double>(run.threads));
    const double around = static_cast<double>(edge + 2) / edge;
    return around * around / beside;
  };
  int best = 1;
  // A quarter of the cap is left to what the points of a column take.
  for (int edge = 2; edge <= 8 && top_task_bytes(edge, 0, 0, use) <= run.memory_bytes / 4; edge *= 2)
    if (seconds(edge) < seconds(best)) best = edge;
  return best;
}

std::uint64_t top_task_bytes(int group_columns, std::uint64_t column_points, std::uint64_t brick_points,
                             ModelUse use) {
  const auto square = [](int bricks) {
    const auto columns = static_cast<std::uint64_t>(bricks * kBrickCells);
    return columns * columns;
  };
  return square(group_columns + 2) * kModelColumnBytes +
         square(group_columns) * (is_skin(use) ? kSkinColumnBytes : kColumnSampleBytes) +
         2 * column_points * sizeof(ColumnPoint) + BrickColumns::load_bytes(brick_points) + kTopFixedBytes;
}

ModelUse model_use(const ReconstructOptions& options) {
  return options.surface == "ground" ? ModelUse::kGround
         : options.surface == "top"  ? ModelUse::kSkin
         : options.clears_ground()   ? ModelUse::kCleared
                                     : ModelUse::kStandIn;
}

std::unique_ptr<Stage> make_top_stage(const JobState& state) {
  return std::make_unique<TopStage>(state);
}

namespace {

constexpr double kTopTime = 0.4;  ///< microseconds a point
// On disk, a point: model and samples, of a forest and of a skin.
constexpr double kForestBytes = 10.0, kSkinBytes = 18.0;

}  // namespace

StageForecast forecast_top(const PlannedScan& scan) {
  if (!scan.columns) return idle_forecast();
  const ModelUse use = model_use(scan.options);
  const int edge = top_group_columns(scan.run, use);
  std::set<std::pair<int, int>> groups;
  for (const auto& [at, n] : scan.columns->points) groups.emplace(at.first / edge, at.second / edge);
  const double used = scan.columns->look_closed() ? 0.0 : 1.0;  // told with its memory, but not done in rooms
  return {.tasks = groups.size(),
          .task_bytes = top_task_bytes(edge, scan.columns->fullest, scan.largest_brick, use),
          .disk_bytes = bytes_of(scan.points, is_skin(use) ? kSkinBytes : kForestBytes),
          .files = groups.size(),
          .processor_us = used * scan.points * kTopTime,
          .moved_bytes = used * static_cast<double>(scan.store_bytes + scan.overlay_bytes)};
}

}  // namespace tessera
