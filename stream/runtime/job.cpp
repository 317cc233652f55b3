#include "stream/runtime/job.h"

#include <algorithm>
#include <cerrno>
#include <chrono>
#include <cstring>
#include <mutex>
#include <optional>
#include <set>
#include <utility>

#include <unistd.h>

#include <fmt/format.h>

#include "octree/error.h"
#include "octree/lattice.h"
#include "stream/files/durable_file.h"
#include "stream/files/job_scope.h"
#include "stream/files/json.h"
#include "stream/files/planned_writes.h"
#include "stream/files/written_hash.h"
#include "stream/runtime/child_process.h"
#include "stream/runtime/commit.h"
#include "stream/runtime/job_report.h"
#include "stream/runtime/journal.h"
#include "stream/runtime/log.h"
#include "stream/runtime/memory_budget.h"
#include "stream/runtime/parallel.h"
#include "stream/runtime/report.h"
#include "stream/runtime/resume.h"
#include "stream/runtime/stop.h"
#include "stream/runtime/work_dir.h"

namespace tessera {
namespace {

namespace fs = std::filesystem;

std::vector<std::string> stage_names(const std::vector<StageEntry>& stages) {
  std::vector<std::string> names;
  for (const StageEntry& stage : stages) names.push_back(stage.name);
  return names;
}

std::string listed(const std::vector<std::string>& words) {
  std::string text;
  for (const std::string& word : words) text += (text.empty() ? "" : ", ") + word;
  return text;
}

/// Of a stage that is done and hashed only its end is told: a histogram a task, of thousands of tasks, would stay to the end
/// of the job, which no stage asks memory for.
void forget_summaries(StageRecords& records) {
  for (TaskRecord& record : records.tasks) record.summary = Json();
}

void remove_named(const JobState& state, const std::string& name) {
  std::error_code ignored;  // what cannot be deleted only takes space
  fs::remove_all(state.work / name, ignored);
}

/// Also of a job that stops before they run. \throws ResourceError when the cap cannot hold what stages from `first` on
/// are known to need
void require_memory(const JobState& job_state, const JobDescription& job, std::size_t first) {
  if (!job.needs) return;
  const std::uint64_t base = MemoryBudget::expected_base();
  // A process of its own holds the base once more.
  const std::uint64_t own_base = job_state.run.processes ? base : 0;
  const auto largest = [&](std::uint64_t cap) {
    JobState state = job_state;
    state.run.memory_bytes = cap;
    StageNeed maximum;
    for (const StageNeed& need : job.needs(state)) {
      const auto at = std::find_if(job.stages.begin(), job.stages.end(),
                                   [&](const StageEntry& entry) { return entry.name == need.stage; });
      const auto index = static_cast<std::size_t>(at - job.stages.begin());
      if (index < first || index >= job.stages.size()) continue;
      maximum.likely = std::max({maximum.likely, need.likely, need.sure});
      if (need.sure > maximum.sure) maximum.stage = need.stage, maximum.sure = need.sure;
    }
    maximum.sure += own_base;
    maximum.likely += own_base;
    return maximum;
  };
  const StageNeed maximum = largest(job_state.run.memory_bytes);
  // The cap that is named counts with more than the process holds now, so that it does in every later run too.
  const MemoryBudget budget(job_state.run.memory_bytes, base - MemoryBudget::kBaseStep);
  if (maximum.sure <= budget.capacity()) return;
  budget.require(maximum.sure, "stage " + maximum.stage,
                 MemoryBudget::smallest_fitting_cap(job_state.run.memory_bytes, base,
                                                    [&](std::uint64_t cap) { return largest(cap).likely; }));
}

/// A running job.
class Driver {
 public:
  Driver(const JobState& state, const JobDescription& job, WorkDir& work, Progress& progress,
         spdlog::logger& log)
      : state_(state),
        job_(job),
        work_(work),
        progress_(progress),
        log_(log),
        pool_(state.run.threads),
        journal_(work.journal_folder() / "main.jsonl"),
        notes_(work.journal_folder(), "main"),
        journal_folder_(work.journal_folder()),
        group_(journal_, work.created() ? GroupCommit::Waits() : GroupCommit::Waits{.first = {}}),
        resume_(state, stage_names(job.stages), work.job_hash(), true),
        basis_(resume_.first_basis()),
        plan_(plan_hash(state.run)) {
    for (int slot = state.run.threads; slot-- > 0;) free_slots_.push_back(slot);
  }

  void run() {
    const std::size_t last = job_.only_stages > 0 ? job_.only_stages : job_.stages.size();
    // Of earlier runs: the work directory is locked, and what this run commits it knows itself.
    Journal journal = read_journal(journal_folder_);
    if (journal.damaged_lines > 0)
      log_.warn("{} damaged journal lines: their tasks are done again", journal.damaged_lines);
    for (std::size_t s = 0; s < last;) {
      std::vector<StageRecords> found;
      const std::string basis_before = basis_;
      std::size_t next = resume_.complete_until(journal, s, basis_, found);
      if (next == job_.stages.size() && s < next && !output_stands(journal, basis_)) {
        // Kept work, lost output: the last stage makes it again.
        log_.warn("{} is missing or not what this job made: the last stage is done again",
                  state_.output.string());
        found.pop_back();
        --next;
        basis_ = basis_before;
        for (const StageRecords& records : found) basis_ = next_basis(basis_, records);
      }
      for (StageRecords& records : found) {
        log_.info("stage {}: {} tasks and finish were committed by an earlier run", records.finish.stage,
                  records.tasks.size());
        sync_files(records);
        delete_obsolete(records);
        stop_if_requested(records.finish.stage);
        done_.push_back(std::move(records));
        forget_summaries(done_.back());
        journal.stages.erase(done_.back().finish.stage);  // only later ones are asked for from here on
        ++resumed_stages_;
      }
      s = std::max(s, next);
      if (s >= last) break;
      if (done_.size() == resumed_stages_) {
        trim_allocator();  // of all that was read
        require_memory(state_, job_, s);
      }
      done_.push_back(run_stage(s, journal));
      // What was just committed is bound to the inputs as they were: if they are not, nobody will take it.
      require_same_inputs(work_.identity());
      basis_ = next_basis(basis_, done_.back());
      forget_summaries(done_.back());
      delete_obsolete(done_.back());
      stop_if_requested(done_.back().finish.stage);
      ++s;
    }
    if (last == job_.stages.size()) note_output();
  }

  /// What stays is on the disk.
  void settle() { group_.settle(); }

  const std::vector<StageRecords>& done() const { return done_; }
  std::size_t resumed_stages() const { return resumed_stages_; }
  std::uint64_t child_peak_bytes() const { return child_peak_; }

 private:
  /// What the journal says of the output: a stage may have given it its name by itself.
  const TaskRecord* output_record(const Journal& journal, const std::string& basis) const {
    const auto found = journal.find(kOutputName, basis, "");
    return found.empty() ? nullptr : found.begin()->second;
  }

  bool output_stands(const Journal& journal, const std::string& basis) const {
    const TaskRecord* record = output_record(journal, basis);
    return fs::exists(state_.output) && (record == nullptr || files_match(state_, *record, true));
  }

  void note_output() {
    if (output_record(read_journal(journal_folder_), basis_) != nullptr || !fs::exists(state_.output)) return;
    TaskRecord record;
    record.stage = kOutputName;
    record.task = kFinishTask;
    record.basis = basis_;
    record.files = {{kOutputName, fs::file_size(state_.output), hash_written_file(state_.output)}};
    journal_.append(record);
  }

  void stop_if_requested(const std::string& stage) {
    if (state_.run.until != stage) return;
    settle();
    throw StoppedError(
        fmt::format("stopped after stage {} as asked: {} is kept, the same command without --until "
                    "goes on",
                    stage, state_.work.string()));
  }

  /// Of an earlier run, which may have been killed before it did: results are synced always.
  void sync_files(const TaskRecord& record) {
    std::set<fs::path> paths;
    for (const FileRecord& file : record.files) {
      const fs::path path = committed_path(state_, file.name);
      if (!is_result(file.name)) paths.insert({path, path.parent_path()});
    }
    group_.add(paths);
  }
  void sync_files(const StageRecords& records) {
    for (const TaskRecord& record : records.tasks) sync_files(record);
    sync_files(records.finish);
  }

  void delete_obsolete(const StageRecords& records) {
    if (state_.run.keep || records.finish.obsolete.empty()) return;
    group_.settle_later();
    for (const std::string& name : records.finish.obsolete) remove_named(state_, name);
  }

  /// Deletes what no record names: files of killed tasks, of another plan, of nobody. Nothing foreign is
  /// mixed in.
  void delete_unknown(const Journal& journal, std::size_t stage,
                      const std::map<std::int64_t, TaskRecord>& done) const;

  StageRecords run_stage(std::size_t index, const Journal& journal);
  TaskRecord run_one(const Stage& stage, std::int64_t task, std::optional<std::uint64_t> need_bytes,
                     const std::vector<Json>& summaries, const std::function<Json()>& stats);
  TaskRecord run_child(const std::string& stage, std::int64_t task);

  const JobState& state_;
  const JobDescription& job_;
  const WorkDir& work_;
  Progress& progress_;
  spdlog::logger& log_;
  WorkerPool pool_;
  JournalWriter journal_;
  TaskNotes notes_;
  fs::path journal_folder_;
  GroupCommit group_;
  Resume resume_;
  std::string basis_;
  std::string plan_;
  std::vector<StageRecords> done_;
  std::size_t resumed_stages_ = 0;

  std::mutex mutex_;
  std::vector<int> free_slots_;
  std::uint64_t child_peak_ = 0;
};

void Driver::delete_unknown(const Journal& journal, std::size_t stage,
                            const std::map<std::int64_t, TaskRecord>& done) const {
  std::set<std::string> known;
  const auto note = [&](const TaskRecord& record) {
    for (const FileRecord& file : record.files) known.insert(file.name);
  };
  for (const StageRecords& records : done_) {
    std::for_each(records.tasks.begin(), records.tasks.end(), note);
    note(records.finish);
  }
  for (const auto& [task, record] : done) note(record);
  // What later stages have is looked at when their turn comes.
  for (std::size_t later = stage + 1; later < job_.stages.size(); ++later) {
    const auto at = journal.stages.find(job_.stages[later].name);
    if (at != journal.stages.end()) std::for_each(at->second.begin(), at->second.end(), note);
  }
  for (const std::string& name : work_.unknown_files(known)) {
    log_.warn("{}: nothing that was committed: deleted", name);
    remove_named(state_, name);
  }
  work_.remove_empty_folders();
}

StageRecords Driver::run_stage(std::size_t index, const Journal& journal) {
  const std::string name = job_.stages[index].name;
  const auto start = std::chrono::steady_clock::now();
  const double cpu_start = cpu_seconds();
  throw_if_stopped();
  trim_allocator();
  std::unique_ptr<Stage> stage;
  std::vector<std::uint64_t> needs;  // of its tasks
  pool_.run_here([&] {
    stage = job_.stages[index].make(state_);  // thousands of headers are read on all threads
    needs.resize(stage->task_count());
    parallel_for(needs.size(), [&](std::size_t k) { needs[k] = stage->task_bytes(k); });
  });
  const std::size_t count = needs.size();

  // A process of its own holds the base once more.
  const std::uint64_t base = resident_bytes();
  const std::uint64_t own_base = state_.run.processes ? base : 0;
  MemoryBudget budget(state_.run.memory_bytes, base);
  std::uint64_t largest_task = 0;
  for (std::size_t k = 0; k < count; ++k) {
    budget.require(needs[k] + own_base, fmt::format("task {} of stage {}", k, name));
    largest_task = std::max(largest_task, needs[k]);
  }
  budget.require(stage->finish_bytes() + own_base, fmt::format("the end of stage {}", name));

  const bool idle = count == 0 && stage->units() == 0;
  std::map<std::int64_t, TaskRecord> done;
  // What tasks of the last stage wrote straight into the output's aside file is gone with it.
  const bool aside_lost = index + 1 == job_.stages.size() && !fs::exists(aside_path(state_.output));
  if (!aside_lost) done = resume_.done_tasks(journal, name, basis_, plan_);
  std::erase_if(done, [&](const auto& entry) { return entry.first >= static_cast<std::int64_t>(count); });
  for (const auto& [task, record] : done) sync_files(record);
  if (!idle) delete_unknown(journal, index, done);
  std::uint64_t units_done = 0;
  for (const auto& [task, record] : done) units_done += record.units;
  const std::size_t resumed = done.size();
  log_.info("stage {}: {} tasks, {} of them committed by an earlier run; {} {}; base {}, budget {}", name,
            count, resumed, stage->units(), stage->unit_name(), format_bytes(base),
            format_bytes(budget.capacity()));
  notes_.stage(name, count, stage->units(), stage->unit_name());
  if (!idle)
    progress_.begin_stage(name, index, job_.stages.size(), stage->unit_name(), stage->units(), units_done);

  std::vector<std::int64_t> missing;
  for (std::size_t k = 0; k < count; ++k) {
    if (done.count(static_cast<std::int64_t>(k)) == 0) missing.push_back(static_cast<std::int64_t>(k));
  }
  pool_.run_tasks(
      missing.size(), [&](std::size_t i) { return needs[static_cast<std::size_t>(missing[i])] + own_base; },
      budget,
      [&](std::size_t i) {
        TaskRecord record = run_one(*stage, missing[i], needs[static_cast<std::size_t>(missing[i])], {}, {});
        log_.debug("stage {}, task {}: {:.2f} s", name, missing[i], record.seconds);
        const std::lock_guard lock(mutex_);
        done.emplace(missing[i], std::move(record));
      },
      TaskOrder::kLargestFirst);

  StageRecords records;
  for (auto& [task, record] : done) records.tasks.push_back(std::move(record));
  const auto stats = [&] {
    Json j = {{"name", name}, {"tasks", count}, {"tasks_resumed", resumed}};
    std::uint64_t read = 0;
    std::uint64_t written = 0;
    for (const TaskRecord& record : records.tasks) {
      read += record.bytes_read;
      written += record.bytes_written;
    }
    j["wall_s"] = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
    j["cpu_s"] = cpu_seconds() - cpu_start;
    j["peak_bytes"] = progress_.stage_peak_bytes() + child_peak_;
    j["task_bytes"] = largest_task;
    j["finish_bytes"] = stage->finish_bytes();
    j["bytes_read"] = read;
    j["bytes_written"] = written;
    j["units"] = stage->units();
    j["unit"] = stage->unit_name();
    return j;
  };
  const std::vector<Json> summaries = records.summaries();
  pool_.run_tasks(
      1, [&](std::size_t) { return stage->finish_bytes() + own_base; }, budget,
      [&](std::size_t) { records.finish = run_one(*stage, kFinishTask, {}, summaries, stats); });
  if (!idle) progress_.end_stage();
  log_.info("stage {}: committed: {}", name, dump_json(records.finish.stage_stats));
  for (const Json& w : warnings_of(records.finish.summary))
    log_.warn("stage {}: {}", name, w.get<std::string>());
  return records;
}

TaskRecord Driver::run_one(const Stage& stage, std::int64_t task, std::optional<std::uint64_t> need_bytes,
                           const std::vector<Json>& summaries, const std::function<Json()>& stats) {
  try {
    // finish() of a process job stays here: it is one task, and its statistics are the driver's.
    if (!state_.run.processes || task == kFinishTask)
      return run_and_commit(stage, task, summaries, state_, basis_, plan_, journal_, stats,
                            {.progress = &progress_,
                             .notes = &notes_,
                             .lasting = task != kFinishTask || stage.task_count() > 0 || stage.units() > 0,
                             .group = state_.run.processes ? nullptr : &group_,
                             .need_bytes = need_bytes});
    notes_.started(stage.name(), task);
    TaskRecord record = run_child(stage.name(), task);
    progress_.advance(record.units);
    return record;
  } catch (const std::exception& e) {
    notes_.failed(stage.name(), task, e.what());
    throw;
  }
}

TaskRecord Driver::run_child(const std::string& stage, std::int64_t task) {
  int slot = 0;
  {
    const std::lock_guard lock(mutex_);
    slot = free_slots_.back();
    free_slots_.pop_back();
  }
  const std::string writer = fmt::format("process-{}", slot);
  const ChildResult result = run_task_process(state_.work, stage, task, writer, work_.lock());
  TaskRecord record;
  bool found = false;
  if (result.exit_code == 0) {
    const Journal journal = read_journal_file(journal_folder_ / (writer + ".jsonl"));
    const auto records = journal.find(stage, basis_, plan_);
    if (const auto at = records.find(task); at != records.end()) {
      record = *at->second;
      found = true;
    }
  }
  {
    const std::lock_guard lock(mutex_);
    free_slots_.push_back(slot);
    // At worst every process had its highest moment at the same time.
    child_peak_ = std::max(child_peak_, record.peak_bytes * static_cast<std::uint64_t>(state_.run.threads));
  }
  if (!found) throw_child_failure(result, stage, task);
  return record;
}

/// The caps and counts that the user left open.
std::string resolve_run(RunOptions& run) {
  if (run.threads <= 0) run.threads = core_count();
  if (run.tile_cells < 0 || run.tile_cells % kBrickCells != 0) {
    throw UsageError(
        fmt::format("--tile-size {}: must be a multiple of {} cells", run.tile_cells, kBrickCells));
  }
  if (run.memory_bytes > 0) return fmt::format("{} (given)", format_bytes(run.memory_bytes));
  const MemoryCap cap = detect_memory_cap();
  run.memory_bytes = cap.bytes;
  return fmt::format("{} (0.8 of {}, {})", format_bytes(cap.bytes), format_bytes(cap.limit), cap.source);
}

void check_until(const JobState& state, const JobDescription& job) {
  const std::vector<std::string> names = stage_names(job.stages);
  if (state.run.until.empty() || std::find(names.begin(), names.end(), state.run.until) != names.end())
    return;
  throw UsageError(fmt::format("--until {}: no such stage, there are {}", state.run.until, listed(names)));
}

std::vector<fs::path> sidecar_paths(const JobState& state, const JobDescription& job, bool results) {
  std::vector<fs::path> paths;
  for (const SidecarOutput& b : job.sidecars)
    if (b.is_result || !results) paths.push_back(b.path(state.output));
  return paths;
}

/// Everything that the job will write, before it does anything.
/// \param resumes  the work directory is of this very job: what lies beside the output may be of its first run
void check_job_writes(const JobState& state, const JobDescription& job, bool resumes) {
  std::vector<fs::path> reads = state.inputs;
  reads.insert(reads.end(), state.also_read.begin(), state.also_read.end());
  const auto own = [&](const fs::path& file) {
    return existing_by(state.run.force || resumes || is_own_earlier_file(state, file));
  };
  using Existing = PlannedWrite::Existing;
  std::vector<PlannedWrite> writes;
  const bool plans = job.only_stages > 0;
  // What is there is looked at by output_is_done().
  writes.push_back({state.output, "-o", Existing::kReplace});
  if (!plans || !state.run.report.empty())
    writes.push_back({report_path(state), state.run.report.empty() ? "the report beside -o" : "--report",
                      own(report_path(state))});
  if (job.page.make && state.run.page && !plans) {
    const fs::path page = job.page.path(report_path(state));
    writes.push_back(
        {page, "the page beside the report", existing_by(state.run.force || job.page.is_page(page))});
  }
  if (!state.run.log.empty()) writes.push_back({fs::absolute(state.run.log), "--log", Existing::kAppend});
  if (!plans)
    for (const SidecarOutput& b : job.sidecars) {
      const fs::path path = b.path(state.output);
      writes.push_back({path, b.option, own(path)});
    }
  check_writes(reads, writes, state.work);
}

}  // namespace

namespace {

JobTaker job_taker;

/// What is settled before the work directory is opened.
struct Prepared {
  Json identity;
  std::string cap_text;
  Json done;  ///< the report of an earlier run that left nothing to do, else null
};

/// Resolves what the state leaves open and refuses what cannot be written.
Prepared prepare(JobState& state, const JobDescription& job) {
  Prepared s;
  s.cap_text = resolve_run(state.run);
  keep_freed_memory(state.run.memory_bytes, state.run.threads);
  check_until(state, job);
  std::vector<InputFingerprint> fingerprints;
  for (fs::path& input : state.inputs) {
    if (is_given(input)) continue;  // nobody goes on with this job
    fingerprints.push_back(fingerprint_input(input));
    input = fingerprints.back().path;
  }
  state.output = fs::absolute(state.output).lexically_normal();
  state.work = work_path(state.output, state.run.temp);
  const fs::path folder = state.work.parent_path();
  if (!fs::is_directory(folder))
    throw UsageError(fmt::format("{}: there is no such folder: make it first", folder.string()));
  if (::access(folder.c_str(), W_OK) != 0)
    throw UsageError(
        fmt::format("{}: this folder cannot be written to: {}", folder.string(), std::strerror(errno)));
  s.identity = job_identity(job.command, state, fingerprints);
  check_job_writes(state, job, WorkDir::holds(state.work, s.identity));
  require_not_queued(state.work);
  if (Json report;
      job.only_stages == 0 && output_is_done(state, s.identity, sidecar_paths(state, job, true), report)) {
    WorkDir::remove_discarded(state.work);
    s.done = std::move(report);
  }
  return s;
}

}  // namespace

void take_jobs(JobTaker taker) {
  job_taker = std::move(taker);
}

bool begin_job(JobState& state, const JobDescription& job, bool make) {
  const Prepared prepared = prepare(state, job);
  if (!prepared.done.is_null()) return false;
  if (!WorkDir::holds(state.work, prepared.identity)) require_memory(state, job, 0);
  if (!make) return true;
  WorkDir work = WorkDir::open_job(state.work, prepared.identity, state.run.force);
  work.write_run(state);
  return true;
}

Json run_job(JobState state, const JobDescription& job, const ProgressSink& sink) {
  if (job_taker) {
    const JobTaker taker = std::exchange(job_taker, nullptr);  // who takes a job may run jobs
    taker(state, job);
    throw JobTaken{};
  }
  const auto start = std::chrono::steady_clock::now();
  const Prepared prepared = prepare(state, job);
  const Json& identity = prepared.identity;
  const std::string& cap_text = prepared.cap_text;
  if (!prepared.done.is_null()) {
    if (job.page.make && state.run.page && !fs::exists(job.page.path(report_path(state))))
      job.page.make(state, prepared.done)(prepared.done);
    return prepared.done;
  }

  WorkDir work = WorkDir::open_job(state.work, identity, state.run.force);
  work.write_run(state);
  auto log = open_log(state.run.log.empty() ? state.work / "log.txt" : state.run.log, state.run.verbosity);
  log->info("tessera {} on {}", TESSERA_VERSION, dump_json(machine_description()));
  log->info("command: {}", command_line());
  log->info("{} {}; memory cap {}; {} threads", work.created() ? "new work directory" : "resuming",
            state.work.string(), cap_text, state.run.threads);
  Progress progress(progress_mode(state.run.progress, sink.terminal, state.run.verbosity), sink);
  if (!work.created()) progress.say(fmt::format("going on with {}", state.work.string()));
  std::optional<Driver> driver;
  const auto report_now = [&] {
    return make_report(state, identity, driver->done(), sidecar_paths(state, job, false),
                       {cap_text, seconds_since(start), cpu_seconds(),
                        peak_resident_bytes() + driver->child_peak_bytes(), driver->resumed_stages()});
  };
  Json report;
  try {
    driver.emplace(state, job, work, progress, *log);
    driver->run();
    report = report_now();
    if (job.summarise) job.summarise(report);
    if (job.only_stages > 0) return report;
    write_reports(state, job, report, start);
    log->info("done in {}", cost_text(report));
  } catch (const StoppedError& e) {
    log->warn("{}", e.what());
    if (stop_signal() == 0) throw;
    throw StoppedError(
        fmt::format("stopped by signal {}: {} is kept, the same command goes on where it stopped",
                    stop_signal(), state.work.string()));
  } catch (const std::exception& e) {
    log->error("{}", e.what());
    // An option or input refused at once leaves nothing behind.
    const bool at_once = read_journal(work.journal_folder()).stages.empty();
    if (work.created() && at_once) work.remove();
    const auto* refusal = dynamic_cast<const Error*>(&e);
    if (refusal != nullptr && driver && !at_once && job.only_stages == 0 && !fs::exists(state.output))
      report_refusal(state, job, *refusal, report_now);
    throw;
  }
  if (state.run.keep) driver->settle();
  driver.reset();  // a network file system keeps files that are open, and their folder with them
  log.reset();
  if (!state.run.keep) work.remove();
  return report;
}

}  // namespace tessera
