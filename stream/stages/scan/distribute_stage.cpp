#include "stream/stages/scan/distribute_stage.h"

#include <algorithm>
#include <cmath>
#include <string>

#include "octree/error.h"
#include "stream/files/json.h"
#include "stream/files/task_files.h"
#include "stream/formats/points/quantise.h"
#include "stream/points/run_file.h"
#include "stream/stages/plan/planned_scan.h"
#include "stream/stages/scan/point_colours.h"

namespace tessera {
namespace {

/// Buckets of points; consecutive points mostly share a brick.
class BucketFinder {
 public:
  explicit BucketFinder(const std::vector<std::uint64_t>& first_keys) : first_keys_(first_keys) {}
  std::uint32_t operator()(const Int3& q) {
    constexpr int kShift = kBrickBits + kQuantumBits;
    const Int3 brick = {q[0] >> kShift, q[1] >> kShift, q[2] >> kShift};
    if (brick != brick_) {
      brick_ = brick;
      const auto after = std::upper_bound(first_keys_.begin(), first_keys_.end(), brick_key(brick));
      bucket_ = static_cast<std::uint32_t>(std::max<std::ptrdiff_t>(1, after - first_keys_.begin()) - 1);
    }
    return bucket_;
  }

 private:
  const std::vector<std::uint64_t>& first_keys_;
  Int3 brick_ = {-1, -1, -1};
  std::uint32_t bucket_ = 0;
};

std::uint16_t flags_of(const Echo& echo) {
  return static_cast<std::uint16_t>((echo.last() ? 0 : kPointNotLast) |
                                    (echo.kind == kGroundClass ? kPointGround : 0));
}

/// What the second-level cache holds, but of each bucket so many that order reads long pieces.
std::size_t run_points(const RunOptions& run, const Plan& plan) {
  constexpr std::uint64_t kOfBucket = 4096;
  const std::uint64_t share = run.memory_bytes / static_cast<std::uint64_t>(std::max(1, run.threads));
  const std::uint64_t wanted = std::clamp<std::uint64_t>(kOfBucket * plan.buckets.size(), 1u << 15, 1u << 20);
  return static_cast<std::size_t>(
      std::clamp<std::uint64_t>(share / 6 / RunWriter::kBytesPerPoint, 1u << 13, wanted));
}

}  // namespace

std::uint64_t distribute_task_bytes(const RunOptions& run, const Plan& plan, std::uint64_t input_bytes) {
  const std::uint64_t runs = input_bytes / 3 / run_points(run, plan) + 1;
  return run_points(run, plan) * RunWriter::kBytesPerPoint + DirectFile::kDefaultBuffer +
         (runs * 32 + 8) * plan.buckets.size() + std::uint64_t{65536} * 44 + PointInputs::kReadBytes;
}

std::uint64_t distribute_runs(const RunOptions& run, const Plan& plan, std::uint64_t tasks) {
  return plan.points() / run_points(run, plan) + tasks + 1;
}

std::uint64_t distribute_finish_bytes(const RunOptions& run, const Plan& plan, std::uint64_t tasks) {
  return distribute_runs(run, plan, tasks) * plan.buckets.size() * sizeof(Extent) * 2 +
         (std::uint64_t{1} << 20);
}

std::string run_file_name(std::size_t task) {
  return "distribute/" + task_file_stem(task) + ".run";
}

DistributeStage::DistributeStage(const JobState& job, std::shared_ptr<const PointInputs> inputs)
    : job_(job), inputs_(std::move(inputs)), plan_(Plan::of_work(job.work)) {
  for (const PlanBucket& b : plan_.buckets) first_keys_.push_back(b.first_key);
}

std::uint64_t DistributeStage::task_bytes(std::size_t task) const {
  return distribute_task_bytes(job_.run, plan_, inputs_->task_input_bytes(task));
}

std::uint64_t DistributeStage::finish_bytes() const {
  return distribute_finish_bytes(job_.run, plan_, inputs_->task_count());
}

Json DistributeStage::run(std::size_t task, TaskContext& context) const {
  RunWriter out(context.create(run_file_name(task)), static_cast<std::uint32_t>(task), plan_.buckets.size(),
                run_points(job_.run, plan_));
  BucketFinder bucket_of(first_keys_);
  ChunkQuanta quanta;
  std::vector<std::uint16_t> sensors;
  std::vector<std::uint32_t> normals;
  std::vector<std::uint32_t> rgba;
  const ColourBy by = colour_by(reconstruct_options(job_).colour);
  Double3 low{};
  Double3 high{};
  Double3 base{};
  for (std::size_t a = 0; a < 3; ++a) {
    base[a] = static_cast<double>(plan_.lattice.origin_brick[a]) * kQuantaPerBrick;
    low[a] = base[a] + static_cast<double>(plan_.brick_min[a]) * kQuantaPerBrick;
    high[a] = base[a] + static_cast<double>(plan_.brick_max[a] + 1) * kQuantaPerBrick;
  }
  std::uint64_t kept = 0;
  inputs_->read(task, context, false, [&](std::uint32_t file, const PointChunk& chunk) {
    const std::size_t n = chunk.size();
    quanta.compute(chunk, plan_.lattice.h);
    if (!plan_.sensors.empty()) inputs_->sensor_ids(file, chunk, sensors);
    const bool with_normals = !chunk.nx.empty();  // where they are estimated, to be compared with
    if (with_normals) {
      normals.resize(n);
      encode_normals(chunk.nx.data(), chunk.ny.data(), chunk.nz.data(), n, normals.data());
    }
    if (plan_.has_colour) colour_points(by, plan_, chunk, quanta.z, rgba);
    for (std::size_t i = 0; i < n; ++i) {
      const double x = quanta.x[i];
      const double y = quanta.y[i];
      const double z = quanta.z[i];
      if (quanta.disposition[i] != PointClass::kGood || x < low[0] || x >= high[0] || y < low[1] ||
          y >= high[1] || z < low[2] || z >= high[2])
        continue;
      PointRecord p;
      p.q = {static_cast<std::int32_t>(x - base[0]), static_cast<std::int32_t>(y - base[1]),
             static_cast<std::int32_t>(z - base[2])};
      if (with_normals) p.normal = normals[i];
      if (plan_.has_colour) p.rgba = rgba[i];
      if (!plan_.sensors.empty()) p.sensor = sensors[i];
      if (!chunk.echo.empty()) p.flags = flags_of(chunk.echo[i]);
      out.add(p, bucket_of(p.q));
      ++kept;
    }
  });
  context.count_written(out.finish());
  return {{"points", kept}};
}

Json DistributeStage::finish(const std::vector<Json>& summaries, TaskContext& context) const {
  std::vector<Extent> all;
  std::uint64_t bytes = 0;
  for (std::size_t k = 0; k < summaries.size(); ++k)
    open_run_file(job_.work / run_file_name(k)).append_table(all);
  std::vector<std::uint64_t> points(plan_.buckets.size());
  for (const Extent& e : all) {
    points[e.bucket] += e.points();
    bytes += e.records.bytes;
  }
  for (std::size_t b = 0; b < points.size(); ++b)
    if (points[b] != plan_.buckets[b].points)
      throw InputError("bucket " + std::to_string(b) + " got " + std::to_string(points[b]) +
                       " points, the survey saw " + std::to_string(plan_.buckets[b].points) +
                       "; an input file changed while it was read, run again with --force");
  save_extents(context.create(kExtentFile), all);
  return {{"points", plan_.points()}, {"runs_bytes", bytes}, {"extents", all.size()}};
}

std::unique_ptr<Stage> make_distribute_stage(const JobState& job) {
  return std::make_unique<DistributeStage>(
      job, open_point_inputs(job, colour_by(reconstruct_options(job).colour) == ColourBy::kRgb));
}

namespace {

constexpr double kDistributeTime = 0.05;  ///< microseconds a point

}  // namespace

StageForecast forecast_distribute(const PlannedScan& scan) {
  return all_sure({.tasks = scan.inputs.count,
                   .task_bytes = distribute_task_bytes(scan.run, scan.plan, scan.inputs.largest_bytes),
                   .finish_bytes = distribute_finish_bytes(scan.run, scan.plan, scan.inputs.count),
                   .disk_bytes = scan.run_bytes,
                   .files = scan.inputs.count + 1,
                   .processor_us = scan.points * kDistributeTime,
                   .moved_bytes = 2.0 * static_cast<double>(scan.run_bytes)});
}

}  // namespace tessera
