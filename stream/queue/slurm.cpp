#include "stream/queue/slurm.h"

#include <algorithm>
#include <cerrno>
#include <cstdlib>
#include <cstring>
#include <limits>
#include <set>
#include <sstream>
#include <utility>

#include <fcntl.h>
#include <spawn.h>
#include <sys/wait.h>
#include <unistd.h>

#include <fmt/format.h>

#include "octree/error.h"
#include "stream/runtime/log.h"
#include "stream/runtime/memory_budget.h"
#include "stream/runtime/work_dir.h"

namespace tessera {
namespace {

namespace fs = std::filesystem;

constexpr int kMaxRestarts = 20;
constexpr int kPatienceSeconds = 90;  ///< a network file system tells of new files within a minute
constexpr int kNoSuchProgram = 127;

struct Said {
  int code = 0;
  std::string text;  ///< both of its outputs
};

/// Runs a program of the path and waits.
Said run_program(std::vector<std::string> words) {
  int ends[2] = {-1, -1};
  if (::pipe2(ends, O_CLOEXEC) != 0)
    throw ResourceError(fmt::format("cannot start {}: {}", words.front(), std::strerror(errno)));
  std::vector<char*> arguments;
  for (std::string& word : words) arguments.push_back(word.data());
  arguments.push_back(nullptr);
  posix_spawn_file_actions_t actions;
  ::posix_spawn_file_actions_init(&actions);
  ::posix_spawn_file_actions_adddup2(&actions, ends[1], STDOUT_FILENO);
  ::posix_spawn_file_actions_adddup2(&actions, ends[1], STDERR_FILENO);
  pid_t child = 0;
  const int error = ::posix_spawnp(&child, arguments[0], &actions, nullptr, arguments.data(), environ);
  ::posix_spawn_file_actions_destroy(&actions);
  ::close(ends[1]);
  Said said;
  if (error == 0) {
    char buffer[1024];
    for (;;) {
      const ssize_t got = ::read(ends[0], buffer, sizeof buffer);
      if (got < 0 && errno == EINTR) continue;
      if (got <= 0) break;
      said.text.append(buffer, static_cast<std::size_t>(got));
    }
    int status = 0;
    while (::waitpid(child, &status, 0) < 0 && errno == EINTR) {
    }
    said.code = WIFEXITED(status) ? WEXITSTATUS(status) : -1;
  }
  ::close(ends[0]);
  if (error == ENOENT || said.code == kNoSuchProgram)
    throw UsageError(
        fmt::format("{}: is not installed here: this needs the commands of Slurm", words.front()));
  if (error != 0)
    throw ResourceError(fmt::format("cannot start {}: {}", words.front(), std::strerror(error)));
  while (!said.text.empty() && said.text.back() == '\n') said.text.pop_back();
  return said;
}

std::string one_line(std::string text) {
  std::replace(text.begin(), text.end(), '\n', ' ');
  return text;
}

// Told to stop ahead of its time limit, or killed: what is committed stays, a new start does the rest. Whoever took the
// job out of the queue must not find it there again, so the queue is asked what it thinks of this job.
constexpr const char* kStep = R"sh(
id=${SLURM_JOB_ID:-}
[ -z "${SLURM_ARRAY_JOB_ID:-}" ] || id=${SLURM_ARRAY_JOB_ID}_$SLURM_ARRAY_TASK_ID
child= stopped=
trap 'stopped=1; [ -z "$child" ] || kill -TERM "$child" 2>/dev/null' TERM
step() {
  code=143
  if [ -z "$stopped" ]; then
    "$@" & child=$!
    wait "$child"; code=$?
    while kill -0 "$child" 2>/dev/null; do wait "$child"; code=$?; done
    child=
  fi
  [ "$code" -ne 0 ] || return 0
  if [ "$code" -eq 143 ] || [ "$code" -eq 137 ]; then
    if [ -e "$work/$mark" ] && [ "${SLURM_RESTART_COUNT:-0}" -lt "$most_restarts" ] &&
       scontrol show job "$id" 2>/dev/null | grep -q 'JobState=RUNNING'; then
      scontrol requeue "$id" && sleep 300
    fi
  fi
  exit "$code"
}
)sh";

}  // namespace

std::string slurm_script(const SlurmJob& job, const QueueStep& step, const QueueOptions& options, int number,
                         bool last) {
  const std::string label = fmt::format("{:02}-{}", number, step.name);
  const bool is_array = step.elements > 1;
  const fs::path log = job.work / kQueueFolder / (label + (is_array ? "-%a.log" : ".log"));
  std::string text = "#!/bin/bash\n";
  const auto set = [&](const std::string& option, const std::string& value) {
    text += fmt::format("#SBATCH --{}{}{}\n", option, value.empty() ? "" : "=", value);
  };
  set("job-name", "tessera-" + label);
  if (is_array) set("array", fmt::format("0-{}", step.elements - 1));
  if (!options.partition.empty()) set("partition", options.partition);
  if (!options.account.empty()) set("account", options.account);
  set("nodes", "1");
  set("ntasks", "1");
  set("cpus-per-task", std::to_string(job.threads));
  set("mem", fmt::format("{}M", (step.memory_bytes + (1u << 20) - 1) >> 20));
  set("time", std::to_string(minutes_of(step, options)));
  set("signal", "B:TERM@60");
  set("requeue", "");
  set("kill-on-invalid-dep", "yes");
  set("open-mode", "append");
  // The work directory goes with its job, so nothing in it may be open then.
  set("output", last ? "/dev/null" : shell_word(log.string()));
  set("chdir", shell_word(job.folder.string()));
  text += fmt::format("\ntessera={}\nwork={}\nmark={}\nmost_restarts={}\nexport {}={}",
                      shell_word(job.program.string()), shell_word(job.work.string()), kQueueMark,
                      kMaxRestarts, kQueueToken, job.token);
  if (last) text += "\nlog=" + shell_word(log.string());
  text += kStep;
  text += "\n";
  const std::string scratch =
      options.scratch.empty() ? "" : " --scratch " + shell_word(options.scratch.string());
  for (const QueueLine& line : step.lines) {
    const std::string choice =
        line.choice == "share" ? fmt::format("\"$SLURM_ARRAY_TASK_ID/{}\"", step.elements) : line.choice;
    text += fmt::format("step \"$tessera\" task \"$work\" {} {} --wait {}{}{}\n", line.stage, choice,
                        kPatienceSeconds, scratch, last ? " 2>>\"$log\"" : "");
  }
  if (last) {
    std::string words;
    for (const std::string& word : job.command) words += " " + shell_word(word);
    text += fmt::format(
        "# All is committed: the job's own command finds nothing to compute, writes the report and tidies "
        "up.\n"
        "step \"$tessera\"{} --progress none\n",
        words);
  }
  return text;
}

SlurmPartition slurm_partition(const std::string& partition) {
  // One line a node: groups of unlike ones would show the least of each number, with a plus.
  std::vector<std::string> words = {"sinfo", "--noheader", "--Node", "--format=%P|%m|%c|%t"};
  const char* named = std::getenv("SBATCH_PARTITION");  // which sbatch follows, too
  const std::string wanted = partition.empty() && named != nullptr ? named : partition;
  if (!wanted.empty()) words.push_back("--partition=" + wanted);
  Said said;
  try {
    said = run_program(words);
  } catch (const Error&) {
    return {};
  }
  if (said.code != 0) return {};
  SlurmPartition found;
  std::istringstream lines(said.text);
  for (std::string line; std::getline(lines, line);) {
    std::istringstream fields(line);
    std::string name, memory, cpus, state;
    std::getline(fields, name, '|'), std::getline(fields, memory, '|'), std::getline(fields, cpus, '|'),
        std::getline(fields, state, '|');
    const bool is_default = !name.empty() && name.back() == '*';
    if (is_default) name.pop_back();
    const bool is_wanted =
        wanted.empty() ? is_default : name == wanted || wanted.find(',') != std::string::npos;
    if (!is_wanted) continue;
    if (state.starts_with("down") || state.starts_with("fail")) continue;
    const SlurmNode node = {std::strtoull(memory.c_str(), nullptr, 10) << 20, std::atoi(cpus.c_str())};
    if (node.memory_bytes == 0 || node.cpus < 1) continue;
    found.name = name;
    if (std::find(found.nodes.begin(), found.nodes.end(), node) == found.nodes.end())
      found.nodes.push_back(node);
  }
  std::sort(found.nodes.begin(), found.nodes.end(), [](const SlurmNode& a, const SlurmNode& b) {
    return std::pair(a.memory_bytes, a.cpus) < std::pair(b.memory_bytes, b.cpus);
  });
  return found;
}

std::uint64_t element_memory(const SlurmPartition& partition, int threads, std::uint64_t minimum) {
  constexpr double kShareOfNode = 0.8;  // the system and Slurm's daemon need some, too
  constexpr std::uint64_t kRounded = std::uint64_t{64} << 20;
  double share = std::numeric_limits<double>::infinity();
  for (const SlurmNode& node : partition.nodes)
    share = std::min(share, static_cast<double>(node.memory_bytes) *
                                std::min(1.0, static_cast<double>(threads) / node.cpus));
  const double maximum = kShareOfNode * static_cast<double>(partition.nodes.front().memory_bytes);
  const double wanted = std::min(maximum, std::max(share, static_cast<double>(minimum + kQueueBaseBytes)));
  const auto bytes =
      static_cast<std::uint64_t>(std::max(wanted - static_cast<double>(kQueueBaseBytes), wanted / 2));
  return bytes > 2 * kRounded ? bytes / kRounded * kRounded : bytes;
}

void require_fits(const SlurmPartition& partition, int threads, std::uint64_t memory_bytes) {
  if (partition.nodes.empty()) return;
  const auto holds = [&](const SlurmNode& n) { return n.cpus >= threads && n.memory_bytes >= memory_bytes; };
  if (std::any_of(partition.nodes.begin(), partition.nodes.end(), holds)) return;
  std::string kinds;
  for (const SlurmNode& n : partition.nodes)
    kinds +=
        fmt::format("{}{} with {} CPUs", kinds.empty() ? "" : ", ", format_bytes(n.memory_bytes), n.cpus);
  throw UsageError(
      fmt::format("no node of the partition {} has {} threads and {} for an element (its nodes: {}): give a "
                  "lower --memory or "
                  "--threads, or another --partition",
                  partition.name, threads, format_bytes(memory_bytes), kinds));
}

std::string slurm_advice(const std::string& words) {
  struct Known {
    const char* words;
    const char* advice;
  };
  // The first that fits counts. Words of Slurm 20 to 24.
  static constexpr Known kKnown[] = {
      {"Requested node configuration is not available",
       "no node of the partition has so much memory or so many CPUs: give a lower --memory or --threads, or "
       "another "
       "--partition (sinfo --Node --long lists the nodes)"},
      {"Memory specification can not be satisfied",
       "the partition gives no job so much memory: give a lower --memory or another --partition"},
      {"CPU count per node can not be satisfied",
       "no node has so many CPUs: give lower --threads or another --partition"},
      {"More processors requested than permitted", "give lower --threads or fewer --nodes"},
      {"invalid partition specified",
       "there is no such partition: sinfo --summarize lists those there are, for --partition"},
      {"Invalid partition name",
       "there is no such partition: sinfo --summarize lists those there are, for --partition"},
      {"No partition specified or system default partition",
       "the queue has no default partition: name one of sinfo --summarize with --partition"},
      {"group not permitted to use this partition",
       "you may not use this partition: give another --partition"},
      {"Invalid account or account/partition combination",
       "the account is unknown here or may not use the partition: give --account (sacctmgr show associations "
       "user=$USER lists yours) or another --partition"},
      {"Invalid qos",
       "the account or partition has no such quality of service: give another --account or --partition"},
      {"Requested time limit is invalid",
       "the partition ends jobs earlier than a stage needs: give more --nodes, fewer --element-seconds or a "
       "lower "
       "--time-margin for shorter elements, or another --partition"},
      {"Job violates accounting/QOS policy",
       "the account may not have so many jobs, or such large ones: give fewer --nodes, a lower --array-limit "
       "or "
       "--memory, or wait until jobs of yours have ended"},
      {"Invalid job array specification",
       "arrays may not have so many elements here: give a lower --array-limit"},
      {"Job dependency problem", "the job before it has ended already: give the same command again"},
      {"Slurm temporarily unable to accept job", "the queue is full: give the same command again later"},
      {"Unable to contact slurm controller",
       "Slurm does not answer: give the same command again when it does"},
      {"Socket timed out", "Slurm does not answer in time: give the same command again when it does"},
      {"Access/permission denied", "you may not submit jobs here: ask those who run the queue"}};
  const auto lower = [](std::string text) {
    for (char& c : text) c = c >= 'A' && c <= 'Z' ? static_cast<char>(c - 'A' + 'a') : c;
    return text;
  };
  const std::string said = lower(words);
  for (const Known& known : kKnown)
    if (said.find(lower(known.words)) != std::string::npos) return known.advice;
  return {};
}

std::string slurm_submit(const fs::path& script, const std::string& after) {
  std::vector<std::string> words = {"sbatch", "--parsable"};
  if (!after.empty()) words.push_back("--dependency=afterok:" + after);
  words.push_back(script.string());
  const Said said = run_program(words);
  if (said.code != 0) {
    const std::string advice = slurm_advice(said.text);
    throw ResourceError(fmt::format("{}: Slurm refuses it{}{} ({})", script.string(),
                                    advice.empty() ? "" : ": ", advice, one_line(said.text)));
  }
  // Warnings may stand before the number, a cluster's name behind it.
  std::string number = said.text.substr(said.text.find_last_of('\n') + 1);
  number = number.substr(0, number.find(';'));
  if (number.empty() || number.find_first_not_of("0123456789") != std::string::npos)
    throw ResourceError(fmt::format("sbatch gave no number of a job: {}", said.text));
  return number;
}

void slurm_cancel(const std::vector<std::string>& jobs) {
  if (jobs.empty()) return;
  std::vector<std::string> words = {"scancel"};
  words.insert(words.end(), jobs.begin(), jobs.end());
  const Said said = run_program(words);
  if (said.code != 0 && !slurm_active(jobs).empty()) throw ResourceError("scancel: " + said.text);
}

std::vector<std::string> slurm_active(const std::vector<std::string>& jobs) {
  if (jobs.empty()) return {};
  // With the name of one unknown job squeue fails altogether: all jobs of the user are asked for.
  const Said said = run_program({"squeue", "--noheader", "--me", "--states=all", "--format=%F %T"});
  if (said.code != 0) throw ResourceError("squeue: " + said.text);
  static const std::set<std::string> ended = {"BOOT_FAIL", "CANCELLED", "COMPLETED", "DEADLINE",     "FAILED",
                                              "NODE_FAIL", "TIMEOUT",   "PREEMPTED", "OUT_OF_MEMORY"};
  std::set<std::string> alive;
  std::istringstream lines(said.text);
  for (std::string number, state; lines >> number >> state;)
    if (ended.count(state) == 0) alive.insert(number);
  std::vector<std::string> active;
  for (const std::string& job : jobs)
    if (alive.count(job) > 0) active.push_back(job);
  return active;
}

}  // namespace tessera
