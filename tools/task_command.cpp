#include <fmt/format.h>

#include <memory>

#include "octree/error.h"
#include "stream/runtime/child_process.h"
#include "stream/runtime/journal.h"
#include "stream/stages/jobs.h"
#include "tools/commands.h"
#include "tools/frame/cli.h"

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

void run(const Arguments& arguments) {
  if (arguments.work.empty() || arguments.stage.empty()) throw UsageError("give WORKDIR, STAGE and K");
  if (arguments.driver != 0) follow_parent(arguments.driver);
  run_single_task(arguments.work, find_job, arguments.stage, parse_task(arguments.task), arguments.writer,
                  arguments.driver != 0);
}

}  // namespace

cli::Command task_command() {
  auto arguments = std::make_shared<Arguments>();
  Arguments& a = *arguments;
  OptionTable t;
  t.add("workdir", &a.work, "work directory, on a disk that all machines share").positional();
  t.add("stage", &a.stage, "name of the stage").positional();
  t.add("k", &a.task, "number of the task, or finish").positional();
  t.add("writer", &a.writer, "name of the journal file to write").hidden();
  t.add("driven", &a.driver, "process that waits for this one").hidden();
  return {
      "task",
      "One task of a job begun by plan, reconstruct, decimate, remesh or smooth; safe to repeat, and to run "
      "beside other tasks.",
      t, [arguments] { run(*arguments); }};
}

}  // namespace tessera
