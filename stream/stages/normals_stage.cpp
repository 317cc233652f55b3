#include "stream/stages/normals_stage.h"

#include <algorithm>
#include <nlohmann/json.hpp>

#include "kernels/normals.h"
#include "octree/error.h"
#include "stream/direct_file.h"
#include "stream/plan.h"
#include "stream/point_overlay.h"
#include "stream/point_store.h"
#include "stream/stages/normals_mode.h"
#include "stream/task_files.h"

namespace tessera {
namespace {

using json = nlohmann::json;

// Block of one brick: 40 bytes a point while loading, then shape, overlay record, candidates.
constexpr std::uint64_t kBytesPerPoint = 40 + 28 + 8 + 48;
constexpr std::uint64_t kFixedTaskBytes = 12u << 20;

/// Who decides the sign of a point.
struct SignCounts {
  std::uint64_t given = 0;
  std::uint64_t sensor = 0;
  std::uint64_t up = 0;
  std::uint64_t propagated = 0;
  std::uint64_t none = 0;  ///< too few neighbours for a plane
};

class NormalsStage : public Stage {
 public:
  explicit NormalsStage(const JobState& state)
      : plan_(Plan::of_work(state.work)),
        mode_(state.options, plan_),
        store_(list_task_files(state.work / "points", ".tsp")),
        options_(state.options) {
    shape_.radius_cells = plan_.radius_cells;
    shape_.estimate = mode_.estimate;
    if (!mode_.needed()) return;
    std::size_t file = 0;
    for (std::size_t b = 0; b < store_.bricks().size(); ++b) {
      file = store_.bricks()[b].file;
      if (file + 1 > file_end_.size()) file_end_.resize(file + 1, b);
      file_end_[file] = b + 1;
    }
  }

  std::string name() const override { return "normals"; }
  std::size_t task_count() const override { return file_end_.size(); }
  std::uint64_t units() const override { return mode_.needed() ? store_.point_count() : 0; }
  std::string unit_name() const override { return "points"; }

  std::uint64_t task_bytes(std::size_t task) const override {
    std::uint64_t most = 0;
    for (std::size_t b = first_brick(task); b < file_end_[task]; ++b) {
      const Int3 at = brick_of_key(store_.bricks()[b].key);
      std::uint64_t points = 0;
      for (int d = 0; d < 27; ++d) {
        const Int3 n = {at[0] + d % 3 - 1, at[1] + d / 3 % 3 - 1, at[2] + d / 9 - 1};
        if (n[0] < 0 || n[1] < 0 || n[2] < 0) continue;
        const BrickEntry* e = store_.find(brick_key(n));
        // A neighbour lends at most the eighth of its blocks that touch the face.
        if (e) points += d == 13 ? e->points : e->points / 4;
      }
      most = std::max(most, points);
    }
    return most * kBytesPerPoint + kFixedTaskBytes;
  }

  json run(std::size_t task, TaskContext& context) const override {
    OverlayFileWriter writer(
        context.create(std::string(PointOverlay::kFolder) + "/" + task_file_stem(task) + PointOverlay::kExtension));
    SignCounts counts;
    std::vector<std::uint64_t> histogram(kSupporterBins, 0);
    for (std::size_t b = first_brick(task); b < file_end_[task]; ++b) {
      context.check_stop();
      const BrickEntry& brick = store_.bricks()[b];
      const Int3 at = brick_of_key(brick.key);
      const Int3 origin = {at[0] * kBrickCells, at[1] * kBrickCells, at[2] * kBrickCells};
      prefetch(task, b);
      const PointBlock block = store_.load(origin, {kBrickCells, kBrickCells, kBrickCells},
                                           normal_halo_cells(shape_), mode_.estimate && mode_.by_sensor);
      const std::vector<PointShape> shapes = estimate_shapes(block, shape_);
      process_brick(brick, origin, block, shapes, writer, counts, histogram);
      context.count_read(block.size() * sizeof(PointRecord));
      context.advance(brick.points);
    }
    context.count_written(writer.finish());
    return {{"given", counts.given},   {"sensor", counts.sensor}, {"up", counts.up}, {"propagated", counts.propagated},
            {"without", counts.none}, {"supporters", histogram}};
  }

  std::uint64_t finish_bytes() const override { return 1u << 20; }

  json finish(const std::vector<json>& summaries, TaskContext& context) const override {
    json sum = {{"estimated", mode_.estimate}, {"needed", mode_.needed()}};
    std::vector<std::uint64_t> histogram(kSupporterBins, 0);
    for (const json& s : summaries)
      for (const auto& [key, value] : s.items()) {
        if (key != "supporters") {
          sum[key] = sum.value(key, std::uint64_t{0}) + value.get<std::uint64_t>();
          continue;
        }
        for (std::size_t i = 0; i < kSupporterBins; ++i) histogram[i] += value[i].get<std::uint64_t>();
      }
    if (mode_.needed()) {
      DirectFile file(context.create(kSupportersFile));
      file.write(histogram.data(), histogram.size() * sizeof(histogram[0]));
      file.finish();
    }
    return sum;
  }

 private:
  std::size_t first_brick(std::size_t task) const { return task == 0 ? 0 : file_end_[task - 1]; }

  /// Keeps the disk a few bricks ahead.
  void prefetch(std::size_t task, std::size_t brick) const {
    constexpr std::size_t kAhead = 16;
    const std::size_t first = first_brick(task);
    for (std::size_t b = brick == first ? first : brick + kAhead; b < std::min(brick + kAhead + 1, file_end_[task]); ++b) {
      const Int3 at = brick_of_key(store_.bricks()[b].key);
      store_.prefetch({at[0] * kBrickCells, at[1] * kBrickCells, at[2] * kBrickCells},
                      {kBrickCells, kBrickCells, kBrickCells}, normal_halo_cells(shape_));
    }
  }

  void process_brick(const BrickEntry& brick, const Int3& origin, const PointBlock& block,
                     const std::vector<PointShape>& shapes, OverlayFileWriter& writer, SignCounts& counts,
                     std::vector<std::uint64_t>& histogram) const {
    if (shapes.size() != brick.points) throw std::logic_error("normals: a brick's block does not hold its points");
    std::vector<PointOverlayRecord> records(shapes.size());
    std::vector<Float3> position;
    std::vector<Float3> normal;
    if (mode_.propagate()) position.reserve(shapes.size()), normal.reserve(shapes.size());
    const auto core = [](float v) { return v >= 0.0f && v < kBrickCells; };
    std::size_t s = 0;
    for (std::size_t i = 0; i < block.size(); ++i) {
      if (!core(block.x[i]) || !core(block.y[i]) || !core(block.z[i])) continue;
      const PointShape& shape = shapes[s];
      Float3 n = shape.normal;
      const bool known = n[0] != 0.0f || n[1] != 0.0f || n[2] != 0.0f;
      if (!known) {
        ++counts.none;
      } else if (!mode_.estimate) {
        ++counts.given;
      } else if (mode_.by_sensor) {
        const std::uint16_t sensor = block.sensor.empty() ? std::uint16_t{kNoSensor} : block.sensor[i];
        const Double3 view = mode_.view(plan_, origin, {block.x[i], block.y[i], block.z[i]}, sensor);
        if (view[0] * double{n[0]} + view[1] * double{n[1]} + view[2] * double{n[2]} < 0.0) n = {-n[0], -n[1], -n[2]};
        ++counts.sensor;
      } else if (options_.has_up) {
        const Double3& u = options_.up;
        if (u[0] * double{n[0]} + u[1] * double{n[1]} + u[2] * double{n[2]} < 0.0) n = {-n[0], -n[1], -n[2]};
        ++counts.up;
      } else {
        ++counts.propagated;
      }
      if (mode_.propagate()) position.push_back({block.x[i], block.y[i], block.z[i]}), normal.push_back(n);
      records[s].normal = encode_normal(n[0], n[1], n[2]);
      records[s].supporters = shape.supporters;
      if (!mode_.estimate) records[s].patch = kGivenPatch;
      ++histogram[std::min<std::size_t>(records[s].supporters, kSupporterBins - 1)];
      ++s;
    }
    BrickOrientation orientation;
    if (mode_.propagate()) {
      orientation = orient_brick(position, normal);
      for (std::size_t i = 0; i < records.size(); ++i) {
        const Float3& n = orientation.normal[i];
        records[i].normal = encode_normal(n[0], n[1], n[2]);
        records[i].patch = orientation.patch[i];
      }
    }
    writer.brick(brick.key, records, orientation);
  }

  Plan plan_;
  NormalsMode mode_;
  PointStore store_;
  ReconstructOptions options_;
  NormalOptions shape_;
  std::vector<std::size_t> file_end_;
};

}  // namespace

std::unique_ptr<Stage> make_normals_stage(const JobState& state) { return std::make_unique<NormalsStage>(state); }

}  // namespace tessera
