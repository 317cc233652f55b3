#include "stream/queue/job_status.h"

#include <algorithm>
#include <map>
#include <set>

#include <fmt/format.h>

#include "stream/files/durable_file.h"
#include "stream/files/json.h"
#include "stream/runtime/journal.h"
#include "stream/runtime/resume.h"
#include "stream/runtime/task_notes.h"
#include "stream/runtime/work_dir.h"

namespace tessera {
namespace {

namespace fs = std::filesystem;
using Tasks = std::map<std::int64_t, const TaskRecord*>;

std::string task_name(const NotedTask& task) {
  return task.task == kFinishTask ? fmt::format("stage {}, its end", task.stage)
                                  : fmt::format("stage {}, task {}", task.stage, task.task);
}

/// A file of the work directory that may not be there, or not be whole.
Json optional_json(const fs::path& path) {
  if (!fs::exists(path)) return nullptr;
  return try_parse_json(read_text(path));
}

/// What the plan of a reconstruction told of each stage.
std::map<std::string, double> forecast_seconds(const fs::path& work) {
  std::map<std::string, double> seconds;
  const Json forecast = optional_json(work / "forecast.json");
  if (!forecast.is_object()) return seconds;
  for (const Json& stage : forecast.value("forecast", Json::array()))
    if (stage.is_object()) seconds[stage.value("stage", "")] = stage.value("seconds", 0.0);
  return seconds;
}

void add_done(const Tasks& tasks, StageStatus& status) {
  for (const auto& [task, record] : tasks) {
    if (task != kFinishTask) ++status.done;
    status.bytes_read += record->bytes_read;
    status.bytes_written += record->bytes_written;
    status.task_seconds += record->seconds;
  }
}

/// What is begun and not done: each task once, by its last note.
void add_begun(const Notes& notes, const Tasks& done, StageStatus& status,
               std::vector<std::string>& failures) {
  std::map<std::int64_t, const NotedTask*> last;
  for (const NotedTask& task : notes.tasks) {
    if (task.stage != status.name || done.count(task.task) > 0) continue;
    const NotedTask*& known = last[task.task];
    if (known == nullptr || known->begun < task.begun) known = &task;
  }
  for (const auto& [number, task] : last) {
    if (!task->failure.empty()) {
      ++status.failed;
      failures.push_back(fmt::format("{}, on {}: {}", task_name(*task), task->host, task->failure));
    } else if (task->ended || task->silent_s > JobStatus::kSilentSeconds) {
      ++status.lost;
    } else {
      ++status.running;
    }
  }
}

/// Seconds that a stage still takes at the pace of its tasks so far.
std::optional<double> left_of(const StageStatus& stage) {
  if (!stage.tasks || stage.done == 0 || stage.running == 0) return std::nullopt;
  const double each = stage.task_seconds / static_cast<double>(stage.done);
  return each * static_cast<double>(*stage.tasks - std::min(*stage.tasks, stage.done)) /
         static_cast<double>(stage.running);
}

void tell_time(JobStatus& status) {
  const auto at = std::find_if(status.stages.begin(), status.stages.end(),
                               [](const StageStatus& stage) { return stage.running > 0; });
  if (at == status.stages.end()) return;
  const std::optional<double> stage = left_of(*at);
  double planned = 0.0, share = at->forecast_seconds;
  bool is_planned = share > 0.0;
  if (at->tasks && *at->tasks > 0)
    share *= 1.0 - std::min(1.0, static_cast<double>(at->done) / static_cast<double>(*at->tasks));
  for (auto next = at + 1; next != status.stages.end(); ++next) {
    planned += next->forecast_seconds;
    is_planned = is_planned || next->forecast_seconds > 0.0;
  }
  status.left_is_of_stage = !is_planned;
  if (is_planned) {
    status.left_s = planned + stage.value_or(share);
  } else {
    status.left_s = stage;
  }
}

}  // namespace

JobStatus job_status(const fs::path& path, const JobFinder& find_job) {
  const WorkDir work = WorkDir::open_existing(path, false);
  const JobState state = work.read_state();
  JobStatus status;
  status.command = work.identity().at("command").get<std::string>();
  status.output = state.output;
  const JobDescription job = find_job(status.command, state.settings);
  refresh_names(work.journal_folder());
  const Journal journal = read_journal(work.journal_folder());
  const Notes notes = read_notes(work.journal_folder());
  const std::map<std::string, double> forecast = forecast_seconds(work.path());
  const std::string plan = plan_hash(state.run);
  std::string basis = work.job_hash();
  bool follows = true;  // every stage so far is complete
  for (const StageEntry& entry : job.stages) {
    StageStatus stage;
    stage.name = entry.name;
    if (const auto seconds = forecast.find(entry.name); seconds != forecast.end())
      stage.forecast_seconds = seconds->second;
    StageRecords records;
    stage.complete = follows && find_complete(journal, entry.name, basis, records);
    if (follows) {
      const Tasks done = journal.find(entry.name, basis, stage.complete ? records.finish.plan : plan);
      add_done(done, stage);
      if (const auto noted = notes.stages.find(entry.name); noted != notes.stages.end())
        stage.tasks = noted->second.tasks;
      if (stage.complete) {
        stage.tasks = records.finish.tasks;
        basis = next_basis(basis, records);
      } else {
        add_begun(notes, done, stage, status.failures);
      }
      follows = stage.complete;
    }
    status.stages.push_back(std::move(stage));
  }
  const Json mark = optional_json(work.path() / kQueueMark);
  if (mark.is_object())
    for (const Json& number : mark.value("jobs", Json::array()))
      status.queued.push_back(number.get<std::string>());
  tell_time(status);
  return status;
}

}  // namespace tessera
