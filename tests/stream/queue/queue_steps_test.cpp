#include "stream/queue/queue_steps.h"

#include <catch2/catch.hpp>

namespace queue_steps_test {

using namespace tessera;

namespace {

constexpr std::uint64_t kCap = std::uint64_t{2} << 30;

std::vector<StageEstimate> stages_of(std::vector<double> seconds) {
  std::vector<StageEstimate> stages;
  for (const double s : seconds) {
    StageEstimate stage;
    stage.stage = std::string(1, static_cast<char>('a' + stages.size()));
    stage.seconds = s;
    stages.push_back(stage);
  }
  return stages;
}

std::string steps_text(const std::vector<QueueStep>& steps) {
  std::string text;
  for (const QueueStep& step : steps) {
    text += "[" + std::to_string(step.elements);
    for (const QueueLine& line : step.lines) text += " " + line.stage + ":" + line.choice;
    text += "]";
  }
  return text;
}

}  // namespace

TEST_CASE("queue steps: short stages share one job, long ones are arrays", "[unit]") {
  const QueueOptions options;
  CHECK(steps_text(queue_steps(stages_of({1, 2, 3}), kCap, 1, options)) == "[1 a:all b:all c:all]");
  CHECK(steps_text(queue_steps(stages_of({1, 1200, 3}), kCap, 1, options)) ==
        "[1 a:all][4 b:share][1 b:finish c:all]");
  CHECK(steps_text(queue_steps(stages_of({1200, 1200}), kCap, 1, options)) ==
        "[4 a:share][1 a:finish][4 b:share][1 b:finish]");
  CHECK(queue_steps({}, kCap, 1, options).empty());
}

TEST_CASE("queue steps: nodes share a stage that lasts, tasks and limit bound the elements", "[unit]") {
  QueueOptions options;
  options.nodes = 8;
  CHECK(queue_steps(stages_of({100}), kCap, 1, options)[0].elements == 8);
  CHECK(queue_steps(stages_of({5}), kCap, 1, options)[0].elements == 2);
  std::vector<StageEstimate> stages = stages_of({100});
  stages[0].tasks = 3;
  CHECK(queue_steps(stages, kCap, 1, options)[0].elements == 3);
  options.array_limit = 50;
  CHECK(queue_steps(stages_of({1e6}), kCap, 1, options)[0].elements == 50);
  stages[0].idle = true;
  CHECK(steps_text(queue_steps(stages, kCap, 1, options)) == "[1 a:all]");
}

TEST_CASE("queue steps: memory is what is forecast, at most the cap and the base, ends have their own",
          "[unit]") {
  QueueOptions options;
  options.nodes = 4;
  std::vector<StageEstimate> stages = stages_of({100, 1});
  const std::uint64_t unknown = queue_steps(stages, kCap, 1, options)[0].memory_bytes;
  CHECK(unknown > kCap);
  CHECK(unknown < kCap + (kCap >> 2));
  stages[0].task_bytes = 100 << 20;
  stages[0].finish_bytes = 700 << 20;
  const auto one = queue_steps(stages, kCap, 1, options);
  CHECK(one[0].memory_bytes < one[1].memory_bytes);
  CHECK(one[0].memory_bytes > stages[0].task_bytes);
  CHECK(queue_steps(stages, kCap, 4, options)[0].memory_bytes > one[0].memory_bytes);
  stages[0].task_bytes = 10 * kCap;
  CHECK(queue_steps(stages, kCap, 1, options)[0].memory_bytes == unknown);
}

TEST_CASE("queue steps: time is the forecast of the longest element with a margin", "[unit]") {
  QueueOptions options;
  std::vector<StageEstimate> stages = stages_of({3000});
  stages[0].tasks = 11;
  const auto steps = queue_steps(stages, kCap, 1, options);
  CHECK(steps[0].elements == 10);
  CHECK(steps[0].seconds == Approx(3000.0 * 2 / 11));
  const int minutes = minutes_of(steps[0], options);
  CHECK(minutes * 60 > 2 * steps[0].seconds);
  options.time_margin = 4;
  CHECK(minutes_of(steps[0], options) > minutes);
  CHECK(minutes_of({"a", {}, 1, 0, 0.0}, options) >= 2);
}

}  // namespace queue_steps_test
