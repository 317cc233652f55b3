/// \file queue_steps.h
/// How a job becomes jobs of a batch queue: one array for each stage that is worth several processes, with its share of
/// the tasks in each element, and between them single jobs for what is serial: ends of stages, and short stages.
#pragma once
#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

namespace tessera {

/// What an element asks for beside its cap: program, shell, what the queue counts with it.
inline constexpr std::uint64_t kQueueBaseBytes = std::uint64_t{128} << 20;

/// What the forecast tells of a stage.
struct StageEstimate {
  std::string stage;
  std::uint64_t tasks = 0;         ///< 0 = not known
  double seconds = 0.0;            ///< of one element that does it all
  std::uint64_t task_bytes = 0;    ///< memory of its largest task; 0 = not known
  std::uint64_t finish_bytes = 0;  ///< of its end; 0 = not known
  bool idle = false;               ///< known to have nothing to do
};

struct QueueOptions {
  std::string partition;  ///< empty = the queue's default
  std::string account;
  int nodes = 1;                   ///< elements that may well run at once
  double time_margin = 2.0;        ///< time asked for by time forecast
  int array_limit = 1000;          ///< most elements of an array
  double element_seconds = 300.0;  ///< an element gets tasks for so long
  std::filesystem::path scratch;   ///< folder on a disk of each node; empty = none
  bool dry_run = false;
};

/// What an element runs of a stage: "all", "share" or "finish" (task_run.h).
struct QueueLine {
  std::string stage;
  std::string choice;
};

struct QueueStep {
  std::string name;              ///< of the stage that takes longest in it
  std::vector<QueueLine> lines;  ///< one after the other
  int elements = 1;
  std::uint64_t memory_bytes = 0;  ///< of an element
  double seconds = 0.0;            ///< of the longest element
};

/// \param cap      memory cap of an element \param threads  of an element
/// \returns steps in order, each to begin when all elements of the one before are done
std::vector<QueueStep> queue_steps(const std::vector<StageEstimate>& stages, std::uint64_t cap, int threads,
                                   const QueueOptions& options);

/// Minutes to ask for: what is forecast times the margin, and time to start and to stop in.
int minutes_of(const QueueStep& step, const QueueOptions& options);

}  // namespace tessera
