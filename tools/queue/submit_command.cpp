#include <fmt/format.h>

#include <algorithm>
#include <map>
#include <memory>

#include "octree/error.h"
#include "stream/files/scratch_folder.h"
#include "stream/queue/submission.h"
#include "stream/runtime/journal.h"
#include "stream/runtime/log.h"
#include "stream/runtime/memory_budget.h"
#include "stream/runtime/resume.h"
#include "stream/runtime/work_dir.h"
#include "stream/stages/reconstruct/forecast.h"
#include "stream/stages/reconstruct/reconstruct_job.h"
#include "tools/commands.h"
#include "tools/frame/cli.h"

namespace tessera {
namespace {

namespace fs = std::filesystem;

/// Cap of an element without --memory: where nothing is known of the nodes, and the least where they are large enough.
constexpr std::uint64_t kElementBytes = std::uint64_t{2} << 30;
constexpr double kEndShare = 0.25;  ///< of a stage's time, what its end may take
constexpr double kGigabyte = 1e9;

/// Seconds of one core for a gigabyte of input, as the README's tables have them; a job without a plan is divided by them.
const std::map<std::string, double>& job_rates() {
  static const std::map<std::string, double> rates = {
      {"csg", 60.0},     {"decimate", 110.0}, {"deform", 130.0},   {"merge", 60.0},   {"reconstruct", 60.0},
      {"remesh", 900.0}, {"resample", 300.0}, {"resurface", 60.0}, {"smooth", 130.0}, {"tiles", 200.0}};
  return rates;
}

struct SubmitArguments {
  std::vector<std::string> words;
  QueueOptions options;
};

OptionTable table_of(QueueOptions& o) {
  OptionTable t("The queue");
  t.add("partition", &o.partition, "of the queue; default: its own").shown_as("NAME");
  t.add("account", &o.account, "to be charged").shown_as("NAME");
  t.add("nodes", &o.nodes,
        "elements that may well run at once: a stage is divided among so many at least, unless they "
        "would last less than some seconds")
      .within(1, 100000);
  t.add("element-seconds", &o.element_seconds,
        "how long an element is to run by the forecast, seconds: longer stages get "
        "more elements")
      .within(0.01, 86400);
  t.add("time-margin", &o.time_margin, "time asked for by time forecast").within(1, 100);
  t.add("array-limit", &o.array_limit, "most elements of an array").within(1, 1000000);
  t.add("scratch", &o.scratch,
        "folder on a disk of every node in which files are made before they are shared");
  t.add("dry-run", &o.dry_run, "submit nothing, print the scripts");
  return t;
}

/// How many stages are committed, by their journal and the sizes of their files.
std::size_t complete_stages(const JobState& state, const JobDescription& job) {
  const WorkDir work = WorkDir::open_existing(state.work, false);
  std::vector<std::string> names;
  for (const StageEntry& stage : job.stages) names.push_back(stage.name);
  Resume resume(state, names, work.job_hash(), false);
  std::string basis = resume.first_basis();
  std::vector<StageRecords> found;
  return resume.complete_until(read_journal(work.journal_folder()), 0, basis, found);
}

/// What is known of the stages from `first` on.
/// \param planned  work directory with a plan, or empty
std::vector<StageEstimate> estimate(const JobState& state, const JobDescription& job, std::size_t first,
                                    const fs::path& planned) {
  std::map<std::string, StageForecast> forecasts;
  if (!planned.empty())
    for (const StageForecast& f : Forecast::of_work(planned).stages) forecasts[f.stage] = f;
  double bytes = 0.0;
  for (const fs::path& input : state.inputs) bytes += static_cast<double>(fs::file_size(input));
  const double whole = job_rates().at(job.command) * bytes / kGigabyte / state.run.threads;
  std::vector<StageEstimate> stages;
  for (std::size_t s = first; s < job.stages.size(); ++s) {
    StageEstimate stage;
    stage.stage = job.stages[s].name;
    if (const auto at = forecasts.find(stage.stage); at != forecasts.end()) {
      const StageForecast& f = at->second;
      stage.tasks = f.tasks, stage.task_bytes = f.task_bytes, stage.finish_bytes = f.finish_bytes;
      stage.seconds = f.seconds * (1.0 + kEndShare);
      stage.idle = f.is_idle();
    } else if (planned.empty() && !stage.stage.starts_with("again-")) {  // rounds that hardly ever come
      stage.seconds = whole / 2.0;  // no two stages of a job take more than half of it each
    }
    stages.push_back(stage);
  }
  return stages;
}

void print_scripts(const SlurmJob& job, const std::vector<QueueStep>& steps, const QueueOptions& options) {
  const std::vector<std::string> scripts = submission_scripts(job, steps, options);
  for (std::size_t i = 0; i < scripts.size(); ++i) {
    fmt::print("# {} of {}: sbatch{}\n{}\n", i + 1, scripts.size(),
               i == 0 ? "" : fmt::format(" --dependency=afterok:<number of {}>", i), scripts[i]);
  }
}

struct ChosenMemory {
  std::uint64_t bytes = kElementBytes;
  std::string sentence;
};
/// The cap of an element where none is given, by the nodes that it may run on, not by this machine.
ChosenMemory choose_memory(const SlurmPartition& partition, int threads) {
  ChosenMemory chosen;
  std::string reason = "as sinfo tells of no node here";
  if (!partition.nodes.empty()) {
    const SlurmNode& node = partition.nodes.front();
    chosen.bytes = element_memory(partition, threads, kElementBytes);
    reason = fmt::format("by the nodes of the partition {}, of which the smallest has {} and {} CPUs",
                         partition.name, format_bytes(node.memory_bytes), node.cpus);
  }
  chosen.sentence = fmt::format("memory of an element: {}, {}; --memory gives another\n",
                                format_bytes(chosen.bytes), reason);
  return chosen;
}

void require_steps_fit(const SlurmPartition& partition, const std::vector<QueueStep>& steps, int threads) {
  for (const QueueStep& step : steps) require_fits(partition, threads, step.memory_bytes);
}

/// \param given  as the job's command has read its line
void submit_job(const SubmitArguments& arguments, const JobState& given, const JobDescription& job) {
  if (job.only_stages > 0 || job_rates().count(job.command) == 0)
    throw UsageError(fmt::format("{}: is no job that can be submitted", arguments.words.front()));
  if (!given.run.until.empty() || given.run.processes)
    throw UsageError(
        "--until and --processes are for jobs on one machine, submit runs all stages as processes");
  for (const std::string& word : arguments.words)
    if (job.command == "deform" && word.starts_with("--poses"))
      throw UsageError("--poses are many jobs: submit each with --pose");
  JobState state = given;
  SlurmJob slurm;
  slurm.command = arguments.words;
  if (state.run.threads == 0) {
    state.run.threads = 1;
    slurm.command.insert(slurm.command.end(), {"--threads", "1"});
  }
  const SlurmPartition partition = slurm_partition(arguments.options.partition);
  std::string memory_sentence;  // said once the job is accepted
  if (state.run.memory_bytes == 0) {
    ChosenMemory chosen = choose_memory(partition, state.run.threads);
    state.run.memory_bytes = chosen.bytes;
    memory_sentence = std::move(chosen.sentence);
    slurm.command.insert(slurm.command.end(), {"--memory", std::to_string(state.run.memory_bytes)});
  }
  require_fits(partition, state.run.threads, 0);
  slurm.program = fs::read_symlink("/proc/self/exe");
  slurm.folder = fs::current_path();
  slurm.threads = state.run.threads;
  slurm.token = submission_token();
  const QueueOptions& options = arguments.options;
  const bool plans = job.command == "reconstruct";

  if (options.dry_run) {
    if (!begin_job(state, job, false)) return fmt::print("{}: is done already\n", state.output.string());
    slurm.work = state.work;
    fs::path planned;
    std::unique_ptr<ScratchFolder> scratch;
    std::size_t first = 0;
    if (plans) {
      scratch = std::make_unique<ScratchFolder>(fs::temp_directory_path(), "plan");
      JobState plan = state;
      plan.output = scratch->path() / "plan.ply";
      plan.run.temp.clear();
      plan.run.memory_bytes = std::min(plan.run.memory_bytes, detect_memory_cap().bytes);
      run_job(plan, plan_job(), cli::stderr_sink());
      planned = work_path(plan.output, {});
      first = plan_job().only_stages;
    }
    const std::vector<QueueStep> steps =
        queue_steps(estimate(state, job, first, planned), state.run.memory_bytes, state.run.threads, options);
    require_steps_fit(partition, steps, state.run.threads);
    fmt::print(stderr, "{}", memory_sentence);
    return print_scripts(slurm, steps, options);
  }

  forget_ended_submission(work_path(fs::absolute(state.output).lexically_normal(), state.run.temp));
  if (!begin_job(state, job)) return fmt::print("{}: is done already\n", state.output.string());
  if (plans) {  // on this machine, which may have less memory than a node
    JobState here = state;
    here.run.memory_bytes = std::min(state.run.memory_bytes, detect_memory_cap().bytes);
    run_job(here, plan_job(), cli::stderr_sink());
    begin_job(state, job);
  }
  slurm.work = state.work;
  const std::size_t first = complete_stages(state, job);
  const bool is_planned = plans && fs::exists(state.work / Forecast::kFile);
  std::vector<QueueStep> steps =
      queue_steps(estimate(state, job, first, is_planned ? state.work : fs::path()), state.run.memory_bytes,
                  state.run.threads, options);
  if (steps.empty()) steps.push_back({"report", {}, 1, state.run.memory_bytes, 0.0});
  require_steps_fit(partition, steps, state.run.threads);
  const std::vector<std::string> numbers = submit(slurm, steps, options);
  fmt::print(stderr, "{}", memory_sentence);
  int elements = 0;
  for (const QueueStep& step : steps) elements += step.elements;
  fmt::print(
      "{}: {} jobs with {} elements are in the queue, {} to {}; tessera status {} tells how far they are\n",
      state.output.string(), steps.size(), elements, numbers.front(), numbers.back(),
      shell_word(state.work.string()));
}

}  // namespace

cli::Command submit_command(const std::vector<cli::Command>& jobs) {
  auto arguments = std::make_shared<SubmitArguments>();
  cli::Command command = {
      "submit",
      "Hands a job to Slurm: submit JOB..., as submit reconstruct scan.las -o site.ply --nodes 8. An array "
      "for each "
      "stage, its elements on any node that shares the folders; --memory and --threads are those of one "
      "element (default: its threads' share of the smallest node by sinfo, at least 2G if that has them; and "
      "1). The same command goes on where jobs failed.",
      table_of(arguments->options), [arguments, jobs] {
        if (arguments->words.empty())
          throw UsageError("give the job: submit reconstruct scan.las -o site.ply");
        take_jobs(
            [&](const JobState& state, const JobDescription& job) { submit_job(*arguments, state, job); });
        try {
          cli::run_words("tessera", jobs, arguments->words);
        } catch (const JobTaken&) {
          return;
        }
        throw UsageError(fmt::format("{}: is no job that can be submitted", arguments->words.front()));
      }};
  command.rest = &arguments->words;
  return command;
}

}  // namespace tessera
