#include "stream/stages/reconstruct/forecast_stage.h"

#include <algorithm>

#include "stream/files/durable_file.h"
#include "stream/files/json_fields.h"
#include "stream/meshes/patch_store.h"
#include "stream/points/point_inputs.h"
#include "stream/points/point_store.h"
#include "stream/points/reconstruct_options.h"
#include "stream/runtime/memory_budget.h"
#include "stream/runtime/serial_stage.h"
#include "stream/stages/reconstruct/forecast.h"
#include "stream/stages/scan/survey_stage.h"

namespace tessera {
namespace {

/// Tables of points, normals, patches, of a brick.
constexpr std::uint64_t kLaterBrickBytes = 56 + 64 + 64;

class ForecastStage : public SerialStage {
 public:
  explicit ForecastStage(const JobState& job) : job_(job), plan_(Plan::of_work(job.work)) {}

  std::string name() const override { return "forecast"; }
  std::uint64_t units() const override { return 0; }
  std::string unit_name() const override { return "stages"; }
  std::uint64_t finish_bytes() const override {
    return plan_.bricks * (2 * sizeof(PlanBrick) + sizeof(BrickEntry) + 2 * sizeof(PatchEntry) + 128) +
           (std::uint64_t{2} << 20);
  }

  Json finish(const std::vector<Json>&, TaskContext& context) const override {
    const std::uint64_t base = MemoryBudget::expected_base(plan_.bricks * kLaterBrickBytes);
    const std::vector<PlanBrick> bricks = load_plan_bricks(job_.work / Plan::kBrickFile);
    const auto opened = open_point_inputs(job_, false);
    InputTasks inputs{opened->task_count(), 0, 0};
    for (std::size_t k = 0; k < inputs.count; ++k) {
      inputs.largest_bytes = std::max(inputs.largest_bytes, opened->task_input_bytes(k));
      inputs.unpacked_bytes += opened->unpacked_bytes(k);
    }
    const Forecast forecast = forecast_job(plan_, bricks, inputs, job_);
    require_resources(forecast, job_, base, [&](std::uint64_t cap) {
      JobState job = job_;
      job.run.memory_bytes = cap;
      Plan plan = plan_;
      plan.buckets = cut_buckets(bricks, bucket_target(job.run, plan.points()),
                                 reconstruct_options(job).max_brick_points);
      return forecast_job(plan, bricks, inputs, job);
    });
    const Json j = fields_to_json(forecast);
    write_text(context.create(Forecast::kFile), dump_json(j, 1) + "\n");
    return {{"peak_disk_bytes", forecast.peak_disk_bytes}, {"output_bytes", forecast.output_bytes}};
  }

 private:
  JobState job_;
  Plan plan_;
};

}  // namespace

std::unique_ptr<Stage> make_forecast_stage(const JobState& state) {
  return std::make_unique<ForecastStage>(state);
}

}  // namespace tessera
