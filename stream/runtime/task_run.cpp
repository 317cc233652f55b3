#include "stream/runtime/task_run.h"

#include <algorithm>
#include <chrono>
#include <cstdlib>
#include <memory>
#include <set>
#include <thread>  // sleep_for alone

#include <fmt/format.h>

#include "octree/error.h"
#include "stream/runtime/commit.h"
#include "stream/runtime/journal.h"
#include "stream/runtime/memory_budget.h"
#include "stream/runtime/parallel.h"
#include "stream/runtime/resume.h"
#include "stream/runtime/stop.h"
#include "stream/runtime/work_dir.h"

namespace tessera {
namespace {

namespace fs = std::filesystem;
constexpr double kCommitSeconds = 5.0;  ///< longer than from a rename to the journal line behind it
constexpr auto kLookAgain = std::chrono::milliseconds(250);

std::string task_word(std::int64_t task) {
  return task == kFinishTask ? "finish" : std::to_string(task);
}

/// Begins the names of the journal files of all who do tasks of a stage.
std::string writers_of(const std::string& stage) {
  return fmt::format("task-{}-", stage);
}

bool is_number(const std::string& text) {
  return !text.empty() && text.size() < 10 && text.find_first_not_of("0123456789") == std::string::npos;
}

/// One stage of a work directory, as a process sees it that does some of its tasks.
class StageTasks {
 public:
  StageTasks(const fs::path& path, const JobFinder& find_job, const std::string& stage,
             const TaskRunOptions& options)
      : options_(options),
        // In a queue its mark keeps others away, and whoever outlives his element must not hold up the job's end.
        work_(WorkDir::open_existing(path, !options.driven && std::getenv(kQueueToken) == nullptr)),
        state_(work_.read_state()),
        job_(find_job(work_.identity().at("command").get<std::string>(), state_.settings)),
        plan_(plan_hash(state_.run)) {
    for (const StageEntry& entry : job_.stages) names_.push_back(entry.name);
    const auto at = std::find(names_.begin(), names_.end(), stage);
    if (at == names_.end()) {
      std::string all;
      for (const std::string& name : names_) all += (all.empty() ? "" : ", ") + name;
      throw UsageError(fmt::format("no stage '{}': there are {}", stage, all));
    }
    index_ = static_cast<std::size_t>(at - names_.begin());
  }

  void run(const TaskChoice& choice);

 private:
  const std::string& name() const { return names_[index_]; }
  bool waits() const {
    return std::chrono::steady_clock::now() - start_ < std::chrono::duration<double>(options_.patience_s);
  }
  void pause() const {
    throw_if_stopped();
    std::this_thread::sleep_for(kLookAgain);
    refresh_names(work_.journal_folder());
  }

  /// Reads the journal anew; waits until all earlier stages are complete.
  void look();
  void make_stage();
  void do_tasks(const std::vector<std::int64_t>& tasks);
  void do_finish();
  /// What fails counts as done when another process has committed it meanwhile.
  void run_one(std::int64_t task, const std::vector<Json>& summaries);
  /// Whether another process has committed it meanwhile.
  bool is_elsewhere(std::int64_t task, TaskRecord& record) const;
  Json figures() const;
  MemoryBudget& budget();

  const TaskRunOptions& options_;
  const std::chrono::steady_clock::time_point start_ = std::chrono::steady_clock::now();
  WorkDir work_;
  JobState state_;
  JobDescription job_;
  std::string plan_;
  std::vector<std::string> names_;
  std::size_t index_ = 0;

  bool is_complete_ = false;
  std::string basis_;
  std::map<std::int64_t, TaskRecord> done_;
  std::unique_ptr<Stage> stage_;
  std::unique_ptr<JournalWriter> writer_;
  std::unique_ptr<TaskNotes> notes_;
  std::unique_ptr<WorkerPool> pool_;
  std::unique_ptr<MemoryBudget> budget_;
};

void StageTasks::look() {
  // What later stages made obsolete need not be there; a driver knows that this one is not complete, whatever sizes say.
  std::vector<std::string> names = names_;
  if (options_.driven) names.resize(index_);
  for (;;) {
    Resume resume(state_, names, work_.job_hash(), false);
    const Journal journal = read_journal(work_.journal_folder());
    basis_ = resume.first_basis();
    std::vector<StageRecords> found;
    const std::size_t complete = resume.complete_until(journal, 0, basis_, found);
    is_complete_ = complete > index_;
    if (is_complete_) return;
    if (complete == index_) {
      done_ = resume.done_tasks(journal, name(), basis_, plan_);
      return;
    }
    if (!waits())
      throw UsageError(
          fmt::format("stage {} needs stage {}, which is not complete yet", name(), names_[complete]));
    pause();
  }
}

void StageTasks::make_stage() {
  if (options_.driven) {
    stage_ = job_.stages[index_].make(state_);
    return;
  }
  // What a stage finds when it is made may just be going, if others are done with it.
  try {
    stage_ = job_.stages[index_].make(state_);
  } catch (const std::exception&) {
    look();
    if (!is_complete_) throw;
    return;
  }
  look();
}

MemoryBudget& StageTasks::budget() {
  if (!budget_) {
    keep_freed_memory(state_.run.memory_bytes, state_.run.threads);
    budget_ = std::make_unique<MemoryBudget>(state_.run.memory_bytes, resident_bytes());
  }
  return *budget_;
}

bool StageTasks::is_elsewhere(std::int64_t task, TaskRecord& record) const {
  if (options_.driven) return false;
  refresh_names(work_.journal_folder());
  const Journal journal = read_journal(work_.journal_folder(), writers_of(name()));
  const auto found = journal.find(name(), basis_, plan_);
  const auto at = found.find(task);
  if (at == found.end()) return false;
  StageRecords whole;
  // Of a complete stage files may have gone; else a task is begun again since a file of its record is missing.
  if (!files_match(state_, *at->second, false) && !find_complete(journal, name(), basis_, whole))
    return false;
  record = *at->second;
  return true;
}

void StageTasks::run_one(std::int64_t task, const std::vector<Json>& summaries) {
  TaskAids aids{nullptr, notes_.get(), options_.scratch, {}};
  aids.elsewhere = [&](TaskRecord& record) { return is_elsewhere(task, record); };
  try {
    if (task != kFinishTask) aids.need_bytes = stage_->task_bytes(static_cast<std::size_t>(task));
    run_and_commit(
        *stage_, task, summaries, state_, basis_, plan_, *writer_, [this] { return figures(); }, aids);
  } catch (const StoppedError&) {
    throw;
  } catch (const std::exception& e) {
    // Another machine may have been done with it first, and what it was made from have gone; it may be about to say so.
    const auto failed = std::chrono::steady_clock::now();
    const double patience = std::min(options_.patience_s, kCommitSeconds);
    for (;;) {
      if (TaskRecord theirs; is_elsewhere(task, theirs)) return;
      if (std::chrono::steady_clock::now() - failed >= std::chrono::duration<double>(patience)) break;
      pause();
    }
    notes_->failed(name(), task, e.what());
    throw;
  }
}

void StageTasks::do_tasks(const std::vector<std::int64_t>& tasks) {
  std::vector<std::int64_t> missing;
  for (const std::int64_t k : tasks)
    // Whoever drives has looked closer: at contents, not only at sizes.
    if (options_.driven || done_.count(k) == 0) missing.push_back(k);
  if (missing.empty()) return;
  const auto need = [&](std::size_t i) { return stage_->task_bytes(static_cast<std::size_t>(missing[i])); };
  for (std::size_t i = 0; i < missing.size(); ++i)
    budget().require(need(i), fmt::format("task {} of stage {}", missing[i], name()));
  pool_->run_tasks(
      missing.size(), need, budget(), [&](std::size_t i) { run_one(missing[i], {}); },
      TaskOrder::kLargestFirst);
}

Json StageTasks::figures() const {
  double cpu = 0.0;
  std::uint64_t peak = peak_resident_bytes(), read = 0, written = 0;
  for (const auto& [task, record] : done_) {
    cpu += record.cpu_seconds;
    peak = std::max(peak, record.peak_bytes);
    read += record.bytes_read;
    written += record.bytes_written;
  }
  const Notes notes = read_notes(work_.journal_folder());
  const auto noted = notes.stages.find(name());
  const double now =
      std::chrono::duration<double>(std::chrono::system_clock::now().time_since_epoch()).count();
  return {{"name", name()},
          {"tasks", stage_->task_count()},
          {"tasks_resumed", 0},
          {"wall_s", noted == notes.stages.end() ? 0.0 : std::max(0.0, now - noted->second.begun)},
          {"cpu_s", cpu},
          {"peak_bytes", peak},
          {"bytes_read", read},
          {"bytes_written", written},
          {"unit", stage_->unit_name()},
          {"units", stage_->units()}};
}

void StageTasks::do_finish() {
  const auto count = static_cast<std::int64_t>(stage_->task_count());
  std::vector<Json> summaries;
  for (;;) {
    summaries.clear();
    std::int64_t absent = -1;
    for (std::int64_t k = 0; k < count && absent < 0; ++k) {
      const auto at = done_.find(k);
      if (at == done_.end()) {
        absent = k;
      } else {
        summaries.push_back(at->second.summary);
      }
    }
    if (absent < 0) break;
    if (!waits()) throw UsageError(fmt::format("stage {}: task {} is not committed yet", name(), absent));
    pause();
    look();
    if (is_complete_) return;
  }
  budget().require(stage_->finish_bytes(), fmt::format("the end of stage {}", name()));
  pool_->run_tasks(
      1, [&](std::size_t) { return stage_->finish_bytes(); }, budget(),
      [&](std::size_t) { run_one(kFinishTask, summaries); });
  if (state_.run.keep) return;
  for (const std::string& gone : stage_->obsolete()) {
    std::error_code ignored;  // what cannot be deleted only takes space
    fs::remove_all(state_.work / gone, ignored);
  }
}

void StageTasks::run(const TaskChoice& choice) {
  using Kind = TaskChoice::Kind;
  if (!options_.driven) {
    require_not_queued(work_.path());
    refresh_names(work_.journal_folder());
  }
  look();
  const bool finishes = choice.kind == Kind::kAll || choice.first == kFinishTask;
  if (is_complete_) return;
  make_stage();
  if (is_complete_) return;
  const auto count = static_cast<std::int64_t>(stage_->task_count());
  std::vector<std::int64_t> tasks;
  if (choice.kind == Kind::kTask && choice.first != kFinishTask) {
    if (choice.first < 0 || choice.first >= count)
      throw UsageError(fmt::format("stage {} has {} tasks: no task {}", name(), count, choice.first));
    tasks = {choice.first};
  } else if (choice.kind != Kind::kTask) {
    for (std::int64_t k = choice.first; k < count; k += choice.step) tasks.push_back(k);
  }
  if (!options_.driven && !finishes &&
      std::all_of(tasks.begin(), tasks.end(), [&](std::int64_t k) { return done_.count(k) > 0; }))
    return;
  const std::string what = choice.kind == Kind::kAll     ? "all"
                           : choice.kind == Kind::kShare ? fmt::format("{}of{}", choice.first, choice.step)
                                                         : task_word(choice.first);
  writer_ = options_.writer.empty()
                ? std::make_unique<JournalWriter>(work_.journal_folder(), writers_of(name()) + what)
                : std::make_unique<JournalWriter>(work_.journal_folder() / (options_.writer + ".jsonl"));
  notes_ = std::make_unique<TaskNotes>(work_.journal_folder(), writer_->name());
  notes_->stage(name(), static_cast<std::uint64_t>(count), stage_->units(), stage_->unit_name());
  // Driven processes share the machine with each other.
  pool_ = std::make_unique<WorkerPool>(options_.driven ? 1 : state_.run.threads);
  do_tasks(tasks);
  if (finishes) {
    if (choice.kind == Kind::kAll) look();
    if (!is_complete_) do_finish();
  }
  if (options_.scratch.empty()) return;
  std::error_code ignored;  // empty folders
  fs::remove_all(options_.scratch / writer_->name(), ignored);
}

}  // namespace

TaskChoice parse_task_choice(const std::string& text) {
  using Kind = TaskChoice::Kind;
  if (text == "finish") return {Kind::kTask, kFinishTask, 1};
  if (text == "all") return {Kind::kAll, 0, 1};
  if (is_number(text)) return {Kind::kTask, std::stoll(text), 1};
  const std::size_t slash = text.find('/');
  if (slash != std::string::npos && is_number(text.substr(0, slash)) && is_number(text.substr(slash + 1))) {
    const TaskChoice share = {Kind::kShare, std::stoll(text.substr(0, slash)),
                              std::stoll(text.substr(slash + 1))};
    if (share.first < share.step) return share;
  }
  throw UsageError(
      fmt::format("'{}' is no task: give its number, finish, all, or a share as 0/4 to 3/4 of four", text));
}

void run_tasks(const fs::path& work, const JobFinder& find_job, const std::string& stage,
               const TaskChoice& choice, const TaskRunOptions& options) {
  StageTasks(work, find_job, stage, options).run(choice);
}

}  // namespace tessera
