#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <map>
#include <vector>

#include "stream/files/json.h"
#include "stream/files/task_files.h"
#include "stream/points/ground_store.h"
#include "stream/points/plan.h"
#include "stream/points/point_overlay.h"
#include "stream/points/point_sort.h"
#include "stream/points/point_store.h"
#include "stream/points/reconstruct_options.h"
#include "stream/points/top_store.h"
#include "stream/runtime/task_counts.h"
#include "stream/stages/plan/planned_scan.h"
#include "stream/stages/scan/brick_columns.h"
#include "stream/stages/scan/top_stage.h"

namespace tessera {
namespace {

/// Walls of samples hide what lies behind them down to so far below their foot, quanta.
constexpr std::int32_t kFootDepth = 2 * kQuantaPerCell;
/// Cosine with up from which a point lies level.
constexpr float kLevelCosine = 0.7f;
/// Cosine with up up to which a point shows down: the underside of what hangs over a step.
constexpr float kDownCosine = -0.2f;

class TopPointsStage : public Stage {
 public:
  explicit TopPointsStage(const JobState& state)
      : axes_(ViewAxes::along(reconstruct_options(state).up.value_or(Double3{0, 0, 1}))), top_(state.work) {
    auto overlay = PointOverlay::open(state.work);
    if (!overlay || overlay->volumetric() != VolumetricUse::kTop) return;
    points_ = std::make_unique<PointStore>(list_task_files(state.work / kScanPointFolder, kPointExtension),
                                           overlay);
    for (const PlanBucket& bucket : Plan::of_work(state.work).buckets) first_key_.push_back(bucket.first_key);
    if (!first_key_.empty()) first_key_.front() = 0;  // samples may lie in bricks before the first
    first_key_.push_back(~std::uint64_t{0});
  }

  std::string name() const override { return "top-points"; }
  std::size_t task_count() const override { return points_ ? first_key_.size() - 1 : 0; }
  std::uint64_t units() const override { return points_ ? points_->point_count() : 0; }
  std::string unit_name() const override { return "points"; }

  std::uint64_t task_bytes(std::size_t task) const override {
    std::uint64_t maximum = 0;
    for_bricks_of(task, [&](std::uint64_t key, const BrickEntry* brick) {
      maximum = std::max(maximum, top_points_task_bytes(brick ? brick->points : 0, top_.sample_count(key)));
    });
    return maximum;
  }

  Json run(std::size_t task, TaskContext& context) const override {
    PointFileWriter writer(
        context.create(std::string(kSurfacePointFolder) + "/" + task_file_stem(task) + kPointExtension));
    BrickSorter sorter;
    Counts counts;
    for_bricks_of(task, [&](std::uint64_t key, const BrickEntry* brick) {
      context.check_stop();
      std::vector<PointRecord> records;
      if (brick) {
        records = points_->records(static_cast<std::size_t>(brick - points_->bricks().data()));
        context.count_read(brick->points * sizeof(PointRecord));
        keep_measured(key, records, counts);
        context.advance(brick->points);
      }
      const std::vector<PointRecord> samples = top_.samples(key);
      records.insert(records.end(), samples.begin(), samples.end());
      if (records.empty()) return;
      const std::span<const PointRecord> sorted = samples.empty() ? records : sorter.sort(records);
      writer.brick(key, sorted);
      counts.points += sorted.size();
    });
    context.count_written(writer.finish());
    return {{"points", counts.points},         {"volumetric_covered", counts.covered},
            {"cleared", counts.cleared},       {"volumetric_left_out", counts.left_out},
            {"thin_left_out", counts.thin},    {"measured_at_top", counts.at_top},
            {"measured_behind", counts.behind}};
  }

  std::uint64_t finish_bytes() const override { return 1u << 20; }

  Json finish(const std::vector<Json>& summaries, TaskContext&) const override {
    if (!points_) return {{"needed", false}};
    return sum_counts(summaries, {{"needed", true}});
  }

  std::vector<std::string> obsolete() const override {
    if (!points_) return {};
    return {std::string(kScanPointFolder) + "/", std::string(PointOverlay::kFolder) + "/",
            std::string(TopStore::kFolder) + "/", std::string(kGroundFolder) + "/"};
  }

 private:
  struct Counts {
    std::uint64_t points = 0;
    std::uint64_t covered = 0;   ///< strewn points in columns that samples stand in for
    std::uint64_t left_out = 0;  ///< strewn points elsewhere: poles, what lies below a surface
    std::uint64_t thin = 0;      ///< points of wires, strewn or not
    std::uint64_t cleared = 0;   ///< of surfaces among strewn points over the ground that are left out
    std::uint64_t at_top = 0;    ///< points of surfaces that samples stand in for
    std::uint64_t behind = 0;    ///< points of surfaces behind the walls of samples, of a skin all off it
  };

  /// use(key, brick or null) for the bricks of a task that hold points or samples, ascending.
  template <class Use>
  void for_bricks_of(std::size_t task, const Use& use) const {
    const auto below = [](const BrickEntry& b, std::uint64_t key) { return b.key < key; };
    const std::span<const BrickEntry> all = points_->bricks();
    auto b = std::lower_bound(all.begin(), all.end(), first_key_[task], below);
    const auto end = std::lower_bound(all.begin(), all.end(), first_key_[task + 1], below);
    auto s = std::lower_bound(top_.bricks().begin(), top_.bricks().end(), first_key_[task]);
    const auto last = std::lower_bound(top_.bricks().begin(), top_.bricks().end(), first_key_[task + 1]);
    while (b != end || s != last) {
      const std::uint64_t key = s == last ? b->key : b == end ? *s : std::min(b->key, *s);
      const bool here = b != end && b->key == key;
      use(key, here ? &*b : nullptr);
      if (here) ++b;
      if (s != last && *s == key) ++s;
    }
  }

  /// Takes strewn points out, and in columns that samples stand in for what lies on or above them, or level just inside
  /// their rim: there the wall between the top and the ground beside it meets the ground. Behind bare steps nothing stays.
  void keep_measured(std::uint64_t key, std::vector<PointRecord>& records, Counts& counts) const {
    Int3 at = brick_of_key(key);
    at[axes_.up] = 0;
    const std::vector<ModelColumn> model = top_.model(brick_key(at));
    constexpr std::int32_t kMask = kBrickCells - 1;
    std::erase_if(records, [&](PointRecord& p) {
      if ((p.flags & kPointOutlier) != 0) return true;
      const bool strewn = (p.flags & kPointVolumetric) != 0;
      const ModelColumn* c =
          model.empty()
              ? nullptr
              : &model[static_cast<std::size_t>((p.q[axes_.v] >> kQuantumBits & kMask) * kBrickCells +
                                                (p.q[axes_.u] >> kQuantumBits & kMask))];
      if (c && (c->flags & kModelThin) != 0 && axes_.sign * p.q[axes_.up] - c->height > kThinRise) {
        ++counts.thin;
        return true;
      }
      if (!strewn && c && (c->flags & kModelCleared) != 0 &&
          axes_.sign * p.q[axes_.up] - c->height > static_cast<std::int32_t>(c->reach)) {
        ++counts.cleared;
        return true;
      }
      const bool stands = c && (c->flags & kModelStands) != 0;
      if (strewn) {
        ++(stands ? counts.covered : counts.left_out);
        return true;
      }
      if (!c || c->flags == 0) return false;
      if ((c->flags & kModelGround) != 0) show_up(p);
      if ((c->flags & kModelSkin) != 0) return !is_on_skin(p, *c, counts);
      const float facing = static_cast<float>(axes_.sign) * decode_normal(p.normal)[axes_.up];
      const auto reach = static_cast<std::int32_t>(c->reach);
      const bool below = axes_.sign * p.q[axes_.up] <=
                         c->height - (facing > kLevelCosine ? std::min(reach, kLevelReach) : reach);
      const bool by_step = (c->flags & kModelStep) != 0;
      if (stands && !below) {
        ++counts.at_top;
        return true;
      }
      const bool behind = by_step && below && axes_.sign * p.q[axes_.up] > c->foot - kFootDepth;
      const bool gone = behind && (stands || facing < kDownCosine);
      counts.behind += gone;
      return gone;
    });
  }

  /// Nobody sees the ground from below.
  void show_up(PointRecord& p) const {
    const Float3 n = decode_normal(p.normal);
    if (static_cast<float>(axes_.sign) * n[axes_.up] < 0.0f) p.normal = encode_normal(-n[0], -n[1], -n[2]);
  }

  /// Of columns that samples stand in for nothing stays, elsewhere what lies at the height of the skin and does not face down.
  bool is_on_skin(const PointRecord& p, const ModelColumn& c, Counts& counts) const {
    const std::int64_t above = std::int64_t{axes_.sign} * p.q[axes_.up] - c.height;
    const bool at_top = std::abs(above) <= static_cast<std::int64_t>(c.reach);
    const float facing = static_cast<float>(axes_.sign) * decode_normal(p.normal)[axes_.up];
    const float least = (c.flags & kModelGround) != 0 ? kSteepCosine : kDownCosine;
    if (at_top && (c.flags & kModelStands) == 0 && facing >= least) return true;
    ++(at_top ? counts.at_top : counts.behind);
    return false;
  }

  ViewAxes axes_;
  TopStore top_;
  std::unique_ptr<PointStore> points_;    ///< null where no top surface is wanted
  std::vector<std::uint64_t> first_key_;  ///< of every task, and one past
};

}  // namespace

std::uint64_t top_points_task_bytes(std::uint64_t brick_points, std::uint64_t samples) {
  const std::uint64_t all = brick_points + samples;
  return all * 2 * sizeof(PointRecord) + samples * sizeof(PointRecord) + BrickSorter::bytes(all) +
         DirectFile::kDefaultBuffer + (std::uint64_t{4} << 20);
}

std::unique_ptr<Stage> make_top_points_stage(const JobState& state) {
  return std::make_unique<TopPointsStage>(state);
}

namespace {

constexpr double kTopPointsTime = 0.07;  ///< microseconds a point
/// Samples of a brick that its top surface crosses, steps too; of a skin twice as many.
constexpr std::uint64_t kBrickSamples = std::uint64_t{4} * kBrickCells * kBrickCells;

}  // namespace

StageForecast forecast_top_points(const PlannedScan& scan) {
  if (!scan.columns) return idle_forecast();
  const std::uint64_t skins = is_skin(model_use(scan.options)) ? 2 : 1;
  const std::uint64_t buckets = scan.plan.buckets.size();
  const double used = scan.columns->look_closed() ? 0.0 : 1.0;  // as of the surface model
  return {.tasks = buckets,
          .task_bytes = top_points_task_bytes(scan.largest_brick, skins * kBrickSamples),
          .disk_bytes = scan.store_bytes,
          .files = buckets,
          .processor_us = used * scan.points * kTopPointsTime,
          .moved_bytes = used * static_cast<double>(2 * scan.store_bytes + scan.overlay_bytes)};
}

}  // namespace tessera
