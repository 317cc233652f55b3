#include "stream/runtime/commit.h"

#include <algorithm>
#include <atomic>
#include <chrono>
#include <cstring>
#include <ctime>
#include <mutex>
#include <set>

#include <fmt/format.h>

#include "octree/error.h"
#include "stream/files/durable_file.h"
#include "stream/files/fault.h"
#include "stream/runtime/memory_budget.h"
#include "stream/runtime/stop.h"

namespace tessera {
namespace {

namespace fs = std::filesystem;

fs::path part_path(const JobState& state, const std::string& name) {
  return aside_path(committed_path(state, name));
}

double thread_cpu_seconds() {
  timespec now = {};
  ::clock_gettime(CLOCK_THREAD_CPUTIME_ID, &now);
  return static_cast<double>(now.tv_sec) + 1e-9 * static_cast<double>(now.tv_nsec);
}

class RunningTask : public TaskContext {
 public:
  RunningTask(const JobState& state, Progress* progress) : state_(state), progress_(progress) {}

  fs::path create(const std::string& name) override {
    const fs::path relative(name);
    if (name.empty() || relative.is_absolute() || relative.lexically_normal() != relative ||
        name.front() == '.' || name.back() == '/') {
      throw std::logic_error("create('" + name + "'): not a name relative to the work directory");
    }
    const fs::path path = part_path(state_, name);
    std::error_code error;
    fs::create_directories(path.parent_path(), error);
    if (error) throw_write_error(path.parent_path(), error.value());
    const std::lock_guard lock(mutex_);
    if (std::find(names_.begin(), names_.end(), name) == names_.end()) names_.push_back(name);
    return path;
  }
  void check_stop() const override { throw_if_stopped(); }
  void advance(std::uint64_t units) override {
    units_ += units;
    if (progress_ != nullptr) progress_->advance(units);
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
  const JobState& state_;
  Progress* progress_;
  std::mutex mutex_;
  std::vector<std::string> names_;
  std::atomic<std::uint64_t> units_{0}, read_{0}, written_{0};
};

/// Syncs the files and gives them their names.
void place_files(const JobState& state, const std::vector<std::string>& names, TaskRecord& record) {
  fault_point();
  for (const std::string& name : names) {
    const fs::path part = part_path(state, name);
    sync_file(part);
    record.files.push_back({name, fs::file_size(part), hash_file(part)});
  }
  fault_point();
  std::set<fs::path> folders;
  for (const std::string& name : names) {
    const fs::path path = committed_path(state, name);
    std::error_code error;
    fs::rename(part_path(state, name), path, error);
    if (error) throw_write_error(path, error.value());
    folders.insert(path.parent_path());
  }
  for (const fs::path& folder : folders) sync_folder(folder);
  fault_point();
}

}  // namespace

fs::path aside_path(const fs::path& final_path) {
  fs::path path = final_path;
  path += ".part";
  return path;
}

fs::path committed_path(const JobState& state, const std::string& name) {
  if (name == kOutputName) return state.output;
  if (name.starts_with(kBesideName))
    return state.output.parent_path() / name.substr(std::strlen(kBesideName));
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

TaskRecord run_and_commit(const Stage& stage, std::int64_t task, const std::vector<nlohmann::json>& summaries,
                          const JobState& state, const std::string& basis, const std::string& plan,
                          JournalWriter& journal, const std::function<nlohmann::json()>& stage_stats,
                          Progress* progress) {
  const auto start = std::chrono::steady_clock::now();
  const double cpu_start = thread_cpu_seconds();
  RunningTask context(state, progress);
  TaskRecord record;
  record.stage = stage.name();
  record.task = task;
  record.basis = basis;
  record.plan = plan;
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
  place_files(state, context.names(), record);
  record.units = context.units();
  record.bytes_read = context.read();
  record.bytes_written = context.written();
  record.peak_bytes = peak_resident_bytes();
  record.cpu_seconds = thread_cpu_seconds() - cpu_start;
  record.seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  if (task == kFinishTask) record.stage_stats = stage_stats();
  journal.append(record);
  fault_point();
  return record;
}

}  // namespace tessera
