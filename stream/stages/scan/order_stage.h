/// \file order_stage.h
/// Pass 3: each bucket in canonical order, equal positions merged, hot bricks thinned; the ordered point
/// store.
#pragma once
#include <memory>
#include <span>
#include <vector>

#include "stream/points/plan.h"
#include "stream/points/point_store.h"
#include "stream/points/run_file.h"
#include "stream/runtime/stage.h"

namespace tessera {

class OrderStage : public Stage {
 public:
  /// Reads the plan, the bricks and the extents of the work directory.
  explicit OrderStage(const JobState& job);

  std::string name() const override { return "order"; }
  std::size_t task_count() const override { return plan_.buckets.size(); }
  std::uint64_t task_bytes(std::size_t task) const override;
  std::uint64_t units() const override { return plan_.points(); }
  std::string unit_name() const override { return "points"; }
  Json run(std::size_t task, TaskContext& context) const override;
  Json finish(const std::vector<Json>& summaries, TaskContext& context) const override;
  std::uint64_t finish_bytes() const override { return kFinishBytes; }
  std::vector<std::string> obsolete() const override { return {"distribute/"}; }

  static constexpr std::uint64_t kFinishBytes = std::uint64_t{1} << 20;

 private:
  struct Counts {
    std::uint64_t kept = 0, merged = 0, thinned = 0, bytes = 0;
  };
  Counts order_bucket(std::size_t task, TaskContext& context) const;
  Counts order_hot_brick(std::size_t task, TaskContext& context) const;
  /// use(points) for all points of a bucket, in chunks.
  template <typename Use>
  void stream_bucket(std::size_t task, TaskContext& context, const Use& use) const;

  JobState job_;
  std::uint64_t max_brick_points_;
  Plan plan_;
  std::vector<PlanBrick> bricks_;
  std::vector<std::uint64_t> first_extent_;  ///< per bucket, and one past
};

/// A bucket of one brick over `max_brick_points`, which is thinned.
bool is_hot(const PlanBucket& bucket, std::uint64_t max_brick_points);
/// 24 bytes a point of the bucket, BrickSorter::bytes of its largest brick; HotBrick::bytes for a hot one.
/// \param bricks  of the whole plan \param extents  of the bucket
std::uint64_t order_task_bytes(const PlanBucket& bucket, std::span<const PlanBrick> bricks,
                               std::uint64_t extents, std::uint64_t max_brick_points);
/// The brick table that the stage will leave: exact but where equal points merge or hot bricks are thinned, there an
/// upper bound.
std::vector<BrickEntry> planned_bricks(const std::vector<PlanBrick>& bricks, std::uint64_t max_brick_points);

std::unique_ptr<Stage> make_order_stage(const JobState& job);
StageForecast forecast_order(const PlannedScan& scan);

/// The point file of bucket k, relative to the work directory.
std::string point_file_name(std::size_t bucket);

}  // namespace tessera
