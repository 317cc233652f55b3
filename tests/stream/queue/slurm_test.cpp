// Scripts as bash runs them, with stand-ins for the commands of Slurm; the real one is in tests/tools/submit_test.cpp.
#include "stream/queue/slurm.h"

#include <sys/stat.h>

#include <catch2/catch.hpp>

#include "octree/error.h"
#include "stream/queue/submission.h"
#include "stream/runtime/work_dir.h"
#include "tests/helpers/shell.h"

namespace slurm_test {

using namespace tessera;
using test::file_bytes;
using test::Outcome;
using test::shell;
using test::spill;
using test::TempFolder;

namespace fs = std::filesystem;

namespace {

void script(const fs::path& path, const std::string& text) {
  spill(path, "#!/bin/bash\n" + text);
  ::chmod(path.c_str(), 0755);
}

/// A folder with a program, a work directory with a space in its name, and stand-ins for Slurm.
struct Setting {
  TempFolder folder;
  SlurmJob job;
  QueueOptions options;
  Setting() {
    job.program = folder / "bin/tessera";
    job.work = folder / "a b.ply.tessera";
    job.folder = folder.path();
    job.token = "0123";
    job.command = {"decimate", "it's.ply", "-o", "a b.ply"};
    script(job.program, "echo \"$@\" >>" + said_file() + "\nexit ${CODE:-0}\n");
    script(folder / "bin/scontrol",
           "echo \"scontrol $*\" >>" + said_file() +
               "\n[ $1 = requeue ] && kill -KILL $PPID; echo \"JobState=${STATE:-RUNNING}\"\n");
    spill(job.work / kQueueMark, "{}");
  }
  std::string said_file() const { return (folder / "said").string(); }
  QueueStep array() const { return {"mesh", {{"mesh", "share"}}, 16, 100 << 20, 60.0}; }
  QueueStep serial() const { return {"mesh", {{"mesh", "finish"}, {"write", "all"}}, 1, 100 << 20, 60.0}; }
  /// Runs the script of a step.
  Outcome run(const QueueStep& step, bool last, const std::string& environment) {
    spill(folder / "script.sh", slurm_script(job, step, options, 3, last));
    fs::remove(folder / "said");
    return shell("cd " + folder.path().string() + " && " + environment +
                 " PATH=" + (folder / "bin").string() + ":$PATH SLURM_JOB_ID=9 bash script.sh");
  }
  std::string said() const { return file_bytes(folder / "said"); }
};

}  // namespace

TEST_CASE("slurm: a script asks for what its step needs", "[unit]") {
  Setting s;
  s.options.partition = "long";
  s.options.account = "me";
  s.options.scratch = "/scratch/my jobs";
  s.job.threads = 4;
  const std::string text = slurm_script(s.job, s.array(), s.options, 3, false);
  for (const char* line :
       {"#SBATCH --job-name=tessera-03-mesh\n", "#SBATCH --array=0-15\n", "#SBATCH --partition=long\n",
        "#SBATCH --account=me\n", "#SBATCH --cpus-per-task=4\n", "#SBATCH --mem=100M\n", "#SBATCH --time=5\n",
        "#SBATCH --signal=B:TERM@60\n", "#SBATCH --requeue\n", "#SBATCH --kill-on-invalid-dep=yes\n",
        "export TESSERA_QUEUE=0123\n",
        "task \"$work\" mesh \"$SLURM_ARRAY_TASK_ID/16\" --wait 90 --scratch '/scratch/my jobs'\n"}) {
    CAPTURE(line, text);
    CHECK(text.find(line) != std::string::npos);
  }
  CHECK(slurm_script(s.job, s.serial(), s.options, 3, false).find("--array") == std::string::npos);
}

TEST_CASE("slurm: an element does its share, a single job its lines in order, the last one the command",
          "[unit]") {
  Setting s;
  CHECK(s.run(s.array(), false, "SLURM_ARRAY_JOB_ID=7 SLURM_ARRAY_TASK_ID=5").code == 0);
  CHECK(s.said() == "task " + s.job.work.string() + " mesh 5/16 --wait 90\n");
  CHECK(s.run(s.serial(), true, "").code == 0);
  CHECK(s.said() == "task " + s.job.work.string() + " mesh finish --wait 90\n" + "task " +
                        s.job.work.string() +
                        " write all --wait 90\ndecimate it's.ply -o a b.ply --progress none\n");
}

TEST_CASE("slurm: what fails ends its job, what was stopped or killed goes back into the queue", "[fault]") {
  Setting s;
  const Outcome failed = s.run(s.serial(), false, "CODE=4");
  CHECK(failed.code == 4);
  CHECK(s.said() == "task " + s.job.work.string() + " mesh finish --wait 90\n");
  for (const std::string code : {"143", "137"}) {
    s.run(s.array(), false, "CODE=" + code + " SLURM_ARRAY_JOB_ID=7 SLURM_ARRAY_TASK_ID=5");
    CHECK_THAT(s.said(), Catch::Contains("scontrol show job 7_5\nscontrol requeue 7_5\n"));
  }
  // Not again and again, not what somebody took out of the queue, not what ends anyway.
  CHECK(s.run(s.serial(), false, "CODE=143 SLURM_RESTART_COUNT=20").code == 143);
  CHECK_THAT(s.said(), !Catch::Contains("requeue"));
  CHECK(s.run(s.serial(), false, "CODE=143 STATE=COMPLETING").code == 143);
  CHECK_THAT(s.said(), !Catch::Contains("requeue"));
  fs::remove(s.job.work / kQueueMark);
  CHECK(s.run(s.serial(), false, "CODE=143").code == 143);
  CHECK_THAT(s.said(), !Catch::Contains("requeue"));
}

TEST_CASE("slurm: the signal ahead of the limit reaches the program", "[fault]") {
  Setting s;
  script(s.job.program, "trap 'echo stopped >>" + s.said_file() + "; exit 143' TERM\nsleep 20 & wait $!\n");
  spill(s.folder / "script.sh", slurm_script(s.job, s.serial(), s.options, 3, false));
  const Outcome outcome = shell("cd " + s.folder.path().string() + " && PATH=" + (s.folder / "bin").string() +
                                ":$PATH SLURM_JOB_ID=9 STATE=CANCELLED bash script.sh & sleep 0.7; kill "
                                "-TERM $!; wait $!; echo ended $?");
  CHECK_THAT(outcome.said, Catch::Contains("ended 143"));
  CHECK(file_bytes(s.folder / "said").substr(0, 8) == "stopped\n");
}

namespace {

/// PATH begins with a folder of stand-ins as long as this lives.
struct OnPath {
  explicit OnPath(const fs::path& folder) : before(std::getenv("PATH")) {
    ::setenv("PATH", (folder.string() + ":" + before).c_str(), 1);
  }
  ~OnPath() { ::setenv("PATH", before.c_str(), 1); }
  std::string before;
};

constexpr std::uint64_t kGigabyte = std::uint64_t{1} << 30;

}  // namespace

TEST_CASE("slurm: the nodes of a partition decide the memory of an element", "[unit]") {
  Setting s;
  script(s.folder / "bin/sinfo",
         "echo \"$*\" >>" + s.said_file() +
             "\necho 'short|1024|4|idle'; echo 'long*|65536|16|mix'; echo 'long*|8192|8|idle'\n"
             "echo 'long*|8192|8|alloc'; echo 'long*|1000000|64|down*'; echo 'odd|0|1|idle'\n");
  const OnPath path(s.folder / "bin");
  ::unsetenv("SBATCH_PARTITION");
  const SlurmPartition p = slurm_partition("");
  CHECK(p.name == "long");
  CHECK(p.nodes == std::vector<SlurmNode>{{8 * kGigabyte, 8}, {64 * kGigabyte, 16}});
  CHECK_THAT(s.said(), !Catch::Contains("--partition"));
  // A share of the smaller node, at least 2G beside what a job needs, at most 0.8 of it.
  CHECK(element_memory(p, 1, 2 * kGigabyte) == 2 * kGigabyte);
  CHECK(element_memory(p, 4, 2 * kGigabyte) == 4 * kGigabyte - (kGigabyte >> 3));
  CHECK(element_memory(p, 16, 2 * kGigabyte) + kQueueBaseBytes <= 8 * kGigabyte / 5 * 4);
  CHECK(element_memory(p, 16, 2 * kGigabyte) > 6 * kGigabyte);
  const SlurmPartition small = {"tiny", {{kGigabyte, 2}}};
  CHECK(element_memory(small, 1, 2 * kGigabyte) + kQueueBaseBytes <= kGigabyte / 5 * 4);
  CHECK(element_memory(small, 1, 2 * kGigabyte) > kGigabyte / 2);
  // The partition that is named, or that the environment names for sbatch.
  CHECK(slurm_partition("short").nodes == std::vector<SlurmNode>{{kGigabyte, 4}});
  CHECK_THAT(s.said(), Catch::Contains("--partition=short"));
  ::setenv("SBATCH_PARTITION", "odd", 1);
  slurm_partition("");
  CHECK_THAT(s.said(), Catch::Contains("--partition=odd"));
  ::unsetenv("SBATCH_PARTITION");
  // What fits no node is refused before it is queued.
  CHECK_NOTHROW(require_fits(p, 16, 60 * kGigabyte));
  CHECK_THROWS_WITH(require_fits(p, 16, 65 * kGigabyte), Catch::Contains("partition long") &&
                                                             Catch::Contains("--memory") &&
                                                             Catch::Contains("--partition"));
  CHECK_THROWS_AS(require_fits(p, 32, kGigabyte), UsageError);
  CHECK_NOTHROW(require_fits({}, 1000, 1000 * kGigabyte));
  script(s.folder / "bin/sinfo", "echo 'sinfo: error: no' >&2; exit 1\n");
  CHECK(slurm_partition("").nodes.empty());
  script(s.folder / "bin/sinfo", "echo; echo '|||'; echo 'x'\n");
  CHECK(slurm_partition("").nodes.empty());
}

TEST_CASE("slurm: what sbatch refuses comes with the way out", "[fault]") {
  Setting s;
  spill(s.folder / "a.sh", "");
  const OnPath path(s.folder / "bin");
  const auto refused = [&](const std::string& words) {
    script(s.folder / "bin/sbatch",
           "echo 'sbatch: error: Batch job submission failed: " + words + "' >&2; exit 1\n");
    try {
      slurm_submit(s.folder / "a.sh", "");
    } catch (const ResourceError& e) {
      return std::string(e.what());
    }
    return std::string();
  };
  const std::vector<std::pair<std::string, std::string>> known = {
      {"Requested node configuration is not available", "lower --memory or --threads"},
      {"Memory specification can not be satisfied", "lower --memory"},
      {"invalid partition specified: lnog", "--partition"},
      {"Invalid account or account/partition combination specified", "--account"},
      {"Requested time limit is invalid (missing or exceeds some limit)", "--element-seconds"},
      {"Job violates accounting/QOS policy (job submit limit, users size and/or time limits)",
       "--array-limit"},
      {"Invalid job array specification", "--array-limit"},
      {"Unable to contact slurm controller (connect failure)", "again"}};
  for (const auto& [words, advice] : known) {
    CAPTURE(words);
    const std::string said = refused(words);
    CHECK_THAT(said, Catch::Contains(words) && Catch::Contains(advice) &&
                         Catch::StartsWith((s.folder / "a.sh").string()));
    CHECK(said.find('\n') == std::string::npos);
  }
  CHECK_THAT(refused("Strange things happen"),
             Catch::Contains("refuses it (sbatch: error") && Catch::Contains("Strange"));
}

TEST_CASE("slurm: steps are handed over in a chain, when one is refused, those before it are taken back",
          "[unit]") {
  Setting s;
  const std::string log = s.said_file();
  script(s.folder / "bin/sbatch", "echo \"sbatch $*\" >>" + log + "\nn=$(grep -c sbatch " + log +
                                      "); [ $n -lt ${LIMIT:-99} ] || { echo no; exit 1; }\n"
                                      "echo warning >&2; echo \"$((40 + n));cluster\"\n");
  script(s.folder / "bin/scancel", "echo \"scancel $*\" >>" + log + "\n");
  script(s.folder / "bin/squeue", "echo '41 COMPLETED'; echo '42 RUNNING'; echo '43 CANCELLED'\n");
  const std::string path = std::getenv("PATH");
  ::setenv("PATH", ((s.folder / "bin").string() + ":" + path).c_str(), 1);
  const std::vector<QueueStep> steps = {s.array(), s.serial(), s.serial()};
  fs::remove(s.job.work / kQueueMark);
  CHECK(submit(s.job, steps, s.options) == std::vector<std::string>{"41", "42", "43"});
  CHECK_THAT(s.said(), Catch::Contains("--parsable --dependency=afterok:41") &&
                           Catch::Contains("--dependency=afterok:42"));
  CHECK(queued_jobs(s.job.work).size() == 3);
  CHECK_THROWS_AS(forget_ended_submission(s.job.work), UsageError);
  CHECK_THROWS_AS(require_not_queued(s.job.work), UsageError);
  ::setenv(kQueueToken, "0123", 1);
  CHECK_NOTHROW(require_not_queued(s.job.work));
  ::unsetenv(kQueueToken);
  CHECK(cancel_submission(s.job.work) == 1);
  CHECK_THAT(s.said(), Catch::Contains("scancel 41 42 43"));
  CHECK_NOTHROW(require_not_queued(s.job.work));
  CHECK_THROWS_AS(cancel_submission(s.job.work), UsageError);
  fs::remove(log);
  ::setenv("LIMIT", "3", 1);
  CHECK_THROWS_AS(submit(s.job, steps, s.options), ResourceError);
  CHECK_THAT(s.said(), Catch::Contains("scancel 41 42\n"));
  CHECK(queued_jobs(s.job.work).empty());
  ::unsetenv("LIMIT");
  ::setenv("PATH", "/nowhere", 1);
  CHECK_THROWS_AS(slurm_active({"1"}), UsageError);
  ::setenv("PATH", path.c_str(), 1);
}

}  // namespace slurm_test
