#include "stream/queue/makespan.h"
#include "stream/files/json.h"

#include <catch2/catch.hpp>

#include "octree/error.h"

namespace makespan_test {

using namespace tessera;
using Catch::Matchers::WithinRel;

namespace {

/// No queue, no file system: what remains is the work.
Cluster bare(int nodes, int threads = 1) {
  return {nodes, threads, 0.0, 0.0, 0.0};
}
QueueOptions fine() {
  QueueOptions options;
  options.element_seconds = 1.0;
  return options;
}

}  // namespace

TEST_CASE("makespan: one core takes the sum of all, and is never idle", "[unit]") {
  const std::vector<StageCost> stages = {{"a", 40, 80.0, 2.0, 3.0, 0.0}, {"b", 0, 0.0, 0.0, 5.0, 0.0}};
  const Makespan estimate = makespan(stages, 0, bare(1), fine());
  CHECK_THAT(estimate.seconds, WithinRel(88.0, 1e-12));
  CHECK_THAT(estimate.work_seconds, WithinRel(88.0, 1e-12));
  CHECK_THAT(estimate.serial_seconds, WithinRel(8.0, 1e-12));
  CHECK_THAT(estimate.efficiency, WithinRel(1.0, 1e-12));
}

TEST_CASE("makespan: nodes share the tasks, ends stay serial", "[unit]") {
  const std::vector<StageCost> stages = {{"a", 40, 80.0, 2.0, 4.0, 0.0}};
  CHECK_THAT(makespan(stages, 0, bare(4), fine()).seconds, WithinRel(24.0, 1e-12));
  CHECK_THAT(makespan(stages, 0, bare(4), fine()).efficiency, WithinRel(84.0 / 96.0, 1e-12));
  // A task each at most; more nodes find nothing to do.
  CHECK_THAT(makespan(stages, 0, bare(40), fine()).seconds, WithinRel(6.0, 1e-12));
  CHECK_THAT(makespan(stages, 0, bare(400), fine()).seconds, WithinRel(6.0, 1e-12));
  // Threads of one element share its tasks, where it has more than one.
  CHECK_THAT(makespan(stages, 0, bare(2, 2), fine()).seconds, WithinRel(44.0, 1e-12));
  CHECK_THAT(makespan(stages, 0, bare(2, 2), {}).seconds, WithinRel(24.0, 1e-12));
}

TEST_CASE("makespan: the file system and a long task bound an array", "[unit]") {
  std::vector<StageCost> stages = {{"a", 40, 80.0, 2.0, 0.0, 1e9}};
  Cluster cluster = bare(8);
  cluster.io_rate = 2e7;
  const Makespan slow = makespan(stages, 0, cluster, fine());
  CHECK_THAT(slow.seconds, WithinRel(50.0, 1e-12));
  CHECK(slow.steps.at(0).bound == "file system");
  CHECK_THAT(slow.busiest_io, WithinRel(2e7, 1e-12));
  stages[0] = {"a", 40, 80.0, 30.0, 0.0, 0.0};
  const Makespan uneven = makespan(stages, 0, bare(8), fine());
  CHECK_THAT(uneven.seconds, WithinRel(30.0, 1e-12));
  CHECK(uneven.steps.at(0).bound == "longest task");
}

TEST_CASE("makespan: every element starts, every job waits in the queue", "[unit]") {
  Cluster cluster = bare(2);
  cluster.start_seconds = 0.5;
  cluster.chain_seconds = 7.0;
  // Eight elements of 10 s on two nodes, then the end.
  QueueOptions options;
  options.element_seconds = 10.0;
  const Makespan estimate = makespan({{"a", 40, 80.0, 2.0, 3.0, 0.0}}, 0, cluster, options);
  REQUIRE(estimate.steps.size() == 2);
  CHECK(estimate.steps[0].step.elements == 8);
  CHECK_THAT(estimate.steps[0].seconds, WithinRel(4 * 10.5 + 7.0, 1e-12));
  CHECK_THAT(estimate.steps[1].seconds, WithinRel(0.5 + 3.0 + 7.0, 1e-12));
}

TEST_CASE("makespan: the plan is made on one machine, before the queue", "[unit]") {
  Cluster cluster = bare(8, 2);
  cluster.chain_seconds = 7.0;
  const std::vector<StageCost> stages = {
      {"survey", 10, 40.0, 4.0, 1.0, 0.0}, {"forecast", 0, 0.0, 0.0, 1.0, 0.0}, {"a", 0, 0.0, 0.0, 5.0, 0.0}};
  const Makespan estimate = makespan(stages, 2, cluster, fine());
  REQUIRE(estimate.steps.size() == 2);
  CHECK(estimate.steps[0].step.name == "plan");
  CHECK_THAT(estimate.steps[0].seconds, WithinRel(22.0, 1e-12));
  CHECK_THAT(estimate.steps[1].seconds, WithinRel(12.0, 1e-12));
  CHECK_THAT(estimate.serial_seconds, WithinRel(34.0, 1e-12));
}

TEST_CASE("makespan: more of the same kind means more tasks of the same size", "[unit]") {
  const std::vector<StageCost> ten =
      scaled({{"a", 40, 80.0, 3.0, 4.0, 100.0}, {"b", 0, 0.0, 0.0, 2.0, 0.0}}, 10);
  CHECK(ten[0].tasks == 400);
  CHECK_THAT(ten[0].task_seconds, WithinRel(800.0, 1e-12));
  CHECK_THAT(ten[0].longest_task, WithinRel(3.0, 1e-12));
  CHECK_THAT(ten[0].end_seconds, WithinRel(40.0, 1e-12));
  CHECK_THAT(ten[0].moved_bytes, WithinRel(1000.0, 1e-12));
  CHECK(ten[1].tasks == 0);
  CHECK_THAT(ten[1].end_seconds, WithinRel(20.0, 1e-12));
  // Less than one task is one that is short.
  const std::vector<StageCost> less = scaled({{"a", 4, 8.0, 2.0, 0.0, 0.0}}, 0.01);
  CHECK(less[0].tasks == 1);
  CHECK_THAT(less[0].longest_task, WithinRel(0.08, 1e-12));
}

TEST_CASE("makespan: costs are read from a report, and from nothing else", "[unit]") {
  Json stage = {{"name", "order"}, {"tasks", 3},      {"tasks_s", 6.0},     {"longest_task_s", 2.5},
                {"end_s", 0.5},    {"bytes_read", 7}, {"bytes_written", 11}};
  const std::vector<StageCost> costs = stage_costs({{"stages", {stage}}}, "r.json");
  REQUIRE(costs.size() == 1);
  CHECK(costs[0].stage == "order");
  CHECK(costs[0].tasks == 3);
  CHECK(costs[0].moved_bytes == 18.0);
  stage.erase("end_s");
  CHECK_THROWS_AS(stage_costs({{"stages", {stage}}}, "r.json"), InputError);
  CHECK_THROWS_AS(stage_costs(Json::array(), "r.json"), InputError);
}

}  // namespace makespan_test
