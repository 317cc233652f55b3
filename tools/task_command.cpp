#include <fmt/format.h>

#include <memory>

#include "octree/error.h"
#include "stream/runtime/child_process.h"
#include "stream/runtime/task_run.h"
#include "stream/stages/jobs.h"
#include "tools/commands.h"
#include "tools/frame/cli.h"

namespace tessera {
namespace {

struct TaskArguments {
  std::filesystem::path work;
  std::string stage;
  std::string task;
  std::string writer;
  int driver = 0;
  double wait_s = 0.0;
  std::filesystem::path scratch;
};

void run_task(const TaskArguments& arguments) {
  if (arguments.work.empty() || arguments.stage.empty()) throw UsageError("give WORKDIR, STAGE and K");
  if (arguments.driver != 0) follow_parent(arguments.driver);
  run_tasks(arguments.work, find_job, arguments.stage, parse_task_choice(arguments.task),
            {arguments.writer, arguments.driver != 0, arguments.wait_s, arguments.scratch});
}

}  // namespace

cli::Command task_command() {
  auto arguments = std::make_shared<TaskArguments>();
  TaskArguments& a = *arguments;
  OptionTable t;
  t.add("workdir", &a.work, "work directory, on a disk that all machines share").positional();
  t.add("stage", &a.stage, "name of the stage").positional();
  t.add("k", &a.task,
        "number of the task; I/N: the I-th share of N, counted from 0; finish: the end of the stage; all: "
        "the whole stage")
      .positional();
  t.add("wait", &a.wait_s, "seconds to wait for what other machines have committed to show up on this one")
      .at_least(0);
  t.add("scratch", &a.scratch, "folder on a disk of this machine in which files are made first");
  t.add("writer", &a.writer, "name of the journal file to write").hidden();
  t.add("driven", &a.driver, "process that waits for this one").hidden();
  return {"task",
          "One task, a share of a stage or a whole stage of a job that was begun by submit, plan or its own "
          "command; safe to "
          "repeat, and to run beside other tasks.",
          t, [arguments] { run_task(*arguments); }};
}

}  // namespace tessera
