#include "stream/stages/scan/top_stage.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <utility>
#include <vector>

#include "kernels/points/surface_model.h"
#include "stream/files/json.h"
#include "stream/files/task_files.h"
#include "stream/points/point_overlay.h"
#include "stream/points/point_sort.h"
#include "stream/points/point_store.h"
#include "stream/points/reconstruct_options.h"
#include "stream/points/top_store.h"

namespace tessera {
namespace {

/// Layers, the model and the rasters of its filters, a column; a brick's block of points.
constexpr std::uint64_t kModelColumnBytes = sizeof(ColumnLayers) + 35 + 12 * 8;
constexpr std::uint64_t kBlockPointBytes = 42;
constexpr std::uint64_t kTopFixedBytes = 12u << 20;
/// Samples a column while they are put in order: steps between columns are few; a skin of a forest has five a column.
constexpr std::uint64_t kColumnSampleBytes = 3 * sizeof(PointRecord);
constexpr std::uint64_t kSkinColumnBytes = 12 * sizeof(PointRecord);

/// Cosine with up up to which a surface stands steep.
constexpr float kSteepCosine = 0.5f;

/// Bricks of a brick column, from its point store.
using BrickColumns = std::map<std::pair<int, int>, std::vector<std::size_t>>;

class TopStage : public Stage {
 public:
  explicit TopStage(const JobState& state)
      : axes_(ViewAxes::along(reconstruct_options(state).up.value_or(Double3{0, 0, 1}))),
        use_(reconstruct_options(state).surface == "top" ? ModelUse::kSkin : ModelUse::kStandIn) {
    auto overlay = PointOverlay::open(state.work);
    if (!overlay || overlay->volumetric() != VolumetricUse::kTop) return;
    store_ = std::make_unique<PointStore>(list_task_files(state.work / kScanPointFolder, kPointExtension),
                                          overlay);
    for (std::size_t b = 0; b < store_->bricks().size(); ++b) {
      const Int3 at = brick_of_key(store_->bricks()[b].key);
      columns_[{at[axes_.u], at[axes_.v]}].push_back(b);
    }
    edge_ = top_group_columns(state.run, use_);
    for (const auto& [at, bricks] : columns_) groups_.emplace_back(at.first / edge_, at.second / edge_);
    std::sort(groups_.begin(), groups_.end());
    groups_.erase(std::unique(groups_.begin(), groups_.end()), groups_.end());
  }

  std::string name() const override { return "top"; }
  std::size_t task_count() const override { return groups_.size(); }
  std::uint64_t units() const override { return columns_.size(); }
  std::string unit_name() const override { return "brick columns"; }

  std::uint64_t task_bytes(std::size_t task) const override {
    std::uint64_t fullest = 0, brick = 0;
    for_columns(task, [&](int, int, const std::vector<std::size_t>& bricks) {
      std::uint64_t points = 0;
      for (const std::size_t b : bricks) {
        points += store_->bricks()[b].points;
        brick = std::max(brick, store_->bricks()[b].points);
      }
      fullest = std::max(fullest, points);
    });
    return top_task_bytes(edge_, fullest, brick, use_);
  }

  Json run(std::size_t task, TaskContext& context) const override {
    const int gu = groups_[task].first * edge_ - 1, gv = groups_[task].second * edge_ - 1;
    const int raster = (edge_ + 2) * kBrickCells;
    SurfaceModel model;
    {
      std::vector<ColumnLayers> layers(static_cast<std::size_t>(raster) * static_cast<std::size_t>(raster));
      std::vector<ColumnLayers> column(std::size_t{kBrickCells} * kBrickCells);
      for_columns(task, [&](int u, int v, const std::vector<std::size_t>& bricks) {
        context.check_stop();
        std::fill(column.begin(), column.end(), ColumnLayers{});
        std::vector<ColumnPoint> points = load(bricks, context);
        find_column_layers(points, column);
        for (int row = 0; row < kBrickCells; ++row)
          std::copy_n(column.begin() + row * kBrickCells, kBrickCells,
                      layers.begin() + ((v - gv) * kBrickCells + row) * raster + (u - gu) * kBrickCells);
        if (is_core(u - gu) && is_core(v - gv)) context.advance(1);
      });
      context.check_stop();
      model = fit_surface_model(layers, raster, use_);
    }
    context.check_stop();
    TopFileWriter writer(
        context.create(std::string(TopStore::kFolder) + "/" + task_file_stem(task) + TopStore::kExtension));
    Json summary = write(model, gu, gv, writer);
    context.count_written(writer.finish());
    return summary;
  }

  std::uint64_t finish_bytes() const override { return 1u << 20; }

  Json finish(const std::vector<Json>& summaries, TaskContext&) const override {
    if (!store_) return {{"needed", false}};
    Json sum = {{"needed", true}, {"columns", 0}, {"filled_columns", 0}, {"samples", 0}, {"step_samples", 0}};
    for (const Json& s : summaries)
      for (const auto& [key, value] : s.items())
        sum[key] = sum.at(key).get<std::uint64_t>() + value.get<std::uint64_t>();
    return sum;
  }

 private:
  bool is_core(int column) const { return column >= 1 && column <= edge_; }

  /// use(u, v, bricks) for the brick columns of a task and those around them.
  template <class Use>
  void for_columns(std::size_t task, const Use& use) const {
    const int u0 = groups_[task].first * edge_ - 1, v0 = groups_[task].second * edge_ - 1;
    for (int u = u0; u < u0 + edge_ + 2; ++u)
      for (int v = v0; v < v0 + edge_ + 2; ++v)
        if (const auto found = columns_.find({u, v}); found != columns_.end()) use(u, v, found->second);
  }

  std::vector<ColumnPoint> load(const std::vector<std::size_t>& bricks, TaskContext& context) const {
    std::vector<ColumnPoint> points;
    std::size_t count = 0;
    for (const std::size_t b : bricks) count += store_->bricks()[b].points;
    points.reserve(count);
    for (const std::size_t b : bricks) {
      const Int3 at = brick_of_key(store_->bricks()[b].key);
      const PointBlock block = store_->load({at[0] * kBrickCells, at[1] * kBrickCells, at[2] * kBrickCells},
                                            {kBrickCells, kBrickCells, kBrickCells}, 0, {.flags = true});
      const std::array<const std::vector<float>*, 3> position = {&block.x, &block.y, &block.z};
      const std::array<const std::vector<float>*, 3> normal = {&block.nx, &block.ny, &block.nz};
      const std::vector<float>&pu = *position[axes_.u], &pv = *position[axes_.v], &pt = *position[axes_.up];
      const std::int32_t base = at[axes_.up] * kBrickCells * kQuantaPerCell;
      for (std::size_t i = 0; i < block.size(); ++i) {
        ColumnPoint p;
        p.column =
            static_cast<std::uint16_t>(static_cast<int>(pv[i]) * kBrickCells + static_cast<int>(pu[i]));
        p.volumetric = (block.flags[i] & kPointVolumetric) != 0;
        const auto across = [&](std::size_t axis) {
          return static_cast<std::int8_t>((*normal[axis])[i] * 127.0f);
        };
        p.normal_u = across(axes_.u), p.normal_v = across(axes_.v);
        p.steep = !p.volumetric && std::fabs((*normal[axes_.up])[i]) < kSteepCosine;
        p.height = axes_.sign * (base + static_cast<std::int32_t>(pt[i] * kQuantaPerCell));
        p.rgba = block.rgba.empty() ? 0 : block.rgba[i];
        points.push_back(p);
      }
      context.count_read(block.size() * sizeof(PointRecord));
      context.check_stop();
    }
    return points;
  }

  Json write(const SurfaceModel& model, int gu, int gv, TopFileWriter& writer) const {
    std::uint64_t stands = 0, filled = 0, samples = 0, steps = 0;
    for (int u = 1; u <= edge_; ++u)
      for (int v = 1; v <= edge_; ++v) {
        std::vector<ModelColumn> columns(std::size_t{kBrickCells} * kBrickCells);
        bool any = false;
        for (int row = 0; row < kBrickCells; ++row)
          for (int k = 0; k < kBrickCells; ++k) {
            const std::size_t i = model.at(u * kBrickCells + k, v * kBrickCells + row);
            if (model.flags[i] == 0) continue;
            any = true;
            stands += (model.flags[i] & kModelStands) != 0;
            filled += (model.flags[i] & kModelFilled) != 0;
            ModelColumn& c = columns[static_cast<std::size_t>(row * kBrickCells + k)];
            c.height = model.height[i], c.flags = model.flags[i], c.foot = model.foot[i];
            c.reach = static_cast<std::uint32_t>(model.reach(i));
          }
        if (!any) continue;
        Int3 at = {0, 0, 0};
        at[axes_.u] = gu + u, at[axes_.v] = gv + v;
        writer.model(brick_key(at), columns);
      }
    std::map<std::uint64_t, std::vector<PointRecord>> bricks;
    sample_surface_model(model, kBrickCells, (edge_ + 1) * kBrickCells, [&](const ModelSample& m) {
      PointRecord r;
      r.q[axes_.u] = gu * kBrickCells * kQuantaPerCell + m.u;
      r.q[axes_.v] = gv * kBrickCells * kQuantaPerCell + m.v;
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
    return {{"columns", stands}, {"filled_columns", filled}, {"samples", samples}, {"step_samples", steps}};
  }

  ViewAxes axes_;
  ModelUse use_;
  int edge_ = 0;                       ///< brick columns of a task along an edge
  std::unique_ptr<PointStore> store_;  ///< null where no top surface is wanted
  BrickColumns columns_;
  std::vector<std::pair<int, int>> groups_;
};

}  // namespace

int top_group_columns(const RunOptions& run, ModelUse use) {
  // As many as the cap allows: the context around them is fitted once more.
  int edge = 8;
  while (edge > 1 &&
         top_task_bytes(edge, 0, 0, use) > run.memory_bytes / 4 / static_cast<std::uint64_t>(run.threads))
    edge /= 2;
  return edge;
}

std::uint64_t top_task_bytes(int group_columns, std::uint64_t column_points, std::uint64_t brick_points,
                             ModelUse use) {
  const auto square = [](int bricks) {
    const auto columns = static_cast<std::uint64_t>(bricks * kBrickCells);
    return columns * columns;
  };
  return square(group_columns + 2) * kModelColumnBytes +
         square(group_columns) * (use == ModelUse::kSkin ? kSkinColumnBytes : kColumnSampleBytes) +
         column_points * sizeof(ColumnPoint) + brick_points * kBlockPointBytes + kTopFixedBytes;
}

std::unique_ptr<Stage> make_top_stage(const JobState& state) {
  return std::make_unique<TopStage>(state);
}

}  // namespace tessera
