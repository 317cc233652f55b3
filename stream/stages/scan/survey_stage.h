/// \file survey_stage.h
/// Pass 1: one look at every point. Counts points by fate and by brick, then decides the lattice, the sensors
/// and the buckets: writes plan.json and bricks.bin.
#pragma once
#include <memory>

#include "kernels/points/point_clumps.h"
#include "stream/points/brick_histogram.h"
#include "stream/points/plan.h"
#include "stream/points/point_inputs.h"
#include "stream/points/reconstruct_options.h"
#include "stream/runtime/stage.h"

namespace tessera {

/// Memory of the end of the survey. \param input_bytes  of all files
std::uint64_t survey_finish_bytes(const RunOptions& run, std::uint64_t input_bytes);

class SurveyStage : public Stage {
 public:
  /// \param h     lattice spacing: --resolution, or what the spacing stage measured
  /// \param probed  points that the probe counted where h was measured, else 0
  SurveyStage(const JobState& job, std::shared_ptr<const PointInputs> inputs, double h, std::uint64_t probed);

  std::string name() const override { return "survey"; }
  std::size_t task_count() const override { return inputs_->task_count(); }
  std::uint64_t task_bytes(std::size_t task) const override;
  std::uint64_t units() const override { return inputs_->bytes(); }
  std::string unit_name() const override { return "bytes"; }
  Json run(std::size_t task, TaskContext& context) const override;
  Json finish(const std::vector<Json>& summaries, TaskContext& context) const override;
  std::uint64_t finish_bytes() const override { return survey_finish_bytes(job_.run, inputs_->bytes()); }
  std::vector<std::string> obsolete() const override {
    return measured() ? std::vector<std::string>{"spacing/"} : std::vector<std::string>{};
  }

 private:
  bool measured() const { return probed_ > 0; }  ///< h was, and not given
  std::size_t max_bricks() const;
  /// Spacing, noise, radius and estimated faces of the plan, from the sampled cells.
  /// \param blocks  occupied ones of 8^3 cells   \return in scan units
  PointClumps measure(std::size_t tasks, std::uint64_t blocks, const std::vector<BrickCount>& counts,
                      Plan& plan) const;

  JobState job_;
  ReconstructOptions options_;
  std::shared_ptr<const PointInputs> inputs_;
  double h_;
  std::uint64_t probed_;
};

/// Over the job's inputs, with h from the options or from the spacing stage.
std::unique_ptr<Stage> make_survey_stage(const JobState& job);

/// Points per bucket: sorting one takes at most its share of the cap, and files stay few.
std::uint64_t bucket_target(const RunOptions& run, std::uint64_t points);

}  // namespace tessera
