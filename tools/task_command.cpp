#include <fmt/format.h>

#include <memory>

#include "octree/error.h"
#include "stream/runtime/child_process.h"
#include "stream/runtime/journal.h"
#include "stream/runtime/options_json.h"
#include "stream/runtime/stop.h"
#include "stream/runtime/work_dir.h"
#include "stream/stages/decimate/decimate_job.h"
#include "stream/stages/reconstruct/reconstruct_job.h"
#include "stream/stages/smooth/smooth_stage.h"
#include "tools/cli.h"
#include "tools/commands.h"

namespace tessera {
namespace {

struct Arguments {
  std::filesystem::path work;
  std::string stage;
  std::string task;
  std::string writer;
  int driver = 0;
};

std::int64_t parse_task(const std::string& text) {
  if (text == "finish") return kFinishTask;
  if (!text.empty() && text.size() < 10 && text.find_first_not_of("0123456789") == std::string::npos) {
    return std::stoll(text);
  }
  throw UsageError(fmt::format("'{}' is no task: give its number, or finish", text));
}

JobDescription job_of(const std::filesystem::path& work) {
  const nlohmann::json identity = WorkDir::open_existing(work, false).identity();
  const auto command = identity.at("command").get<std::string>();
  if (command == "decimate") return decimate_job(identity.at("options").dump());
  if (command == "smooth") return smooth_job(smooth_options(identity.at("options").dump()));
  return reconstruct_job(reconstruct_options_from_json(identity.at("options")));
}

void run(const Arguments& arguments) {
  if (arguments.work.empty() || arguments.stage.empty()) throw UsageError("give WORKDIR, STAGE and K");
  if (arguments.driver != 0) follow_parent(arguments.driver);
  catch_stop_signals();
  run_single_task(arguments.work, job_of(arguments.work), arguments.stage, parse_task(arguments.task),
                  arguments.writer, arguments.driver != 0);
}

}  // namespace

void add_task(CLI::App& app) {
  auto arguments = std::make_shared<Arguments>();
  CLI::App* command = cli::add_command(app, "task",
                                       "One task of a job begun by plan, reconstruct or decimate; safe to "
                                       "repeat, and to run beside other tasks.",
                                       [arguments] { run(*arguments); });
  command->add_option("workdir", arguments->work, "work directory, on a disk that all machines share");
  command->add_option("stage", arguments->stage, "name of the stage");
  command->add_option("k", arguments->task, "number of the task, or finish");
  command->add_option("--writer", arguments->writer, "name of the journal file to write")->group("");
  command->add_option("--driven", arguments->driver, "process that waits for this one")->group("");
}

}  // namespace tessera
