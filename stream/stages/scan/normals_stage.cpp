#include "stream/stages/scan/normals_stage.h"

#include <fmt/format.h>
#include <algorithm>
#include <cmath>

#include "kernels/points/normals.h"
#include "kernels/points/volumetric_points.h"
#include "octree/error.h"
#include "stream/files/direct_file.h"
#include "stream/files/json.h"
#include "stream/files/task_files.h"
#include "stream/points/normal_sample.h"
#include "stream/points/plan.h"
#include "stream/points/point_overlay.h"
#include "stream/points/point_store.h"
#include "stream/points/reconstruct_options.h"
#include "stream/runtime/task_counts.h"
#include "stream/stages/plan/planned_scan.h"
#include "stream/stages/scan/normals_mode.h"

namespace tessera {
namespace {

// Block of one brick: 42 bytes a point while loading, candidates; of its own points shape, whether it is a candidate, overlay
// record, orientation.
constexpr std::uint64_t kBytesPerPoint = 42 + 55, kBytesPerOwnPoint = 28 + 4 + 8 + 64;
/// Cosine of the view from which a point's own sensor decides its sign alone.
constexpr float kSureView = 0.25f;
constexpr std::uint64_t kFixedTaskBytes = 12u << 20;

/// Who decides the sign of a point.
struct SignCounts {
  std::uint64_t given = 0;
  std::uint64_t sensor = 0;
  std::uint64_t patch = 0;
  std::uint64_t none = 0;  ///< too few neighbours for a plane
  // Of the points that a sensor decided, against given normals that were kept aside.
  std::uint64_t agree = 0;
  std::uint64_t disagree = 0;
  std::uint64_t compared = 0;           ///< points with both an estimated and a given normal
  std::uint64_t volumetric_points = 0;  ///< points that are strewn
  std::uint64_t tilted = 0;             ///< of these, more than 30 degrees apart whatever the sign
};

class NormalsStage : public Stage {
 public:
  explicit NormalsStage(const JobState& state)
      : plan_(Plan::of_work(state.work)),
        agreement_(agreement_of_work(state.work)),
        mode_(reconstruct_options(state), state.inputs.size(), plan_, agreement_),
        store_(list_task_files(state.work / kScanPointFolder, kPointExtension)) {
    shape_.radius_cells = plan_.radius_cells;
    shape_.estimate = mode_.estimate;
  }

  std::string name() const override { return "normals"; }
  std::size_t task_count() const override { return mode_.needed() ? store_.file_count() : 0; }
  std::uint64_t units() const override { return mode_.needed() ? store_.point_count() : 0; }
  std::string unit_name() const override { return "points"; }

  std::uint64_t task_bytes(std::size_t task) const override {
    const auto [first, last] = store_.file_range(task);
    return normals_task_bytes(store_.bricks(), first, last);
  }

  Json run(std::size_t task, TaskContext& context) const override {
    OverlayFileWriter writer(context.create(std::string(PointOverlay::kFolder) + "/" + task_file_stem(task) +
                                            PointOverlay::kExtension));
    SignCounts counts;
    std::vector<std::uint64_t> histogram(kSupporterBins, 0);
    const auto [first, last] = store_.file_range(task);
    for (std::size_t b = first; b < last; ++b) {
      context.check_stop();
      const BrickEntry& brick = store_.bricks()[b];
      const Int3 at = brick_of_key(brick.key);
      const Int3 origin = {at[0] * kBrickCells, at[1] * kBrickCells, at[2] * kBrickCells};
      prefetch(task, b);
      const PointBlock block =
          store_.load(origin, {kBrickCells, kBrickCells, kBrickCells}, normal_halo_cells(shape_),
                      {.sensor = mode_.estimate && mode_.by_sensor, .flags = mode_.airborne});
      const std::vector<PointShape> shapes = estimate_shapes(block, shape_);
      process_brick(brick, origin, block, shapes, writer, counts, histogram);
      context.count_read(block.size() * sizeof(PointRecord));
      context.advance(brick.points);
    }
    context.count_written(writer.finish());
    return {{"given", counts.given},       {"sensor", counts.sensor}, {"patch", counts.patch},
            {"without", counts.none},      {"agree", counts.agree},   {"disagree", counts.disagree},
            {"compared", counts.compared}, {"tilted", counts.tilted}, {"scattered", counts.volumetric_points},
            {"supporters", histogram}};
  }

  std::uint64_t finish_bytes() const override { return 1u << 20; }

  Json finish(const std::vector<Json>& summaries, TaskContext& context) const override {
    Json sum = sum_counts(summaries, {{"estimated", mode_.estimate}, {"needed", mode_.needed()}});
    std::vector<std::uint64_t> histogram(kSupporterBins, 0);
    for (const Json& s : summaries)
      for (std::size_t i = 0; i < kSupporterBins; ++i)
        histogram[i] += s.at("supporters").at(i).get<std::uint64_t>();
    if (mode_.keeps_given()) sum["kept"] = mode_.lines ? "directions" : "given";
    if (const std::string text = warning(); !text.empty()) sum["warnings"] = {text};
    if (mode_.needed()) {
      DirectFile file(context.create(kSupportersFile), std::size_t{1} << 16);
      histogram.push_back(sum.value("scattered", std::uint64_t{0}));
      file.write(histogram.data(), histogram.size() * sizeof(histogram[0]));
      file.finish();
    }
    return sum;
  }

 private:
  /// What is decided about given normals that cannot be taken as they are; empty where they can.
  std::string warning() const {
    const double percent = 100.0 * agreement_.share();
    if (mode_.conflict)
      return fmt::format(
          "the given normals have no common side: {:.2g} % of neighbours on one surface contradict each "
          "other{}; {}",
          percent, agreement_.split > kMaxSplits ? ", and whole regions are turned over" : "",
          mode_.lines
              ? "their directions are kept and their sides are found anew (--normals given takes them as "
                "they are)"
              : "they are taken as they are, as --normals given asks; --normals auto finds their sides anew");
    if (mode_.completes)
      return fmt::format(
          "{:.3g} % of the points have no normal: theirs are estimated, on the side of the given ones "
          "around them",
          100.0 * (1.0 - plan_.normal_fraction));
    return {};
  }

  /// Keeps the disk a few bricks ahead.
  void prefetch(std::size_t task, std::size_t brick) const {
    constexpr std::size_t kAhead = 16;
    const auto [first, last] = store_.file_range(task);
    for (std::size_t b = brick == first ? first : brick + kAhead; b < std::min(brick + kAhead + 1, last);
         ++b) {
      const Int3 at = brick_of_key(store_.bricks()[b].key);
      store_.prefetch({at[0] * kBrickCells, at[1] * kBrickCells, at[2] * kBrickCells},
                      {kBrickCells, kBrickCells, kBrickCells}, normal_halo_cells(shape_));
    }
  }

  void process_brick(const BrickEntry& brick, const Int3& origin, const PointBlock& block,
                     const std::vector<PointShape>& shapes, OverlayFileWriter& writer, SignCounts& counts,
                     std::vector<std::uint64_t>& histogram) const {
    if (shapes.size() != brick.points)
      throw std::logic_error("normals: a brick's block does not hold its points");
    std::vector<PointOverlayRecord> records(shapes.size());
    Oriented o;
    if (mode_.propagate()) o.resize(shapes.size(), !block.flags.empty());
    Normals normals(mode_.propagate() ? 0 : shapes.size());
    const auto core = [](float v) { return v >= 0.0f && v < kBrickCells; };
    std::size_t s = 0;
    for (std::size_t i = 0; i < block.size(); ++i) {
      if (!core(block.x[i]) || !core(block.y[i]) || !core(block.z[i])) continue;
      const PointShape& shape = shapes[s];
      const Float3 given = {block.nx[i], block.ny[i], block.nz[i]};
      const bool keeps = mode_.keeps_given() && given != Float3{};
      const Float3 n = keeps ? given : shape.normal;
      const bool known = n[0] != 0.0f || n[1] != 0.0f || n[2] != 0.0f;
      const bool decided = !mode_.estimate || (mode_.completes && keeps);
      ++(!known ? counts.none : decided ? counts.given : counts.patch);
      if (mode_.propagate()) {
        o.position[s] = {block.x[i], block.y[i], block.z[i]};
        o.roughness[s] = shape.roughness;
        if (!block.flags.empty()) o.flags[s] = block.flags[i];
        o.normal[s] = n;
        o.variation[s] = shape.variation;
        if (known) {
          if (!decided) o.given[s] = given;
          o.visible[s] = decided ? 1.0f : visibility(origin, block, i, n);
        }
      } else {
        normals.set(s, n);
        records[s].patch = kGivenPatch;
      }
      records[s].supporters = std::min<std::uint16_t>(shape.supporters, kSupporters);
      ++histogram[std::min<std::size_t>(records[s].supporters, kSupporterBins - 1)];
      ++s;
    }
    BrickOrientation orientation;
    if (mode_.propagate()) {
      compare(o, counts);
      const std::vector<std::uint8_t> volumetric = find_volumetric({o.position, o.roughness, o.flags});
      const std::vector<std::uint8_t> among =
          find_among_volumetric({o.position, o.roughness, o.flags}, volumetric);
      orientation = orient_brick({o.position, o.normal, o.variation, o.given, o.visible,
                                  mode_.each_seen() ? kSureView : kNeverSure});
      normals = Normals(records.size());  // in what orientation left
      for (std::size_t i = 0; i < records.size(); ++i) {
        if (among[i] != 0) records[i].supporters |= kAmongVolumetric;
        if (volumetric[i] != 0) {
          records[i].supporters |= kVolumetric, ++counts.volumetric_points;
          if (orientation.patch[i] < orientation.stats.size())
            ++orientation.stats[orientation.patch[i]].volumetric;
        }
        Float3 n = orientation.normal[i];
        records[i].patch = orientation.patch[i];
        if (sure(o.visible[i])) {
          n = o.normal[i];
          if (o.visible[i] < 0.0f) n = {-n[0], -n[1], -n[2]};
          records[i].patch = kNoPatch;
        }
        normals.set(i, n);
      }
    }
    normals.encode(records);
    writer.brick(brick.key, records, orientation);
  }

  /// The core points of a brick.
  struct Oriented {
    std::vector<Float3> position, normal, given;
    std::vector<float> variation, roughness, visible;
    std::vector<std::uint16_t> flags;  ///< empty where no returns are known
    void resize(std::size_t n, bool returns) {
      position.resize(n), normal.resize(n), given.resize(n), variation.resize(n), visible.resize(n);
      roughness.resize(n), flags.resize(returns ? n : 0);
    }
  };

  /// Of the records, to be encoded several at a time.
  class Normals {
   public:
    explicit Normals(std::size_t n) : x_(n), y_(n), z_(n), code_(n) {}
    void set(std::size_t i, const Float3& n) { x_[i] = n[0], y_[i] = n[1], z_[i] = n[2]; }
    void encode(std::vector<PointOverlayRecord>& records) {
      encode_normals(x_.data(), y_.data(), z_.data(), code_.size(), code_.data());
      for (std::size_t i = 0; i < records.size(); ++i) records[i].normal = code_[i];
    }

   private:
    std::vector<float> x_, y_, z_;
    std::vector<std::uint32_t> code_;
  };

  bool sure(float visible) const { return mode_.each_seen() && std::fabs(visible) >= kSureView; }

  /// Cosine between the normal and the way to the sensor, or up; 0 where neither is known.
  float visibility(const Int3& origin, const PointBlock& block, std::size_t i, const Float3& n) const {
    Double3 direction = mode_.up;
    if (mode_.by_sensor && !mode_.own_sensor) return 0.0f;  // the orient stage asks who is in sight
    if (mode_.by_sensor) {
      const std::uint16_t sensor = block.sensor.empty() ? std::uint16_t{kNoSensor} : block.sensor[i];
      direction = mode_.view(plan_, origin, {block.x[i], block.y[i], block.z[i]}, sensor);
    } else if (!mode_.by_up && !mode_.airborne) {
      return 0.0f;
    }
    const double length =
        std::sqrt(direction[0] * direction[0] + direction[1] * direction[1] + direction[2] * direction[2]);
    const double along =
        direction[0] * double{n[0]} + direction[1] * double{n[1]} + direction[2] * double{n[2]};
    return length > 0.0 ? static_cast<float>(along / length) : 0.0f;
  }

  /// Counts what the sensor decides alone, and how it and the axes agree with the given normals.
  void compare(Oriented& o, SignCounts& counts) const {
    for (std::size_t i = 0; i < o.normal.size(); ++i) {
      Float3& g = o.given[i];
      const Float3& n = o.normal[i];
      const float length = std::sqrt(g[0] * g[0] + g[1] * g[1] + g[2] * g[2]);
      const float along = g[0] * n[0] + g[1] * n[1] + g[2] * n[2];
      if (length > 0.0f) {
        ++counts.compared;
        counts.tilted += std::fabs(along) < 0.8660254f * length;
      }
      if (!sure(o.visible[i]) || (mode_.completes && length == 0.0f && o.visible[i] == 1.0f)) continue;
      ++counts.sensor;
      --counts.patch;
      if (length > 0.0f) ++(along * o.visible[i] < 0.0f ? counts.disagree : counts.agree);
      g = {0, 0, 0};
    }
  }

  Plan plan_;
  NormalAgreement agreement_;
  NormalsMode mode_;
  PointStore store_;
  NormalOptions shape_;
};

}  // namespace

std::uint64_t normals_task_bytes(std::span<const BrickEntry> bricks, std::size_t first, std::size_t last) {
  std::uint64_t maximum = 0;
  for (std::size_t b = first; b < last; ++b) {
    const Int3 at = brick_of_key(bricks[b].key);
    std::uint64_t points = 0, own = 0;
    for (int d = 0; d < 27; ++d) {
      const Int3 n = {at[0] + d % 3 - 1, at[1] + d / 3 % 3 - 1, at[2] + d / 9 - 1};
      if (n[0] < 0 || n[1] < 0 || n[2] < 0) continue;
      const BrickEntry* e = find_brick(bricks, brick_key(n));
      // A neighbour lends at most the eighth of its blocks that touch the face.
      if (e) points += d == 13 ? e->points : e->points / 4;
      if (e && d == 13) own = e->points;
    }
    maximum = std::max(maximum, points * kBytesPerPoint + own * kBytesPerOwnPoint);
  }
  return maximum + kFixedTaskBytes;
}

std::unique_ptr<Stage> make_normals_stage(const JobState& state) {
  return std::make_unique<NormalsStage>(state);
}

namespace {

// Microseconds a point: supporters of points with normals; normals too.
constexpr double kShapeTime = 0.25, kEstimateTime = 0.58;

}  // namespace

StageForecast forecast_normals(const PlannedScan& scan) {
  if (!scan.has_overlay) return idle_forecast();
  const std::uint64_t buckets = scan.plan.buckets.size();
  return all_sure({.tasks = buckets,
                   .task_bytes = normals_task_bytes(scan.bricks, 0, scan.bricks.size()),
                   .disk_bytes = scan.overlay_bytes,
                   .files = buckets,
                   .processor_us = scan.points * (scan.estimates_normals ? kEstimateTime : kShapeTime),
                   .moved_bytes = static_cast<double>(scan.store_bytes + scan.overlay_bytes)});
}

}  // namespace tessera
