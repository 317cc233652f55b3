#include "stream/stages/scan/order_stage.h"

#include <algorithm>
#include <string>

#include "octree/error.h"
#include "stream/files/json.h"
#include "stream/files/task_files.h"
#include "stream/points/hot_brick.h"
#include "stream/points/point_sort.h"
#include "stream/points/point_store.h"
#include "stream/points/reconstruct_options.h"
#include "stream/stages/plan/planned_scan.h"
#include "stream/stages/scan/distribute_stage.h"

namespace tessera {
namespace {

constexpr std::size_t kHotChunk = std::size_t{1} << 19;

/// Where the points of each brick of a bucket go.
class BrickSlots {
 public:
  BrickSlots(const PlanBrick* bricks, std::size_t count) : bricks_(bricks), count_(count), next_(count + 1) {
    for (std::size_t b = 0; b < count; ++b) next_[b + 1] = next_[b] + bricks[b].points;
    end_ = next_;
  }
  std::uint64_t take(const Int3& q) {
    constexpr int kShift = kBrickBits + kQuantumBits;
    const Int3 brick = {q[0] >> kShift, q[1] >> kShift, q[2] >> kShift};
    if (brick != brick_) {
      const std::uint64_t key = brick_key(brick);
      const auto at = std::lower_bound(bricks_, bricks_ + count_, key,
                                       [](const PlanBrick& b, std::uint64_t k) { return b.key < k; });
      slot_ = static_cast<std::size_t>(at - bricks_);
      if (slot_ == count_ || at->key != key) unsurveyed();
      brick_ = brick;
    }
    if (next_[slot_] == end_[slot_ + 1]) unsurveyed();
    return next_[slot_]++;
  }

 private:
  [[noreturn]] static void unsurveyed() {
    throw InputError(
        "a brick holds points that the survey did not see; an input file changed while it was read, "
        "run again with --force");
  }
  const PlanBrick* bricks_;
  std::size_t count_;
  std::vector<std::uint64_t> next_, end_;
  Int3 brick_ = {-1, -1, -1};
  std::size_t slot_ = 0;
};

}  // namespace

std::string point_file_name(std::size_t bucket) {
  return std::string(kScanPointFolder) + "/" + task_file_stem(bucket) + kPointExtension;
}

OrderStage::OrderStage(const JobState& job)
    : job_(job),
      max_brick_points_(reconstruct_options(job).max_brick_points),
      plan_(Plan::of_work(job.work)),
      bricks_(load_plan_bricks(job.work / Plan::kBrickFile)),
      first_extent_(plan_.buckets.size() + 1) {
  // Only the counts stay: every task reads its own range.
  for (const Extent& e : load_extents(job.work / DistributeStage::kExtentFile))
    ++first_extent_.at(e.bucket + std::size_t{1});
  for (std::size_t b = 1; b < first_extent_.size(); ++b) first_extent_[b] += first_extent_[b - 1];
}

bool is_hot(const PlanBucket& bucket, std::uint64_t max_brick_points) {
  return bucket.bricks == 1 && bucket.points > max_brick_points;
}

std::uint64_t order_task_bytes(const PlanBucket& bucket, std::span<const PlanBrick> bricks,
                               std::uint64_t extents, std::uint64_t max_brick_points) {
  const std::uint64_t fixed = DirectFile::kDefaultBuffer + kExtentChunk * sizeof(PointRecord) +
                              bucket.bricks * 100 + (std::uint64_t{1} << 18);
  const std::uint64_t blocks = extents * sizeof(Extent) + std::min(bucket.points, bucket.bricks * 512) * 16;
  if (is_hot(bucket, max_brick_points)) return fixed + blocks + HotBrick::bytes(max_brick_points, kHotChunk);
  std::uint64_t largest = 0;
  for (std::uint64_t b = 0; b < bucket.bricks; ++b)
    largest = std::max(largest, bricks[bucket.first_brick + b].points);
  return fixed + blocks + bucket.points * sizeof(PointRecord) + BrickSorter::bytes(largest);
}

std::vector<BrickEntry> planned_bricks(const std::vector<PlanBrick>& bricks, std::uint64_t max_brick_points) {
  std::vector<BrickEntry> table(bricks.size());
  for (std::size_t b = 0; b < bricks.size(); ++b) {
    table[b].key = bricks[b].key;
    table[b].points = std::min(bricks[b].points, max_brick_points);
    table[b].blocks = std::min(bricks[b].blocks, table[b].points);
  }
  return table;
}

std::uint64_t OrderStage::task_bytes(std::size_t task) const {
  return order_task_bytes(plan_.buckets[task], bricks_, first_extent_[task + 1] - first_extent_[task],
                          max_brick_points_);
}

template <typename Use>
void OrderStage::stream_bucket(std::size_t task, TaskContext& context, const Use& use) const {
  std::vector<PointRecord> buffer;
  const std::vector<Extent> extents =
      load_extents(job_.work / DistributeStage::kExtentFile, first_extent_[task],
                   first_extent_[task + 1] - first_extent_[task]);
  for (std::size_t at = 0; at < extents.size();) {
    const PackedFile file = open_run_file(job_.work / run_file_name(extents[at].file));
    for (const std::uint32_t id = extents[at].file; at < extents.size() && extents[at].file == id; ++at) {
      stream_extent(file, extents[at], buffer, [&](std::span<const PointRecord> points) {
        context.check_stop();
        use(points);
      });
      file.release(extents[at].records);
      context.count_read(extents[at].records.bytes);
    }
  }
}

OrderStage::Counts OrderStage::order_bucket(std::size_t task, TaskContext& context) const {
  const PlanBucket& bucket = plan_.buckets[task];
  const PlanBrick* bricks = bricks_.data() + bucket.first_brick;
  std::vector<PointRecord> points(bucket.points);
  BrickSlots slots(bricks, bucket.bricks);
  stream_bucket(task, context, [&](std::span<const PointRecord> chunk) {
    for (const PointRecord& p : chunk) points[slots.take(p.q)] = p;
  });
  PointFileWriter out(context.create(point_file_name(task)));
  out.expect(bucket.bricks);
  BrickSorter sorter;
  Counts counts;
  const PointRecord* from = points.data();
  for (std::uint64_t b = 0; b < bucket.bricks; ++b) {
    const auto sorted = sorter.sort({from, bricks[b].points});
    out.brick(bricks[b].key, sorted);
    counts.kept += sorted.size();
    counts.merged += bricks[b].points - sorted.size();
    from += bricks[b].points;
    context.check_stop();
    context.advance(bricks[b].points);
  }
  counts.bytes = out.finish();
  return counts;
}

OrderStage::Counts OrderStage::order_hot_brick(std::size_t task, TaskContext& context) const {
  HotBrick brick(max_brick_points_, kHotChunk);
  stream_bucket(task, context, [&](std::span<const PointRecord> chunk) { brick.count(chunk); });
  stream_bucket(task, context, [&](std::span<const PointRecord> chunk) {
    brick.add(chunk);
    context.advance(chunk.size());
  });
  const std::vector<PointRecord> points = brick.take();
  PointFileWriter out(context.create(point_file_name(task)));
  out.brick(plan_.buckets[task].first_key, points);
  return {points.size(), brick.merged(), brick.thinned(), out.finish()};
}

Json OrderStage::run(std::size_t task, TaskContext& context) const {
  const Counts c = is_hot(plan_.buckets[task], max_brick_points_) ? order_hot_brick(task, context)
                                                                  : order_bucket(task, context);
  context.count_written(c.bytes);
  return {{"points", c.kept}, {"duplicates", c.merged}, {"thinned", c.thinned}};
}

Json OrderStage::finish(const std::vector<Json>& summaries, TaskContext&) const {
  Counts sum;
  std::uint64_t hot = 0;
  for (const auto& s : summaries) {
    sum.kept += s.at("points").get<std::uint64_t>();
    sum.merged += s.at("duplicates").get<std::uint64_t>();
    sum.thinned += s.at("thinned").get<std::uint64_t>();
  }
  for (const PlanBucket& b : plan_.buckets) hot += is_hot(b, max_brick_points_) ? 1 : 0;
  if (sum.kept < 3)
    throw EmptyError("the input holds " + std::to_string(sum.kept) +
                     " different points; a surface needs at least three");
  return {{"points", sum.kept},
          {"duplicates", sum.merged},
          {"thinned", sum.thinned},
          {"hot_bricks", hot},
          {"bricks", plan_.bricks}};
}

std::unique_ptr<Stage> make_order_stage(const JobState& job) {
  return std::make_unique<OrderStage>(job);
}

namespace {

constexpr double kOrderTime = 0.05;  ///< microseconds a point

}  // namespace

StageForecast forecast_order(const PlannedScan& scan) {
  const std::uint64_t runs = distribute_runs(scan.run, scan.plan, scan.inputs.count);
  const std::uint64_t buckets = scan.plan.buckets.size();
  std::uint64_t task = 0;
  for (const PlanBucket& b : scan.plan.buckets)
    task = std::max(
        task, order_task_bytes(b, scan.plan_bricks, std::min(runs, b.points), scan.options.max_brick_points));
  return all_sure({.tasks = buckets,
                   .task_bytes = task,
                   .finish_bytes = OrderStage::kFinishBytes,
                   .disk_bytes = scan.store_bytes,
                   .files = buckets,
                   .processor_us = scan.points * kOrderTime,
                   .moved_bytes = static_cast<double>(scan.run_bytes + scan.store_bytes)});
}

}  // namespace tessera
