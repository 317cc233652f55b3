#include <algorithm>

#include "stream/stages/coverage/coverage_stage.h"
#include "stream/stages/coverage/face_source.h"
#include "stream/stages/coverage/seen_stages.h"
#include "stream/stages/decimate/simplify_needs.h"
#include "stream/stages/plan/planned_scan.h"

namespace tessera {
namespace {

constexpr double kCoverageTime = 0.12;  ///< microseconds a face
constexpr double kSeenTime = 0.07;      ///< microseconds a point

}  // namespace

StageForecast forecast_seen_spacing(const PlannedScan& scan) {
  return all_sure({.finish_bytes = seen_spacing_bytes(scan.bricks), .files = 1});
}
StageForecast forecast_seen(const PlannedScan& scan) {
  const std::uint64_t buckets = scan.plan.buckets.size();
  std::uint64_t task = 0;
  for (const PlanBucket& b : scan.plan.buckets)
    task = std::max(task, seen_task_bytes(scan.bricks, b.first_brick, b.first_brick + b.bricks));
  return all_sure({.tasks = buckets,
                   .task_bytes = task,
                   .finish_bytes = seen_finish_bytes(),
                   .files = 2 * buckets,
                   .processor_us = scan.points * kSeenTime,
                   .moved_bytes = static_cast<double>(scan.store_bytes)});
}

StageForecast forecast_coverage(const PlannedScan& scan) {
  const PatchEntry& patch = scan.largest_patch;
  const bool stored = scan.fuses_stores || scan.options.decimates();
  const std::uint64_t faces = stored ? stored_faces_bytes(surface_block_bytes(patch.faces))
                                     : welded_faces_bytes(std::uint64_t{patch.vertices} + patch.foreign,
                                                          patch.faces, scan.filling_bytes);
  return {.tasks = scan.groups.size(),
          .task_bytes = coverage_task_bytes(faces),
          .finish_bytes = coverage_finish_bytes(),
          .sure_bytes = coverage_finish_bytes(),
          .files = 2 * scan.groups.size(),
          .processor_us = scan.faces * (scan.options.decimates() ? 0.1 : 1.0) * kCoverageTime};
}

}  // namespace tessera
