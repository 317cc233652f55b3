/// \file task_run.h
/// Tasks of a job that nobody drives: processes on any number of machines that share its work directory do them, each a
/// task, a share of a stage, or a whole stage.
///
/// What holds however many there are, and though none sees locks of another machine, its clock differs, and what others
/// have committed shows up late: a process writes only files of its own until it commits (commit.h) and journals to a file
/// of its own; a task that is done twice ends in one result, since both make the same bytes; whoever misses what others
/// should have committed looks again for `patience_s` seconds before it says so.
#pragma once
#include <cstdint>
#include <filesystem>
#include <string>

#include "stream/runtime/job.h"

namespace tessera {

/// Which tasks of a stage one process does.
struct TaskChoice {
  enum class Kind {
    kTask,   ///< `first`, or kFinishTask
    kShare,  ///< tasks first, first + step, first + 2 step, ...
    kAll     ///< all tasks, then finish
  };
  Kind kind = Kind::kTask;
  std::int64_t first = 0;
  std::int64_t step = 1;
};

/// "12", "finish", "3/16" (the fourth of sixteen shares) or "all". \throws UsageError for anything else
TaskChoice parse_task_choice(const std::string& text);

struct TaskRunOptions {
  std::string writer;       ///< name of the journal file of a driven process; empty = one of its own
  bool driven = false;      ///< a run_job() of this machine holds the job and waits for this process
  double patience_s = 0.0;  ///< for what other machines committed to show up
  std::filesystem::path scratch = {};  ///< TaskAids::scratch
};

/// Does what of the choice is not committed yet; nothing to do is no error. What the end of a stage makes obsolete goes
/// with it, unless the job keeps its work directory.
/// \throws UsageError for an unknown stage or task, or when what it builds on is not committed (yet); ResourceError when
///   the cap of the job cannot hold a task; StoppedError after a signal; what stages throw
void run_tasks(const std::filesystem::path& work, const JobFinder& find_job, const std::string& stage,
               const TaskChoice& choice, const TaskRunOptions& options);

}  // namespace tessera
