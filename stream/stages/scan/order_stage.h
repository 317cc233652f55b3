/// \file order_stage.h
/// Pass 3: each bucket in canonical order, equal positions merged, hot bricks thinned; the ordered point
/// store.
#pragma once
#include <memory>
#include <vector>

#include "stream/points/plan.h"
#include "stream/points/run_file.h"
#include "stream/runtime/stage.h"

namespace tessera {

class OrderStage : public Stage {
 public:
  /// Reads the plan, the bricks and the extents of the work directory.
  explicit OrderStage(const JobState& job);

  std::string name() const override { return "order"; }
  std::size_t task_count() const override { return plan_.buckets.size(); }
  /// 24 bytes a point of the bucket, BrickSorter::bytes of its largest brick; HotBrick::bytes for a hot one.
  std::uint64_t task_bytes(std::size_t task) const override;
  std::uint64_t units() const override { return plan_.points(); }
  std::string unit_name() const override { return "points"; }
  nlohmann::json run(std::size_t task, TaskContext& context) const override;
  nlohmann::json finish(const std::vector<nlohmann::json>& summaries, TaskContext& context) const override;
  std::uint64_t finish_bytes() const override { return std::uint64_t{1} << 20; }
  std::vector<std::string> obsolete() const override { return {"distribute/"}; }

 private:
  struct Counts {
    std::uint64_t kept = 0, merged = 0, thinned = 0, bytes = 0;
  };
  bool is_hot(const PlanBucket& bucket) const;
  Counts order_bucket(std::size_t task, TaskContext& context) const;
  Counts order_hot_brick(std::size_t task, TaskContext& context) const;
  /// use(points) for all points of a bucket, in chunks.
  template <typename Use>
  void stream_bucket(std::size_t task, TaskContext& context, const Use& use) const;

  JobState job_;
  std::uint64_t most_brick_points_;
  Plan plan_;
  std::vector<PlanBrick> bricks_;
  std::vector<std::uint64_t> first_extent_;  ///< per bucket, and one past
};

std::unique_ptr<Stage> make_order_stage(const JobState& job);

/// The point file of bucket k, relative to the work directory.
std::string point_file_name(std::size_t bucket);

}  // namespace tessera
