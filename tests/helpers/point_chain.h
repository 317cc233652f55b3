/// \file point_chain.h
/// Survey, distribute and order over points in memory, and what comes out.
#pragma once
#include <memory>
#include <vector>

#include "stream/files/task_files.h"
#include "stream/points/plan.h"
#include "stream/points/reconstruct_options.h"
#include "stream/stages/scan/distribute_stage.h"
#include "stream/stages/scan/order_stage.h"
#include "stream/stages/scan/survey_stage.h"
#include "tests/helpers/memory_points.h"
#include "tests/helpers/serial_job.h"
#include "tests/helpers/stored_points.h"

namespace tessera::test {

struct ChainSetup {
  double h = 1.0;
  std::size_t files = 1;
  std::size_t slice_points = 1000;
  std::size_t task_points = 1000;
  std::uint64_t memory = std::uint64_t{1} << 30;
  int threads = 2;
  bool backwards = false;
  ReconstructOptions options;
};

struct ChainResult {
  Plan plan;
  std::vector<PlanBrick> bricks;
  std::vector<PointRecord> points;  ///< of all bricks, in order
  tessera::Json survey, distribute, order;
};

inline JobState chain_job(const std::filesystem::path& work, const ChainSetup& setup) {
  JobState job;
  job.work = work;
  job.output = work / "out.ply";
  ReconstructOptions options = setup.options;
  options.resolution = setup.h;
  job.settings = to_settings(options);
  job.run.memory_bytes = setup.memory;
  job.run.threads = setup.threads;
  return job;
}

inline std::shared_ptr<const PointInputs> chain_inputs(const std::vector<TestPoint>& points,
                                                       const ChainSetup& setup) {
  std::vector<std::unique_ptr<PointFile>> files;
  for (std::size_t f = 0; f < setup.files; ++f) {
    const std::size_t begin = points.size() * f / setup.files;
    const std::size_t end = points.size() * (f + 1) / setup.files;
    files.push_back(std::make_unique<MemoryPoints>(
        std::vector<TestPoint>(points.begin() + static_cast<std::ptrdiff_t>(begin),
                               points.begin() + static_cast<std::ptrdiff_t>(end)),
        setup.slice_points));
  }
  return std::make_shared<PointInputs>(std::move(files), setup.options, setup.task_points * 24);
}

inline ChainResult run_chain(const std::vector<TestPoint>& points, const ChainSetup& setup = {}) {
  const TempFolder work;
  const JobState job = chain_job(work.path(), setup);
  const auto inputs = chain_inputs(points, setup);
  ChainResult r;
  r.survey = run_stage(SurveyStage(job, inputs, setup.h, 0), job.work, setup.backwards);
  r.distribute = run_stage(DistributeStage(job, inputs), job.work, setup.backwards);
  r.order = run_stage(OrderStage(job), job.work, setup.backwards);
  r.plan = Plan::of_work(job.work);
  r.bricks = load_plan_bricks(job.work / Plan::kBrickFile);
  r.points = stored_points(list_task_files(job.work / "points", ".tsp"));
  return r;
}

/// World position of a record.
inline Double3 world_of(const Plan& plan, const PointRecord& p) {
  Double3 w{};
  for (std::size_t a = 0; a < 3; ++a)
    w[a] = plan.lattice.world(static_cast<int>(a), static_cast<double>(p.q[a]) / kQuantaPerCell);
  return w;
}

}  // namespace tessera::test
