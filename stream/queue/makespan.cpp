#include "stream/queue/makespan.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <map>
#include <queue>

#include "octree/error.h"
#include "stream/files/json.h"

namespace tessera {
namespace {

constexpr const char *kProcessors = "processors", *kFileSystem = "file system",
                     *kLongestTask = "longest task", *kSerial = "serial";

/// Seconds of one element with so many tasks, each as long as the mean.
double element_seconds(const StageCost& stage, double tasks, const Cluster& cluster) {
  if (tasks == 0.0) return cluster.start_seconds;
  const double mean = stage.task_seconds / static_cast<double>(stage.tasks);
  return cluster.start_seconds + std::ceil(tasks / cluster.threads) * mean;
}

/// Elements in their order, each on the node that is free first.
double array_seconds(const StageCost& stage, int elements, const Cluster& cluster) {
  std::priority_queue<double, std::vector<double>, std::greater<>> free;
  for (int n = 0; n < std::min(cluster.nodes, elements); ++n) free.push(0.0);
  const auto share = static_cast<double>(stage.tasks / static_cast<std::uint64_t>(elements));
  const auto more = static_cast<int>(stage.tasks % static_cast<std::uint64_t>(elements));
  double end = 0.0;
  for (int e = 0; e < elements; ++e) {
    const double until = free.top() + element_seconds(stage, share + (e < more ? 1.0 : 0.0), cluster);
    free.pop();
    free.push(until);
    end = std::max(end, until);
  }
  return end;
}

class Player {
 public:
  Player(const std::vector<StageCost>& stages, const Cluster& cluster) : cluster_(cluster) {
    for (const StageCost& stage : stages) stages_[stage.stage] = &stage;
  }

  /// On the machine of whoever submits.
  StepSpan plan(const std::vector<StageCost>& stages) const {
    QueueStep step;
    step.name = "plan";
    for (const StageCost& stage : stages) step.lines.push_back({stage.stage, "all"});
    return serial(step);
  }

  StepSpan play(const QueueStep& step) const {
    StepSpan span =
        step.lines.size() == 1 && step.lines.front().choice == "share" ? array(step) : serial(step);
    span.seconds += cluster_.chain_seconds;
    return span;
  }

 private:
  StepSpan array(const QueueStep& step) const {
    const StageCost& stage = *stages_.at(step.lines.front().stage);
    StepSpan span{step, array_seconds(stage, step.elements, cluster_), stage.moved_bytes, kProcessors};
    bound(span, cluster_.start_seconds + stage.longest_task, kLongestTask);
    bound(span, io_seconds(span.moved_bytes), kFileSystem);
    return span;
  }

  StepSpan serial(const QueueStep& step) const {
    StepSpan span{step, cluster_.start_seconds, 0.0, kSerial};
    for (const QueueLine& line : step.lines) {
      const StageCost& stage = *stages_.at(line.stage);
      span.seconds += stage.end_seconds;
      if (line.choice == "finish") continue;  // what it moves is counted with its array
      span.moved_bytes += stage.moved_bytes;
      if (stage.tasks > 0)
        span.seconds += std::max(
            stage.longest_task,
            stage.task_seconds / std::min<double>(cluster_.threads, static_cast<double>(stage.tasks)));
    }
    bound(span, io_seconds(span.moved_bytes), kFileSystem);
    return span;
  }

  double io_seconds(double bytes) const { return cluster_.io_rate > 0.0 ? bytes / cluster_.io_rate : 0.0; }
  static void bound(StepSpan& span, double seconds, const char* by) {
    if (seconds > span.seconds) span.seconds = seconds, span.bound = by;
  }

  const Cluster& cluster_;
  std::map<std::string, const StageCost*> stages_;
};

}  // namespace

std::vector<StageCost> stage_costs(const Json& report, const std::string& name) {
  std::vector<StageCost> stages;
  try {
    for (const Json& s : report.at("stages"))
      stages.push_back({s.at("name").string(), s.at("tasks").natural(), s.at("tasks_s").number(),
                        s.at("longest_task_s").number(), s.at("end_s").number(),
                        s.at("bytes_read").number() + s.at("bytes_written").number()});
  } catch (const JsonError& e) {
    throw InputError(name + ": is no report of a job of this version (" + e.what() + ")");
  }
  return stages;
}

std::vector<StageCost> scaled(std::vector<StageCost> stages, double factor) {
  for (StageCost& stage : stages) {
    // What had one task may have had it for being small.
    if (stage.tasks > 0)
      stage.tasks =
          static_cast<std::uint64_t>(std::max(1.0, std::round(static_cast<double>(stage.tasks) * factor)));
    stage.task_seconds *= factor;
    stage.end_seconds *= factor;
    stage.moved_bytes *= factor;
    if (stage.tasks > 0)
      stage.longest_task = std::clamp(
          stage.longest_task, stage.task_seconds / static_cast<double>(stage.tasks), stage.task_seconds);
  }
  return stages;
}

Makespan makespan(const std::vector<StageCost>& stages, std::size_t planning, const Cluster& cluster,
                  QueueOptions options) {
  options.nodes = cluster.nodes;
  const auto queued = stages.begin() + static_cast<std::ptrdiff_t>(std::min(planning, stages.size()));
  std::vector<StageEstimate> estimates;
  for (auto s = queued; s != stages.end(); ++s)
    estimates.push_back({s->stage, s->tasks, s->task_seconds / cluster.threads, 0, 0, s->tasks == 0});

  Makespan estimate;
  for (const StageCost& stage : stages) estimate.work_seconds += stage.task_seconds + stage.end_seconds;
  const Player player(stages, cluster);
  if (queued != stages.begin()) estimate.steps.push_back(player.plan({stages.begin(), queued}));
  for (const QueueStep& step : queue_steps(estimates, 0, cluster.threads, options))
    estimate.steps.push_back(player.play(step));
  for (const StepSpan& span : estimate.steps) {
    estimate.seconds += span.seconds;
    if (span.bound == kSerial) estimate.serial_seconds += span.seconds;
    estimate.busiest_io = std::max(estimate.busiest_io, span.moved_bytes / span.seconds);
  }
  if (estimate.seconds > 0.0)
    estimate.efficiency = estimate.work_seconds / (estimate.seconds * cluster.nodes * cluster.threads);
  return estimate;
}

}  // namespace tessera
