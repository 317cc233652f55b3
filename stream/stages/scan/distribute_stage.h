/// \file distribute_stage.h
/// Pass 2: points to quanta, grouped by bucket. One run file per task and one table of all extents.
#pragma once
#include <memory>

#include "stream/points/plan.h"
#include "stream/points/point_inputs.h"
#include "stream/runtime/stage.h"

namespace tessera {

class DistributeStage : public Stage {
 public:
  /// Reads the plan of the work directory.
  DistributeStage(const JobState& job, std::shared_ptr<const PointInputs> inputs);

  std::string name() const override { return "distribute"; }
  std::size_t task_count() const override { return inputs_->task_count(); }
  std::uint64_t task_bytes(std::size_t task) const override;
  std::uint64_t units() const override { return plan_.fates.read; }
  std::string unit_name() const override { return "points"; }
  nlohmann::json run(std::size_t task, TaskContext& context) const override;
  nlohmann::json finish(const std::vector<nlohmann::json>& summaries, TaskContext& context) const override;
  std::uint64_t finish_bytes() const override;
  std::vector<std::string> obsolete() const override { return {"survey/"}; }

  static constexpr const char* kExtentFile = "distribute/extents.bin";

 private:
  std::size_t run_points() const;

  JobState job_;
  std::shared_ptr<const PointInputs> inputs_;
  Plan plan_;
  std::vector<std::uint64_t> first_keys_;  ///< per bucket
};

std::unique_ptr<Stage> make_distribute_stage(const JobState& job);

/// The run file of task k, relative to the work directory.
std::string run_file_name(std::size_t task);

}  // namespace tessera
