/// \file commit.h
/// One task from its start to its journal line.
#pragma once
#include <chrono>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <memory>
#include <mutex>
#include <set>
#include <string>
#include <vector>

#include "stream/runtime/journal.h"
#include "stream/runtime/progress.h"
#include "stream/runtime/stage.h"
#include "stream/runtime/task_notes.h"

namespace tessera {

/// What the loops of a task took, in processor seconds: how it would spread over more cores can be told from it.
struct LoopSeconds {
  double all = 0.0;       ///< on all threads
  double here = 0.0;      ///< on the thread that began them
  double in_order = 0.0;  ///< of `all`, in use() of parallel_in_order()
};

/// While it lives, loops that the thread which made it begins are added up; loops inside loops count with those around.
class LoopClock {
 public:
  LoopClock();
  ~LoopClock();
  LoopClock(const LoopClock&) = delete;
  LoopClock& operator=(const LoopClock&) = delete;
  /// \pre no loop is running
  LoopSeconds seconds() const;
  struct Impl;

 private:
  std::unique_ptr<Impl> impl_;
};

/// Where a name of TaskContext::create() lies in the end.
std::filesystem::path committed_path(const JobState& state, const std::string& name);

/// What a file is called until it is committed: every writer has names of its own, so that two machines that do one task
/// do not write into one file. The job's output alone is called the same by all, since tasks may fill it
/// together: of such a stage nothing may be done twice at once.
std::filesystem::path aside_path(const std::filesystem::path& final_path, const std::string& writer = "");

/// True if every file of the record is there with its size and (if `hash`) its content.
bool files_match(const JobState& state, const TaskRecord& record, bool hash);

/// What a job did in its first moments is done again as quickly as it would be forced to the disk file by file, so it is not:
/// where the machine fails then, files do not match their lines of the journal, and their tasks are done again (resume.h). The
/// first task that ends later brings everything to the disk. What others get to see, the output, never waits.
class LateSync {
 public:
  /// \param young  the job begins now; false: nothing is put off
  explicit LateSync(bool young) : young_(young) {}
  /// Whether syncs may be put off still. When that is over it first syncs what was.
  bool puts_off();
  /// A file or folder to be synced later, or at once where all was. \pre it is there, under the name that it keeps
  void add(const std::filesystem::path& path);
  /// Syncs all, but for what has gone since, and puts nothing off any more.
  void settle();

 private:
  std::mutex mutex_;
  std::chrono::steady_clock::time_point start_ = std::chrono::steady_clock::now();
  bool young_;
  std::set<std::filesystem::path> files_;
};

/// What a task may have beside its stage.
struct TaskAids {
  Progress* progress = nullptr;
  TaskNotes* notes = nullptr;
  /// Folder of this machine alone in which files are made first; empty = where they stay
  std::filesystem::path scratch = {};
  /// Whether another process has committed the task, and its record then. Asked when the work is done: what a task reads
  /// goes only after all tasks are committed, so work on files that were just going is never taken for a result.
  std::function<bool(TaskRecord&)> elsewhere = {};
  /// Where the machine fails before the next line of this writer, the task is to be done again. Only without files.
  bool lasting = true;
  /// Of a job that one process does alone; null: everything is synced at once.
  LateSync* late = nullptr;
};

/// Runs a task, or finish() for kFinishTask, and commits it: its files are synced, get their names, and one
/// journal line says so. Killed anywhere, the task is either committed or as if it had never run. A file of the same
/// content that another writer has committed meanwhile stays, so that whoever has it open can read on.
/// \param summaries    of all tasks in order; finish only
/// \param stage_stats  called for finish only, just before its line is written: TaskRecord::stage_stats
/// \throws what the stage throws; std::runtime_error naming stage and task for what is no tessera::Error
TaskRecord run_and_commit(const Stage& stage, std::int64_t task, const std::vector<Json>& summaries,
                          const JobState& state, const std::string& basis, const std::string& plan,
                          JournalWriter& journal, const std::function<Json()>& stage_stats,
                          const TaskAids& aids);

}  // namespace tessera
