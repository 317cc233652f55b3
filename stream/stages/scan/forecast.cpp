#include "stream/stages/scan/forecast.h"

#include <algorithm>
#include <filesystem>
#include <string>

#include "octree/error.h"
#include "stream/files/direct_file.h"
#include "stream/points/hot_brick.h"
#include "stream/points/point_inputs.h"
#include "stream/points/point_sort.h"
#include "stream/points/reconstruct_options.h"
#include "stream/points/run_file.h"
#include "stream/runtime/memory_budget.h"
#include "stream/stages/surface/closing_stages.h"
#include "stream/stages/surface/first_pass.h"
#include "stream/stages/surface/hole_files.h"

namespace tessera {
namespace {

// Bytes on disk, as the files' headers give them.
constexpr double kRunBytes = 24.0;
constexpr double kStoreBytes = 24.3;   // records and tables, bricks of some thousand points
constexpr double kOverlayBytes = 9.0;  // normals and boundary surfels
constexpr double kPatchBytes = 21.0;   // per face
constexpr double kOutputBytes = 19.0;  // per face: 13 bytes a face, half a vertex of 12

// Processor time on one core of an EPYC at about 3 GHz, microseconds per point or face. `tools/bench` prints
// them.
constexpr double kDistributeTime = 0.05;
constexpr double kOrderTime = 0.05;
constexpr double kShapeTime = 0.25;     // supporters of points with normals
constexpr double kEstimateTime = 0.95;  // normals too
constexpr double kSurfaceTime = 0.42;   // per face
constexpr double kWriteTime = 0.02;     // per face
// With --holes, per point and per face of the open surface; what closing itself takes only the holes know.
constexpr double kMultipoleTime = 0.1;
constexpr double kRimsTime = 0.4;
constexpr double kMultipoleBytes = 0.96;
constexpr double kRimsBytes = 1.5;
// With --tolerance, per face of full resolution.
constexpr double kFirstPassTime = 0.65;
constexpr double kFirstPassBytes = 6.4;  // instead of kPatchBytes
constexpr double kPass2Time = 0.27;
constexpr double kPass3Time = 0.13;
constexpr double kCertifyTime = 0.43;
constexpr double kPassBytes = 0.3;
constexpr double kDiskBytesPerSecond = 8e8;

// Memory per point of a brick and its surroundings, see normals_stage.cpp and tiling.cpp.
constexpr std::uint64_t kShapePointBytes = 124;
constexpr std::uint64_t kTilePointBytes = 84;
constexpr std::uint64_t kMultipolePointBytes = 200;
constexpr std::uint64_t kTileFixedBytes = std::uint64_t{42} << 20;

constexpr std::uint64_t kSurfaceTaskPoints = 500'000;
constexpr std::uint64_t kMaxSurfaceTasks = 400;

/// Most points in a brick and its 26 neighbours, over the densest bricks.
std::uint64_t densest_surroundings(const std::vector<PlanBrick>& bricks, std::uint64_t most) {
  constexpr std::size_t kLooked = 256;
  std::vector<PlanBrick> dense(std::min(kLooked, bricks.size()));
  std::partial_sort_copy(bricks.begin(), bricks.end(), dense.begin(), dense.end(),
                         [](const PlanBrick& a, const PlanBrick& b) { return a.points > b.points; });
  std::uint64_t largest = 0;
  for (const PlanBrick& d : dense) {
    const Int3 at = brick_of_key(d.key);
    std::uint64_t sum = 0;
    for (int k = 0; k < 27; ++k) {
      const std::uint64_t key = brick_key({at[0] + k % 3 - 1, at[1] + k / 3 % 3 - 1, at[2] + k / 9 - 1});
      const auto found = std::lower_bound(bricks.begin(), bricks.end(), key,
                                          [](const PlanBrick& b, std::uint64_t v) { return b.key < v; });
      if (found != bricks.end() && found->key == key) sum += std::min(found->points, most);
    }
    largest = std::max(largest, sum);
  }
  return largest;
}

std::uint64_t bytes_of(double count, double each) {
  return static_cast<std::uint64_t>(count * each);
}

}  // namespace

Forecast forecast_job(const Plan& plan, const std::vector<PlanBrick>& bricks, const JobState& job,
                      std::size_t input_tasks) {
  const auto points = static_cast<double>(plan.points());
  const double threads = std::max(1, job.run.threads);
  const ReconstructOptions options = reconstruct_options(job);
  const std::uint64_t most = options.max_brick_points;
  const bool estimate =
      options.normals == "estimate" || (options.normals == "auto" && plan.normal_fraction < 0.5);
  const bool shapes = estimate || options.outliers != "off";

  Forecast f;
  f.faces = plan.faces_estimate;
  const auto faces = static_cast<double>(f.faces);
  const auto add = [&](const char* stage, std::uint64_t tasks, std::uint64_t task_bytes, std::uint64_t disk,
                       std::uint64_t files, double processor_us, double moved_bytes) {
    const double width = std::max(1.0, std::min(threads, static_cast<double>(tasks)));
    f.stages.push_back({stage, tasks, task_bytes, disk, files,
                        processor_us * 1e-6 / width + moved_bytes / kDiskBytesPerSecond});
  };

  std::uint64_t largest_bucket = 0;
  for (const PlanBucket& b : plan.buckets) {
    const bool hot = b.bricks == 1 && b.points > most;
    largest_bucket = std::max(
        largest_bucket, hot ? HotBrick::bytes(most, std::uint64_t{1} << 19) : b.points * sizeof(PointRecord));
  }
  std::uint64_t largest_brick = 0;
  for (const PlanBrick& b : bricks) largest_brick = std::max(largest_brick, std::min(b.points, most));
  const std::uint64_t around = densest_surroundings(bricks, most);

  const std::uint64_t run = bytes_of(points, kRunBytes);
  const std::uint64_t store = bytes_of(points, kStoreBytes);
  const std::uint64_t overlay = shapes ? bytes_of(points, kOverlayBytes) : 0;
  const std::uint64_t buckets = plan.buckets.size();
  const std::uint64_t share = job.run.memory_bytes / static_cast<std::uint64_t>(threads);
  const std::uint64_t run_buffer = std::min<std::uint64_t>(share / 6, RunWriter::kBytesPerPoint << 20);
  f.output_bytes = bytes_of(faces, kOutputBytes);

  add("distribute", input_tasks, run_buffer + DirectFile::kDefaultBuffer + PointInputs::kReadBytes, run,
      input_tasks + 1, points * kDistributeTime, 2.0 * static_cast<double>(run));
  add("order", buckets, largest_bucket + BrickSorter::bytes(largest_brick) + DirectFile::kDefaultBuffer,
      store, buckets, points * kOrderTime, static_cast<double>(run + store));
  if (shapes)
    add("normals", buckets, around * kShapePointBytes / 2 + (std::uint64_t{8} << 20), overlay, buckets,
        points * (estimate ? kEstimateTime : kShapeTime), static_cast<double>(store + overlay));
  const std::uint64_t groups =
      std::clamp<std::uint64_t>(plan.points() / kSurfaceTaskPoints, 1, kMaxSurfaceTasks);
  const std::uint64_t tile_bytes = around * kTilePointBytes + kTileFixedBytes;
  std::uint64_t closing = 0;
  if (HolesMode(options.holes).close) {
    const std::uint64_t multipoles = bytes_of(faces, kMultipoleBytes), rims = bytes_of(faces, kRimsBytes);
    add("multipole", buckets, largest_brick * kMultipolePointBytes + (std::uint64_t{8} << 20), multipoles,
        buckets, points * kMultipoleTime, static_cast<double>(store + overlay));
    add("rims", groups, tile_bytes, rims, groups, faces * kRimsTime, static_cast<double>(store + overlay));
    add("close", 1, around * kMultipolePointBytes + (std::uint64_t{12} << 20), 0, 1, 0.0, 0.0);
    closing = multipoles + rims;
  }
  const bool fused = fuses_first_pass(options);
  const std::uint64_t patches = bytes_of(faces, fused ? kFirstPassBytes : kPatchBytes);
  add("surface", groups, tile_bytes, patches, groups, faces * (kSurfaceTime + (fused ? kFirstPassTime : 0.0)),
      static_cast<double>(store + overlay + patches));
  if (fused) {
    const std::uint64_t pass = bytes_of(faces, kPassBytes);
    const std::uint64_t blocks = groups / 2 + 1;
    const std::uint64_t pass_bytes = std::min<std::uint64_t>(share, std::uint64_t{100} << 20);
    add("pass-2", blocks, pass_bytes, pass, blocks, faces * kPass2Time, 0.5 * static_cast<double>(patches));
    add("pass-3", blocks, pass_bytes, pass, blocks, faces * kPass3Time, 0.2 * static_cast<double>(patches));
    add("certify", groups, pass_bytes / 4, 0, groups, faces * kCertifyTime, static_cast<double>(patches));
  }
  add("write", 1, std::uint64_t{64} << 20, f.output_bytes, 1, faces * kWriteTime,
      static_cast<double>(patches + f.output_bytes));

  f.peak_disk_bytes = std::max({run + store, store + overlay + closing + patches,
                                patches + f.output_bytes + store + overlay + closing});
  f.least_task_bytes = std::max(around * kTilePointBytes, shapes ? largest_brick * kShapePointBytes : 0);
  return f;
}

void require_resources(const Forecast& forecast, const JobState& job) {
  const MemoryBudget budget(job.run.memory_bytes, resident_bytes());
  budget.require(forecast.least_task_bytes, "the densest part of the scan");
  if (const std::uint32_t edges = reconstruct_options(job).max_hole; edges > 0) {
    budget.require(hole_task_bytes(edges), "filling holes of the largest size (--max-hole)");
  }
  std::error_code unknown;
  const auto space = std::filesystem::space(job.work, unknown);
  if (unknown || forecast.peak_disk_bytes <= space.available) return;
  throw ResourceError("the work directory " + job.work.string() + " needs about " +
                      format_bytes(forecast.peak_disk_bytes) + ", " + format_bytes(space.available) +
                      " are free; free space, or choose a larger disk by --temp");
}

}  // namespace tessera
