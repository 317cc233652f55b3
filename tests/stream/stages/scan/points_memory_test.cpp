#include <catch2/catch.hpp>

#include "stream/stages/scan/probe_stage.h"
#include "tests/helpers/memory_growth.h"
#include "tests/helpers/point_chain.h"
#include "tests/helpers/random_points.h"
#include "tests/helpers/skip.h"

namespace points_memory_test {

using namespace tessera;
using namespace tessera::test;

namespace {

/// Every task and the finish stay within what they announce.
void check_stage(const Stage& stage, const std::filesystem::path& work) {
  SerialContext context(work);
  std::vector<Json> summaries;
  for (std::size_t k = 0; k < stage.task_count(); ++k) {
    const std::uint64_t grown = growth_of([&] { stage.run(k, context); });
    INFO(stage.name() << " task " << k << " took " << grown << " of " << stage.task_bytes(k));
    CHECK(grown <= stage.task_bytes(k));
    summaries.push_back(stage.run(k, context));
  }
  const std::uint64_t grown = growth_of([&] { stage.finish(summaries, context); });
  INFO(stage.name() << " finish took " << grown << " of " << stage.finish_bytes());
  CHECK(grown <=
        stage.finish_bytes() + (std::uint64_t{1} << 20));  // a process of its own has pages of its own
  stage.finish(summaries, context);
}

}  // namespace

TEST_CASE("memory: passes over points stay within what they announce", "[memory]") {
#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
  test::skip("the sanitizer's shadow and quarantine count as resident memory");
  return;
#endif
  const TempFolder work;
  ChainSetup setup;
  setup.slice_points = setup.task_points = 1500000;
  std::vector<TestPoint> points;
  SECTION("an even scan") {
    points = sphere_points(1500000, 400.0, {0, 0, 0});
  }
  SECTION("a hot brick, without order") {
    points = sphere_points(1000000, 20.0, {0, 0, 0});
    const auto more = sphere_points(200000, 400.0, {0, 0, 0}, 2);
    points.insert(points.end(), more.begin(), more.end());
    shuffle(points, 1);
    setup.options.max_brick_points = 100000;
  }
  SECTION("one point per brick") {
    Random random(3);
    for (int i = 0; i < 300000; ++i)
      points.push_back({{random.in(0, 1e5), random.in(0, 1e5), random.in(0, 1e5)}, {}, 0});
  }
  const JobState job = chain_job(work.path(), setup);
  const auto inputs = chain_inputs(points, setup);
  points = {};
  JobState automatic = job;
  automatic.settings = to_settings(setup.options);
  check_stage(*make_probe_stage(automatic, inputs), job.work);
  check_stage(*make_spacing_stage(automatic, inputs), job.work);
  check_stage(SurveyStage(job, inputs, setup.h, 0), job.work);
  check_stage(DistributeStage(job, inputs), job.work);
  check_stage(OrderStage(job), job.work);
}

}  // namespace points_memory_test
