#include <fmt/format.h>

#include <algorithm>
#include <memory>

#include "octree/error.h"
#include "stream/files/json.h"
#include "stream/files/path_text.h"
#include "stream/queue/job_status.h"
#include "stream/runtime/memory_budget.h"
#include "stream/runtime/work_dir.h"
#include "stream/stages/jobs.h"
#include "tools/commands.h"
#include "tools/frame/cli.h"

namespace tessera {
namespace {

namespace fs = std::filesystem;
struct StatusArguments {
  fs::path work;
  bool as_json = false;
};

std::string time_text(double seconds) {
  const auto s = static_cast<std::uint64_t>(std::max(0.0, seconds));
  if (s < 60) return fmt::format("{} s", s);
  if (s < 3600) return fmt::format("{}:{:02} min", s / 60, s % 60);
  return fmt::format("{}:{:02} h", s / 3600, s / 60 % 60);
}

void print_text(const JobStatus& status) {
  const auto done = std::count_if(status.stages.begin(), status.stages.end(),
                                  [](const StageStatus& stage) { return stage.complete; });
  fmt::print("{}: {}, {} of {} stages done\n\n", status.output.string(), status.command, done,
             status.stages.size());
  fmt::print("{:<18}{:>8}{:>8}{:>9}{:>8}{:>8}{:>13}{:>13}{:>11}\n", "stage", "tasks", "done", "running",
             "failed", "lost", "read", "written", "seconds");
  for (const StageStatus& stage : status.stages) {
    if (!stage.complete && !stage.tasks && stage.running + stage.failed + stage.lost == 0) continue;
    fmt::print("{:<18}{:>8}{:>8}{:>9}{:>8}{:>8}{:>13}{:>13}{:>11.1f}{}\n", stage.name,
               stage.tasks ? std::to_string(*stage.tasks) : "?", stage.done, stage.running, stage.failed,
               stage.lost, format_bytes(stage.bytes_read), format_bytes(stage.bytes_written),
               stage.task_seconds, stage.complete ? "" : "  at work");
  }
  for (const std::string& failure : status.failures) fmt::print("failed: {}\n", failure);
  if (!status.queued.empty())
    fmt::print("queue: {} jobs, {} to {}\n", status.queued.size(), status.queued.front(),
               status.queued.back());
  if (status.left_s)
    fmt::print("about {} left{}\n", time_text(*status.left_s),
               status.left_is_of_stage ? " of this stage" : "");
}

void print_json(const JobStatus& status) {
  Json stages = Json::array();
  for (const StageStatus& stage : status.stages)
    stages.push_back({{"name", stage.name},
                      {"complete", stage.complete},
                      {"tasks", stage.tasks ? Json(*stage.tasks) : Json()},
                      {"done", stage.done},
                      {"running", stage.running},
                      {"failed", stage.failed},
                      {"lost", stage.lost},
                      {"bytes_read", stage.bytes_read},
                      {"bytes_written", stage.bytes_written},
                      {"task_seconds", stage.task_seconds}});
  const Json status_json = {{"command", status.command},
                            {"output", json_text(status.output)},
                            {"finished", false},
                            {"stages", std::move(stages)},
                            {"failures", status.failures},
                            {"queued", status.queued},
                            {"left_s", status.left_s ? Json(*status.left_s) : Json()}};
  fmt::print("{}\n", dump_json(status_json, 1));
}

/// The report of a job whose work directory has gone because it is done; empty if there is none.
fs::path report_of_done(const fs::path& work) {
  const fs::path name = fs::absolute(work).lexically_normal();
  if (fs::exists(name) || name.extension() != ".tessera") return {};
  fs::path report = fs::path(name).replace_extension();
  const fs::path output = report;
  report += ".report.json";
  return fs::exists(output) && fs::exists(report) ? report : fs::path();
}

void run(const StatusArguments& arguments) {
  if (arguments.work.empty()) throw UsageError("give the work directory, OUT.tessera");
  if (const fs::path report = report_of_done(arguments.work); !report.empty()) {
    if (arguments.as_json) {
      fmt::print("{}\n", dump_json(Json{{"finished", true}, {"report", json_text(report)}}, 1));
    } else {
      fmt::print("done: see {}\n", report.string());
    }
    return;
  }
  const JobStatus status = job_status(arguments.work, find_job);
  arguments.as_json ? print_json(status) : print_text(status);
}

}  // namespace

cli::Command status_command() {
  auto arguments = std::make_shared<StatusArguments>();
  OptionTable t;
  t.add("workdir", &arguments->work, "work directory of the job, OUT.tessera").positional();
  t.add("json", &arguments->as_json, "print it as JSON");
  return {"status",
          "How far a job is: stages, tasks done, running and failed, bytes, time left. Reads the journals "
          "alone, on any "
          "machine that sees the work directory.",
          t, [arguments] { run(*arguments); }};
}

}  // namespace tessera
