/// \file stage.h
/// What a stage is to the job runtime: a fixed number of idempotent tasks and one finish.
/// A stage reads what earlier stages committed, a task writes files aside, the runtime commits them.
#pragma once
#include <cstdint>
#include <filesystem>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "stream/files/json.h"
#include "stream/runtime/options.h"

namespace tessera {

/// Handed to a running task. Thread-safe with respect to other tasks.
class TaskContext {
 public:
  virtual ~TaskContext() = default;
  /// Path to write an output file under for now; the runtime syncs it and gives it the name `name` (relative to
  /// the work directory, folders made as needed) when the task returns. Names of different tasks differ.
  virtual std::filesystem::path create(const std::string& name) = 0;
  /// Throws StoppedError once the user asked to stop; call it at least every 100 ms of work.
  virtual void check_stop() const = 0;
  /// Progress in the stage's unit (points, bricks, faces), any thread.
  virtual void advance(std::uint64_t units) = 0;
  virtual void count_read(std::uint64_t bytes) = 0;
  virtual void count_written(std::uint64_t bytes) = 0;
};

/// Everything a stage may know of its job.
struct JobState {
  std::filesystem::path work;    ///< work directory
  std::filesystem::path output;  ///< final output path
  std::vector<std::filesystem::path> inputs;
  std::string settings;  ///< what it computes: the job's own options as one JSON object (option_table.h)
  RunOptions run;        ///< memory_bytes and threads are resolved, never 0
  /// Read by the command line beside the inputs, as its job file: never written over.
  std::vector<std::filesystem::path> also_read = {};
};

/// One stage. Constructed (by its factory) after all earlier stages are committed; run() and task_bytes() are
/// const and called from several threads.
class Stage {
 public:
  virtual ~Stage() = default;
  virtual std::string name() const = 0;
  virtual std::size_t task_count() const = 0;
  /// Upper bound of the memory the task allocates, bytes. Known before it starts.
  virtual std::uint64_t task_bytes(std::size_t task) const = 0;
  /// Units of progress of the whole stage, and their name.
  virtual std::uint64_t units() const = 0;
  virtual std::string unit_name() const = 0;
  /// Pure in what it writes: same inputs and options, same bytes, on any thread, on any retry.
  /// Returns a small summary, journaled, handed to finish() in task order.
  virtual Json run(std::size_t task, TaskContext& context) const = 0;
  /// Once, after the last task: reduces summaries (task order), may create files, returns the stage's entry in the
  /// report. Runs as one more journaled task. Sentences under `warnings` are logged, and shown when the job is done.
  virtual Json finish(const std::vector<Json>& summaries, TaskContext& context) const = 0;
  /// Upper bound of the memory finish() allocates.
  virtual std::uint64_t finish_bytes() const = 0;
  /// Files of earlier stages, or of its own tasks, that nobody needs once this stage is committed (relative names;
  /// a folder ends in '/').
  virtual std::vector<std::string> obsolete() const { return {}; }
};

/// Memory that a stage takes for its largest task or its end, told before it is made.
struct StageNeed {
  std::string stage;
  std::uint64_t sure = 0;    ///< less does not do, unless the data lie very unevenly
  std::uint64_t likely = 0;  ///< this does; 0 = the same
};

using StageFactory = std::function<std::unique_ptr<Stage>(const JobState&)>;
/// Of a stage of `reconstruct`, what it will need, from what the survey knows (stages/plan).
struct StageForecast;
struct PlannedScan;
using StageForecaster = std::function<StageForecast(const PlannedScan&)>;

struct StageEntry {
  std::string name;
  StageFactory make;
  StageForecaster forecast = nullptr;  ///< none: nothing, but what its end reserves
};

}  // namespace tessera
