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
  std::uint64_t units() const override { return plan_.dispositions.read; }
  std::string unit_name() const override { return "points"; }
  Json run(std::size_t task, TaskContext& context) const override;
  Json finish(const std::vector<Json>& summaries, TaskContext& context) const override;
  std::uint64_t finish_bytes() const override;
  std::vector<std::string> obsolete() const override { return {"survey/", "unpacked/", "thinned/"}; }

  static constexpr const char* kExtentFile = "distribute/extents.bin";

 private:
  JobState job_;
  std::shared_ptr<const PointInputs> inputs_;
  Plan plan_;
  std::vector<std::uint64_t> first_keys_;  ///< per bucket
};

// What it takes, known from the plan. \param input_bytes  of the task \param tasks  of the stage
std::uint64_t distribute_task_bytes(const RunOptions& run, const Plan& plan, std::uint64_t input_bytes);
std::uint64_t distribute_finish_bytes(const RunOptions& run, const Plan& plan, std::uint64_t tasks);
/// Runs that its tasks write, at most; each holds one extent of a bucket at most.
std::uint64_t distribute_runs(const RunOptions& run, const Plan& plan, std::uint64_t tasks);

std::unique_ptr<Stage> make_distribute_stage(const JobState& job);
StageForecast forecast_distribute(const PlannedScan& scan);

/// The run file of task k, relative to the work directory.
std::string run_file_name(std::size_t task);

}  // namespace tessera
