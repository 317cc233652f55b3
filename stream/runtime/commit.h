/// \file commit.h
/// One task from its start to its journal line.
#pragma once
#include <atomic>
#include <chrono>
#include <condition_variable>
#include <cstdint>
#include <exception>
#include <filesystem>
#include <functional>
#include <memory>
#include <mutex>
#include <optional>
#include <set>
#include <string>
#include <thread>
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
  double in_order = 0.0;  ///< of `all`, in the longer of use() and after() of parallel_in_order()
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

/// Whether what has this name (TaskContext::create()) lies outside of the work directory.
bool is_result(const std::string& name);
/// Where a name of TaskContext::create() lies in the end.
std::filesystem::path committed_path(const JobState& state, const std::string& name);

/// What a file is called until it is committed: every writer has names of its own, so that two machines that do one task
/// do not write into one file. The job's output alone is called the same by all, since tasks may fill it
/// together: of such a stage nothing may be done twice at once.
std::filesystem::path aside_path(const std::filesystem::path& final_path, const std::string& writer = "");

/// True if every file of the record is there with its size and (if `hash`) its content.
bool files_match(const JobState& state, const TaskRecord& record, bool hash);

/// Group commit: what tasks commit is brought to the disk by a thread of its own, all that has come since it last did so and
/// the journal behind it, so no task waits for the disk. What a job did in its first moments is done again as quickly as it
/// would be synced, so they wait longer. Where the machine fails before that, files do not match their lines of the journal
/// and their tasks are done again (resume.h). What others get to see, the output, never waits (run_and_commit).
class GroupCommit {
 public:
  struct Waits {
    std::chrono::milliseconds first{2000};  ///< from its beginning; 0 where it goes on with older work
    std::chrono::milliseconds next{200};    ///< from what came to its sync
  };
  /// \param journal  outlives it
  explicit GroupCommit(JournalWriter& journal, Waits waits);
  explicit GroupCommit(JournalWriter& journal) : GroupCommit(journal, Waits()) {}
  /// Leaves what waits to the system. Files of a group whose sync failed go, now that no task reads them: what the disk refused
  /// would read well from memory until that forgets it.
  ~GroupCommit();
  GroupCommit(const GroupCommit&) = delete;
  GroupCommit& operator=(const GroupCommit&) = delete;
  /// Files and folders are to be synced later. \pre they have the names that they keep, or get none: what has gone by then is
  /// no longer needed \throws what a sync before has thrown
  void add(const std::set<std::filesystem::path>& paths);
  /// Returns once all that was added is on the disk. \throws what syncs throw
  void settle();
  /// Before files are deleted that others were made of: settles, but in the first moments.
  void settle_later();

 private:
  void run();
  /// \pre `lock` is held, and nobody else syncs
  void sync_all(std::unique_lock<std::mutex>& lock);
  bool is_young() const { return std::chrono::steady_clock::now() < start_ + waits_.first; }

  JournalWriter& journal_;
  const Waits waits_;
  const std::chrono::steady_clock::time_point start_ = std::chrono::steady_clock::now();
  std::mutex mutex_;
  std::condition_variable changed_;
  std::set<std::filesystem::path> waiting_;
  bool syncing_ = false;
  std::atomic<bool> ends_{false};
  std::exception_ptr failure_;
  std::set<std::filesystem::path> refused_;  ///< of groups that failed
  std::thread thread_;                       ///< the last member: it uses all others
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
  /// Where the machine fails before the next line of this writer, the task is to be done again. Only without files, and
  /// without a group.
  bool lasting = true;
  /// Of a job that one process does alone; null: everything is synced before the task counts as done.
  GroupCommit* group = nullptr;
  std::optional<std::uint64_t> need_bytes = {};  ///< of the record
};

/// Runs a task, or finish() for kFinishTask, and commits it: its files are synced (later, in a group), get their names, and
/// one journal line says so. Killed anywhere, the task is either committed or as if it had never run. A file of the same
/// content that another writer has committed meanwhile stays, so that whoever has it open can read on.
/// \param summaries    of all tasks in order; finish only
/// \param stage_stats  called for finish only, just before its line is written: TaskRecord::stage_stats
/// \throws what the stage throws; std::runtime_error naming stage and task for what is no tessera::Error
TaskRecord run_and_commit(const Stage& stage, std::int64_t task, const std::vector<Json>& summaries,
                          const JobState& state, const std::string& basis, const std::string& plan,
                          JournalWriter& journal, const std::function<Json()>& stage_stats,
                          const TaskAids& aids);

}  // namespace tessera
