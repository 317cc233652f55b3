#include "stream/queue/queue_steps.h"

#include <algorithm>
#include <cmath>

namespace tessera {
namespace {

constexpr double kMinSeconds = 2.0;      ///< of an element: starting one takes about one
constexpr double kStartSeconds = 180.0;  ///< to start, and to stop ahead of the limit
constexpr int kMinMinutes = 5;

int elements_of(const StageEstimate& stage, const QueueOptions& options) {
  if (stage.idle) return 1;
  const double wanted = std::ceil(stage.seconds / options.element_seconds);
  const double spread = std::min(static_cast<double>(options.nodes),
                                 std::floor(stage.seconds / std::min(kMinSeconds, options.element_seconds)));
  double count = std::clamp(std::max(wanted, spread), 1.0, static_cast<double>(options.array_limit));
  if (stage.tasks > 0) count = std::min(count, static_cast<double>(stage.tasks));
  return static_cast<int>(count);
}

std::uint64_t memory_of(std::uint64_t need, std::uint64_t cap) {
  // What the budget leaves for the allocator and the stacks of threads is a part of the cap.
  return need == 0 ? cap + kQueueBaseBytes : std::min(cap, need + need / 4 + cap / 16) + kQueueBaseBytes;
}

/// Time of the element with most tasks.
double longest_element(const StageEstimate& stage, int elements) {
  if (stage.tasks == 0) return elements > 1 ? 2.0 * stage.seconds / elements : stage.seconds;
  const auto maximum =
      (stage.tasks + static_cast<std::uint64_t>(elements) - 1) / static_cast<std::uint64_t>(elements);
  return stage.seconds * static_cast<double>(maximum) / static_cast<double>(stage.tasks);
}

/// A job under way whose parts run one after the other.
class SerialStep {
 public:
  void add(const QueueLine& line, double seconds, std::uint64_t memory) {
    if (step_.lines.empty() || seconds > longest_) step_.name = line.stage, longest_ = seconds;
    step_.lines.push_back(line);
    step_.seconds += seconds;
    step_.memory_bytes = std::max(step_.memory_bytes, memory);
  }
  void flush(std::vector<QueueStep>& steps) {
    if (!step_.lines.empty()) steps.push_back(step_);
    *this = {};
  }

 private:
  QueueStep step_;
  double longest_ = 0.0;
};

}  // namespace

std::vector<QueueStep> queue_steps(const std::vector<StageEstimate>& stages, std::uint64_t cap, int threads,
                                   const QueueOptions& options) {
  std::vector<QueueStep> steps;
  SerialStep serial;
  for (const StageEstimate& stage : stages) {
    const int elements = elements_of(stage, options);
    const auto at_once = static_cast<std::uint64_t>(threads);
    const std::uint64_t tasks_memory = memory_of(stage.task_bytes * at_once, cap);
    const std::uint64_t end_memory = memory_of(stage.finish_bytes, cap);
    if (elements == 1) {
      serial.add({stage.stage, "all"}, stage.seconds, stage.idle ? 0 : std::max(tasks_memory, end_memory));
      continue;
    }
    serial.flush(steps);
    steps.push_back(
        {stage.stage, {{stage.stage, "share"}}, elements, tasks_memory, longest_element(stage, elements)});
    serial.add({stage.stage, "finish"}, 0.0, end_memory);
  }
  serial.flush(steps);
  for (QueueStep& step : steps)
    if (step.memory_bytes == 0) step.memory_bytes = cap + kQueueBaseBytes;
  return steps;
}

int minutes_of(const QueueStep& step, const QueueOptions& options) {
  return std::max(kMinMinutes,
                  static_cast<int>(std::ceil((step.seconds * options.time_margin + kStartSeconds) / 60.0)));
}

}  // namespace tessera
