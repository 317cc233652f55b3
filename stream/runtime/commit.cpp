#include "stream/runtime/commit.h"

#include <algorithm>
#include <atomic>
#include <chrono>
#include <cstring>
#include <ctime>
#include <utility>

#include <fmt/format.h>

#include "octree/error.h"
#include "stream/files/durable_file.h"
#include "stream/files/fault.h"
#include "stream/files/written_hash.h"
#include "stream/runtime/memory_budget.h"
#include "stream/runtime/stop.h"

namespace tessera {
namespace {

namespace fs = std::filesystem;

/// Where a file is before it has its name.
struct Asides {
  const JobState& state;
  std::string writer;
  fs::path scratch;

  /// Beside its final place.
  fs::path shared(const std::string& name) const {
    return aside_path(committed_path(state, name), name == kOutputName ? "" : writer);
  }
  bool is_local(const std::string& name) const { return !scratch.empty() && !is_result(name); }
  /// Where the task writes it.
  fs::path made(const std::string& name) const {
    return is_local(name) ? aside_path(scratch / writer / name) : shared(name);
  }
  /// Moves what lies on the disk of this machine.
  void bring(const std::string& name) const {
    if (!is_local(name)) return;
    const fs::path to = shared(name);
    std::error_code error;
    fs::create_directories(to.parent_path(), error);
    if (!error) fs::copy_file(made(name), to, fs::copy_options::overwrite_existing, error);
    if (error) throw_write_error(to, error.value());
    fs::remove(made(name));
  }
};

double thread_cpu_seconds() {
  timespec now = {};
  ::clock_gettime(CLOCK_THREAD_CPUTIME_ID, &now);
  return static_cast<double>(now.tv_sec) + 1e-9 * static_cast<double>(now.tv_nsec);
}

class RunningTask : public TaskContext {
 public:
  RunningTask(const Asides& asides, const TaskAids& aids) : asides_(asides), aids_(aids) {}
  ~RunningTask() override {
    std::error_code ignored;  // what a failed task leaves on the machine's own disk
    if (!aids_.scratch.empty())
      for (const std::string& name : names_)
        if (asides_.is_local(name)) fs::remove(asides_.made(name), ignored);
  }

  fs::path create(const std::string& name) override {
    const fs::path relative(name);
    if (name.empty() || relative.is_absolute() || relative.lexically_normal() != relative ||
        name.front() == '.' || name.back() == '/') {
      throw std::logic_error("create('" + name + "'): not a name relative to the work directory");
    }
    // A process that its queue had given up may outlive its job: it does not begin the work directory anew.
    if (!fs::exists(asides_.state.work))
      throw InputError(asides_.state.work.string() + ": has gone while this task was at work");
    const fs::path path = asides_.made(name);
    std::error_code error;
    fs::create_directories(path.parent_path(), error);
    if (error) throw_write_error(path.parent_path(), error.value());
    const std::lock_guard lock(mutex_);
    if (std::find(names_.begin(), names_.end(), name) == names_.end()) names_.push_back(name);
    return path;
  }
  void check_stop() const override {
    if (aids_.notes != nullptr) aids_.notes->alive();
    throw_if_stopped();
  }
  void advance(std::uint64_t units) override {
    units_ += units;
    if (aids_.progress != nullptr) aids_.progress->advance(units);
  }
  void count_read(std::uint64_t bytes) override { read_ += bytes; }
  void count_written(std::uint64_t bytes) override { written_ += bytes; }

  /// In the order of names, which does not depend on threads inside the task.
  std::vector<std::string> names() {
    const std::lock_guard lock(mutex_);
    std::sort(names_.begin(), names_.end());
    return names_;
  }
  std::uint64_t units() const { return units_; }
  std::uint64_t read() const { return read_; }
  std::uint64_t written() const { return written_; }

 private:
  const Asides& asides_;
  const TaskAids& aids_;
  std::mutex mutex_;
  std::vector<std::string> names_;
  std::atomic<std::uint64_t> units_{0}, read_{0}, written_{0};
};

/// Whether the file of this record has its name already: another machine was done with the same task first.
bool is_placed(const fs::path& path, const FileRecord& file) {
  std::error_code error;
  const std::uintmax_t bytes = fs::file_size(path, error);
  return !error && bytes == file.bytes && hash_file(path) == file.xxh3;
}

/// Gives the files their names, those that are synced here once they are.
/// \param[out] later  files and folders of the work directory that are not synced here; null: all are
void place_files(const Asides& asides, const std::vector<std::string>& names, std::set<fs::path>* later,
                 TaskRecord& record) {
  const JobState& state = asides.state;
  fault_point(FaultPoint::kCommit);
  for (const std::string& name : names) {
    const fs::path part = asides.shared(name);
    asides.bring(name);
    if (later == nullptr || is_result(name)) sync_file(part);
    record.files.push_back({name, fs::file_size(part), hash_written_file(part)});
  }
  fault_point(FaultPoint::kCommit);
  std::set<fs::path> folders;
  for (std::size_t i = 0; i < names.size(); ++i) {
    const fs::path path = committed_path(state, names[i]);
    const fs::path part = asides.shared(names[i]);
    std::error_code error;
    if (is_placed(path, record.files[i])) {
      fs::remove(part, error);
    } else {
      fs::rename(part, path, error);
    }
    if (error) throw_write_error(path, error.value());
    if (later == nullptr || is_result(names[i])) {
      folders.insert(path.parent_path());
    } else {
      later->insert({path, path.parent_path()});
    }
  }
  for (const fs::path& folder : folders) sync_folder(folder);
  fault_point(FaultPoint::kCommit);
}

/// What a later stage did not need any longer may just be going.
void sync_if_there(const fs::path& path) {
  try {
    fs::is_directory(path) ? sync_folder(path) : sync_file(path);
  } catch (const std::exception&) {
    std::error_code ignored;
    if (fs::symlink_status(path, ignored).type() != fs::file_type::not_found) throw;
  }
}

}  // namespace

GroupCommit::GroupCommit(JournalWriter& journal, Waits waits)
    : journal_(journal), waits_(waits), thread_([this] { run(); }) {}

GroupCommit::~GroupCommit() {
  {
    const std::lock_guard lock(mutex_);
    ends_ = true;
    changed_.notify_all();
  }
  thread_.join();
  std::error_code ignored;
  for (const fs::path& path : refused_)
    if (fs::is_regular_file(path, ignored)) fs::remove(path, ignored);
}

void GroupCommit::add(const std::set<fs::path>& paths) {
  const std::lock_guard lock(mutex_);
  if (failure_ != nullptr) std::rethrow_exception(failure_);
  waiting_.insert(paths.begin(), paths.end());
  changed_.notify_all();
}

void GroupCommit::settle() {
  std::unique_lock lock(mutex_);
  changed_.wait(lock, [this] { return !syncing_; });
  sync_all(lock);
  if (failure_ != nullptr) std::rethrow_exception(failure_);
}

void GroupCommit::settle_later() {
  if (!is_young()) settle();
}

void GroupCommit::run() {
  std::unique_lock lock(mutex_);
  changed_.wait_until(lock, start_ + waits_.first, [this] { return ends_.load(); });
  for (;;) {
    changed_.wait(lock, [this] { return ends_ || (!waiting_.empty() && !syncing_); });
    // More may come: of many small tasks the folder and the journal are synced once.
    changed_.wait_for(lock, waits_.next, [this] { return ends_.load(); });
    if (ends_) return;
    if (!syncing_) sync_all(lock);
  }
}

void GroupCommit::sync_all(std::unique_lock<std::mutex>& lock) {
  const std::set<fs::path> paths = std::exchange(waiting_, {});
  syncing_ = true;
  lock.unlock();
  std::exception_ptr failure;
  try {
    for (const fs::path& path : paths) {
      if (ends_) break;
      sync_if_there(path);
    }
    journal_.sync();
  } catch (...) {
    failure = std::current_exception();
  }
  lock.lock();
  if (failure != nullptr) refused_.insert(paths.begin(), paths.end());
  syncing_ = false;
  if (failure_ == nullptr) failure_ = failure;
  changed_.notify_all();
}

fs::path aside_path(const fs::path& final_path, const std::string& writer) {
  fs::path path = final_path;
  if (!writer.empty()) path += "." + writer;
  path += ".part";
  return path;
}

bool is_result(const std::string& name) {
  return name == kOutputName || name.starts_with(kSidecarName);
}

fs::path committed_path(const JobState& state, const std::string& name) {
  if (name == kOutputName) return state.output;
  if (name.starts_with(kSidecarName))
    return state.output.parent_path() / name.substr(std::strlen(kSidecarName));
  return state.work / name;
}

bool files_match(const JobState& state, const TaskRecord& record, bool hash) {
  return std::all_of(record.files.begin(), record.files.end(), [&](const FileRecord& file) {
    const fs::path path = committed_path(state, file.name);
    std::error_code error;
    const std::uintmax_t bytes = fs::file_size(path, error);
    return !error && bytes == file.bytes && (!hash || hash_file(path) == file.xxh3);
  });
}

TaskRecord run_and_commit(const Stage& stage, std::int64_t task, const std::vector<Json>& summaries,
                          const JobState& state, const std::string& basis, const std::string& plan,
                          JournalWriter& journal, const std::function<Json()>& stage_stats,
                          const TaskAids& aids) {
  const auto start = std::chrono::steady_clock::now();
  const double cpu_start = thread_cpu_seconds();
  const LoopClock loops;
  const Asides asides{state, journal.name(), aids.scratch};
  RunningTask context(asides, aids);
  if (aids.notes != nullptr) aids.notes->started(stage.name(), task);
  TaskRecord record;
  record.stage = stage.name();
  record.task = task;
  record.basis = basis;
  record.plan = plan;
  record.need_bytes = aids.need_bytes;
  try {
    if (task == kFinishTask) {
      record.summary = stage.finish(summaries, context);
      record.tasks = stage.task_count();
      record.obsolete = stage.obsolete();
    } else {
      record.summary = stage.run(static_cast<std::size_t>(task), context);
    }
  } catch (const Error&) {
    throw;
  } catch (const std::bad_alloc&) {
    throw;
  } catch (const std::system_error& e) {
    if (e.code().value() == ENOSPC || e.code().value() == EDQUOT)
      throw_write_error(state.work, e.code().value());
    throw;
  } catch (const std::exception& e) {
    throw std::runtime_error(fmt::format("stage {}, task {}: {}", record.stage,
                                         task == kFinishTask ? "finish" : std::to_string(task), e.what()));
  }
  if (TaskRecord theirs; aids.elsewhere && aids.elsewhere(theirs)) {
    for (const std::string& name : context.names()) {
      std::error_code ignored;  // a leftover only takes space
      if (name != kOutputName) fs::remove(asides.made(name), ignored);
    }
    return theirs;
  }
  std::set<fs::path> later;
  place_files(asides, context.names(), aids.group != nullptr ? &later : nullptr, record);
  record.units = context.units();
  record.bytes_read = context.read();
  record.bytes_written = context.written();
  record.peak_bytes = peak_resident_bytes();
  const LoopSeconds in_loops = loops.seconds();
  record.cpu_seconds = thread_cpu_seconds() - cpu_start + in_loops.all - in_loops.here;
  record.seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  if (task == kFinishTask) {
    record.stage_stats = stage_stats();
    record.stage_stats["loops_s"] = in_loops.all;
    record.stage_stats["ordered_s"] = in_loops.in_order;
  }
  journal.append(record, aids.group == nullptr && (aids.lasting || !record.files.empty()));
  // After its line, which the journal's sync then brings along.
  if (aids.group != nullptr) aids.group->add(later);
  fault_point(FaultPoint::kCommit);
  return record;
}

}  // namespace tessera
