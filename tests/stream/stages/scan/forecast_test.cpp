#include "stream/stages/scan/forecast.h"

#include <catch2/catch.hpp>

#include "octree/error.h"
#include "stream/stages/scan/normals_stage.h"
#include "stream/stages/surface/closing_stages.h"
#include "tests/helpers/point_chain.h"
#include "tests/helpers/random_points.h"

using namespace tessera;
using namespace tessera::test;

TEST_CASE("forecast: disk of the passes over points is what they write", "[unit]") {
  const TempFolder work;
  ChainSetup setup;
  const auto points = sphere_points(50000, 60.0, {0, 0, 0});
  const JobState job = chain_job(work.path(), setup);
  const auto inputs = chain_inputs(points, setup);
  run_stage(SurveyStage(job, inputs, setup.h, false), job.work);
  const Plan plan = Plan::of_work(job.work);
  run_stage(DistributeStage(job, inputs), job.work);
  run_stage(OrderStage(job), job.work);
  const auto written = [&](const char* folder) {
    std::uint64_t bytes = 0;
    for (const auto& f : std::filesystem::directory_iterator(job.work / folder)) bytes += f.file_size();
    return static_cast<double>(bytes);
  };
  REQUIRE(plan.forecast.size() >= 4);
  CHECK(plan.forecast[0].stage == "distribute");
  CHECK(static_cast<double>(plan.forecast[0].disk_bytes) == Approx(written("distribute")).epsilon(0.02));
  CHECK(plan.forecast[1].stage == "order");
  // Every 17th point is a duplicate, which the forecast cannot know.
  CHECK(static_cast<double>(plan.forecast[1].disk_bytes) == Approx(written("points")).epsilon(0.08));
  CHECK(plan.peak_disk_bytes >= plan.forecast[0].disk_bytes + plan.forecast[1].disk_bytes);
  // A sphere of radius 60 h has about 3 x 4 pi 60^2 triangles.
  CHECK(static_cast<double>(plan.faces_estimate) == Approx(3 * 4 * 3.14159 * 3600).epsilon(0.25));
}

TEST_CASE("forecast: closing and decimation have their stages, with the disk that they take", "[unit]") {
  const TempFolder work;
  ChainSetup setup;
  setup.options.holes = "close";
  setup.options.tolerance = 0.1;
  auto points = sphere_points(50000, 60.0, {0, 0, 0});
  std::erase_if(points, [](const TestPoint& p) { return p.p[2] > 50.0; });
  const JobState job = chain_job(work.path(), setup);
  const auto inputs = chain_inputs(points, setup);
  run_stage(SurveyStage(job, inputs, setup.h, false), job.work);
  run_stage(DistributeStage(job, inputs), job.work);
  run_stage(OrderStage(job), job.work);
  run_stage(*make_normals_stage(job), job.work);
  run_stage(*make_orient_stage(job), job.work);
  run_stage(*make_multipole_stage(job), job.work);
  run_stage(*make_rims_stage(job), job.work);
  const Plan plan = Plan::of_work(job.work);
  std::vector<std::string> names;
  double multipole = 0, rims = 0;
  for (const StageForecast& f : plan.forecast) {
    names.push_back(f.stage);
    if (f.stage == "multipole") multipole = static_cast<double>(f.disk_bytes);
    if (f.stage == "rims") rims = static_cast<double>(f.disk_bytes);
  }
  CHECK(names == std::vector<std::string>{"distribute", "order", "normals", "multipole", "rims", "close",
                                          "surface", "pass-2", "pass-3", "certify", "write"});
  const auto written = [&](const char* folder) {
    std::uint64_t bytes = 0;
    for (const auto& f : std::filesystem::directory_iterator(job.work / folder)) bytes += f.file_size();
    return static_cast<double>(bytes);
  };
  CHECK(multipole == Approx(written("multipole")).epsilon(0.3));
  CHECK(rims == Approx(written("rims")).epsilon(0.3));
}

TEST_CASE("forecast: what cap or disk cannot carry is refused with the smallest that would", "[unit]") {
  const TempFolder work;
  const JobState job = chain_job(work.path(), {});
  Forecast forecast;
  CHECK_NOTHROW(require_resources(forecast, job));
  forecast.least_task_bytes = std::uint64_t{3} << 30;
  CHECK_THROWS_WITH(require_resources(forecast, job), Catch::Contains("--memory 3"));
  forecast.least_task_bytes = 0;
  forecast.peak_disk_bytes = std::uint64_t{1} << 60;
  CHECK_THROWS_WITH(require_resources(forecast, job), Catch::Contains("--temp"));
  CHECK_THROWS_AS(require_resources(forecast, job), ResourceError);
}
