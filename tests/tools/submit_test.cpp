// Jobs in a batch queue: the scripts anywhere, the queue itself where Slurm is installed (label slurm).
#include <catch2/catch.hpp>

#include <fmt/format.h>

#include <map>
#include <random>

#include "stream/files/durable_file.h"
#include "stream/files/json.h"
#include "tests/helpers/shell.h"
#include "tests/helpers/skip.h"
#include "tests/helpers/slurm_cluster.h"

namespace submit_test {

namespace {

using namespace tessera;
using test::file_bytes;
using test::Outcome;
using test::shell;
using test::SlurmCluster;
using test::TempFolder;
namespace fs = std::filesystem;

constexpr int kPatience = 300;  // seconds: of a machine that is busy with other tests
/// So short that every stage is an array.
constexpr const char* kArrays = " --nodes 3 --element-seconds 0.01 --array-limit 3";

Outcome tessera_in(const TempFolder& folder, const std::string& words) {
  return shell("cd " + folder.path().string() + " && " TESSERA_BINARY " " + words);
}

void scan_into(const TempFolder& folder, const std::string& options) {
  REQUIRE(tessera_in(folder, "synth --scene terrain -o scan.ply " + options).code == 0);
}

std::string hash_of(const fs::path& path) {
  return fs::exists(path) ? hex64(hash_file(path)) : "none";
}

/// Runs a job on this machine and through the queue: the same bytes, and nothing left but what a job leaves.
void same_bytes(const TempFolder& folder, const SlurmCluster& cluster, const std::string& job) {
  CAPTURE(job);
  REQUIRE(tessera_in(folder, job + " -o here.ply --no-html -q").code == 0);
  const Outcome submitted =
      tessera_in(folder, "submit " + job + " -o there.ply --no-html --memory 512M" + kArrays);
  INFO(submitted.said);
  REQUIRE(submitted.code == 0);
  REQUIRE(cluster.idle_within(kPatience));
  INFO(tessera_in(folder, "status there.ply.tessera; tail -n 3 there.ply.tessera/queue/*.log").said);
  CHECK_FALSE(fs::exists(folder / "there.ply.tessera"));
  CHECK(hash_of(folder / "there.ply") == hash_of(folder / "here.ply"));
  const Json report = parse_json(file_bytes(folder / "there.ply.report.json"));
  CHECK(report.at("output").at("bytes") == fs::file_size(folder / "there.ply"));
  CHECK_THAT(tessera_in(folder, "status there.ply.tessera").said, Catch::Contains("done: see"));
}

#define NEEDS_SLURM()                                                  \
  if (const std::string why = SlurmCluster::missing(); !why.empty()) { \
    test::skip(why);                                                   \
    return;                                                            \
  }

}  // namespace

TEST_CASE("submit: what a queue cannot take is refused at once and leaves nothing", "[pipeline]") {
  const TempFolder folder;
  scan_into(folder, "--points 20k --normals");
  for (const char* words :
       {"submit", "submit plan scan.ply", "submit check scan.ply", "submit reconstruct -o out.ply",
        "submit reconstruct none.ply -o out.ply --dry-run",
        "submit reconstruct scan.ply -o out.ply --until order",
        "submit reconstruct scan.ply -o out.ply --nodes 0",
        "submit reconstruct scan.ply -o out.ply --tolerance -1",
        "submit reconstruct scan.ply -o out.ply --partitoin x --dry-run", "cancel", "cancel out.ply.tessera",
        "status", "status out.ply.tessera"}) {
    CAPTURE(words);
    const Outcome outcome = tessera_in(folder, words);
    CAPTURE(outcome.said);
    CHECK((outcome.code == 2 || outcome.code == 3));
    CHECK(std::count(outcome.said.begin(), outcome.said.end(), '\n') == 1);
    CHECK_FALSE(fs::exists(folder / "out.ply.tessera"));
  }
  const Outcome small = tessera_in(folder, "submit reconstruct scan.ply -o out.ply --memory 1M --dry-run");
  CHECK(small.code == 4);
  CHECK_FALSE(fs::exists(folder / "out.ply.tessera"));
}

TEST_CASE("submit: a dry run prints scripts that bash reads, for every job, and leaves nothing",
          "[pipeline]") {
  const TempFolder folder;
  scan_into(folder, "--points 20k --normals");
  REQUIRE(tessera_in(folder, "reconstruct scan.ply -o mesh.ply --no-html -q").code == 0);
  fs::copy_file(folder / "mesh.ply", folder / "other.ply");
  for (const std::string job :
       {"reconstruct scan.ply -o out.ply --tolerance 0.1", "decimate mesh.ply -o out.ply --tolerance 0.1",
        "smooth mesh.ply -o out.ply", "remesh mesh.ply -o out.ply --faces 1000",
        "resample mesh.ply -o out.ply", "resurface mesh.ply -o out.ply", "csg mesh.ply - mesh.ply -o out.ply",
        "merge mesh.ply other.ply -o out.ply", "tiles mesh.ply -o site"}) {
    CAPTURE(job);
    for (const std::string& call :
         {"submit " + job + kArrays + " --dry-run", "submit --dry-run --nodes 3 " + job}) {
      const Outcome outcome = tessera_in(folder, call + " 2>/dev/null >script.sh; bash -n script.sh");
      CAPTURE(outcome.said);
      CHECK(outcome.code == 0);
      const std::string script = file_bytes(folder / "script.sh");
      CHECK_THAT(script,
                 Catch::Contains("#SBATCH --requeue") && Catch::Contains("#SBATCH --signal=B:TERM@60"));
      CHECK_THAT(script, Catch::Contains("step \"$tessera\" " + job.substr(0, job.find(' '))));
    }
    CHECK_FALSE(fs::exists(folder / "out.ply.tessera"));
    CHECK_FALSE(fs::exists(folder / "site"));
  }
}

TEST_CASE("status: of a job on one machine, by its journal alone", "[pipeline]") {
  const TempFolder folder;
  scan_into(folder, "--points 20k --normals");
  REQUIRE(tessera_in(folder, "reconstruct scan.ply -o out.ply --no-html -q --until order").code == 7);
  const Outcome text = tessera_in(folder, "status out.ply.tessera");
  CHECK(text.code == 0);
  CHECK_THAT(text.said, Catch::Contains("reconstruct, 8 of "));
  const Json status = parse_json(tessera_in(folder, "status out.ply.tessera --json").said);
  CHECK(status.at("stages").at(7).at("name") == "order");
  CHECK(status.at("stages").at(7).at("complete") == true);
  CHECK(status.at("stages").at(8).at("complete") == false);
  REQUIRE(tessera_in(folder, "reconstruct scan.ply -o out.ply --no-html -q").code == 0);
  CHECK_THAT(tessera_in(folder, "status out.ply.tessera").said, Catch::Contains("out.ply.report.json"));
}

TEST_CASE("plan: how long many machines would take, by the report of a job that ran", "[pipeline]") {
  const TempFolder folder;
  scan_into(folder, "--points 20k --normals");
  REQUIRE(tessera_in(folder, "reconstruct scan.ply -o out.ply --no-html -q").code == 0);
  const auto plan = [&](const std::string& words) {
    return tessera_in(folder, "plan scan.ply -q --threads 1 " + words);
  };
  const Outcome status = plan("--measured out.ply.report.json --nodes 1,64 --points 1e9 --io-rate 1G");
  INFO(status.said);
  REQUIRE(status.code == 0);
  double one = 0.0, many = 0.0;
  const std::size_t table = status.said.find("1e+09 points");
  REQUIRE(table != std::string::npos);
  REQUIRE(std::sscanf(status.said.c_str() + status.said.find("\n       1 ", table), " 1 %lf", &one) == 1);
  REQUIRE(std::sscanf(status.said.c_str() + status.said.find("\n      64 ", table), " 64 %lf", &many) == 1);
  CHECK(many > 0.0);
  CHECK(one > many);
  CHECK_THAT(status.said, Catch::Contains("measure a larger part"));
  CHECK(plan("--nodes 8").code == 2);
  CHECK(plan("--measured out.ply.report.json").code == 2);
  CHECK(plan("--points 1e9").code == 2);
  CHECK(plan("--measured out.ply.report.json --nodes 0").code == 2);
  CHECK(plan("--measured out.ply.report.json --nodes 1,x").code == 2);
  CHECK(plan("--measured out.ply --nodes 2").code == 3);
  REQUIRE(tessera_in(folder, "decimate out.ply -o less.ply --tolerance 0.1 --no-html -q").code == 0);
  CHECK(plan("--measured less.ply.report.json --nodes 2").code == 3);
}

TEST_CASE("submit: jobs of every kind through the queue, the same bytes as here", "[slurm]") {
  NEEDS_SLURM();
  const SlurmCluster cluster;
  INFO(cluster.said());
  REQUIRE(cluster.runs());
  const TempFolder folder;
  SECTION("reconstruct, nothing given") {
    scan_into(folder, "--points 2M --noise 0.2s");
    same_bytes(folder, cluster, "reconstruct scan.ply --tolerance 0.1");
  }
  SECTION("meshes") {
    scan_into(folder, "--points 500k --normals");
    REQUIRE(tessera_in(folder, "reconstruct scan.ply -o mesh.ply --no-html -q").code == 0);
    same_bytes(folder, cluster, "decimate mesh.ply --tolerance 0.2");
    for (const char* name : {"here.ply", "there.ply"}) fs::remove(folder / name);
    same_bytes(folder, cluster, "smooth mesh.ply --lambda 1000");
  }
  SECTION("remesh and csg") {
    scan_into(folder, "--points 100k --normals");
    REQUIRE(tessera_in(folder, "reconstruct scan.ply -o mesh.ply --no-html -q").code == 0);
    same_bytes(folder, cluster, "remesh mesh.ply --faces 60000");
    for (const char* name : {"here.ply", "there.ply"}) fs::remove(folder / name);
    REQUIRE(tessera_in(folder, "synth --scene sphere --points 30k --normals -o ball.ply").code == 0);
    REQUIRE(tessera_in(folder, "reconstruct ball.ply -o ball-mesh.ply --no-html -q").code == 0);
    folder.write(
        "scene.json",
        R"({"difference": [{"mesh": "ball-mesh.ply"}, {"box": [0,0,0, 9,9,9]}, {"sphere": [0,0,0, 0.5]}]})");
    same_bytes(folder, cluster, "csg scene.json");
  }
  SECTION("resurface, resample, deform, merge") {
    scan_into(folder, "--points 100k --normals");
    REQUIRE(tessera_in(folder, "reconstruct scan.ply -o mesh.ply --no-html -q").code == 0);
    const auto clipped = [&](const std::string& name, double from, double to) {
      folder.write(
          name + ".geojson",
          fmt::format(R"({{"type":"Polygon","coordinates":[[[{0},-1e6],[{1},-1e6],[{1},1e6],[{0},1e6]]]}})",
                      from, to));
      REQUIRE(tessera_in(folder,
                         "reconstruct scan.ply --clip " + name + ".geojson -o " + name + ".ply --no-html -q")
                  .code == 0);
    };
    REQUIRE(tessera_in(folder, "synth --scene sphere --points 30k --normals -o ball.ply").code == 0);
    REQUIRE(tessera_in(folder, "reconstruct ball.ply -o ball-mesh.ply --no-html -q").code == 0);
    clipped("west", -1e6, 540.0);
    clipped("east", 500.0, 1e6);
    folder.write("edit.json", R"({"order": 2,
      "regions": [{"role": "support", "box": [[200,-1e6,-1e6], [800,1e6,1e6]]},
                  {"role": "handle", "name": "hill", "half_space": {"point": [800,0,0], "normal": [-1,0,0]}}],
      "handles": {"hill": {"move": [0,0,50]}}})");
    for (const char* job :
         {"resurface ball-mesh.ply --offset 0.2 --resolution 0.1", "resample mesh.ply --tolerance 0.5",
          "deform mesh.ply edit.json", "merge west.ply east.ply"}) {
      same_bytes(folder, cluster, job);
      for (const char* name : {"here.ply", "there.ply"}) fs::remove(folder / name);
    }
  }
}

TEST_CASE("cancel: takes a job out of the queue, submit goes on with what is committed", "[slurm]") {
  NEEDS_SLURM();
  const SlurmCluster cluster;
  REQUIRE(cluster.runs());
  const TempFolder folder;
  scan_into(folder, "--points 300k --noise 0.2s");
  const std::string job = "reconstruct scan.ply -o out.ply --no-html";
  REQUIRE(tessera_in(folder, "submit " + job + kArrays).code == 0);
  CHECK(tessera_in(folder, job).code == 2);                        // the queue has it
  CHECK(tessera_in(folder, "submit " + job + kArrays).code == 2);  // as much
  ::sleep(4);
  const Outcome cancelled = tessera_in(folder, "cancel out.ply.tessera");
  CAPTURE(cancelled.said);
  CHECK(cancelled.code == 0);
  REQUIRE(cluster.idle_within(30));
  CHECK(fs::exists(folder / "out.ply.tessera"));
  CHECK_FALSE(fs::exists(folder / "out.ply"));
  REQUIRE(tessera_in(folder, "submit " + job + kArrays).code == 0);
  REQUIRE(cluster.idle_within(kPatience));
  CHECK(fs::exists(folder / "out.ply"));
  REQUIRE(tessera_in(folder, "reconstruct scan.ply -o here.ply --no-html -q").code == 0);
  CHECK(hash_of(folder / "out.ply") == hash_of(folder / "here.ply"));
}

namespace {

/// Processes that this cluster runs on a node.
std::string kill_processes(const std::string& node) {
  return "for p in /proc/[0-9]*; do tr '\\0' '\\n' 2>/dev/null <$p/environ | grep -qx "
         "\"SLURM_CONF=$SLURM_CONF\" && "
         "tr '\\0' '\\n' <$p/environ | grep -qx SLURMD_NODENAME=" +
         node + " && kill -KILL ${p#/proc/}; done 2>/dev/null; true";
}

/// One fault of a kind, undone after a while. \returns false when there was nothing to hit
bool inject(const SlurmCluster& cluster, const std::string& kind, const std::string& node) {
  const std::string running =
      shell("squeue --noheader --states=running --format='%F_%K' | sed 's/_N.A//' | head -n 1 | tr -d '\\n'")
          .said;
  if (kind == "node down") {
    shell("scontrol update nodename=" + node +
          " state=down reason=test; sleep 1; scontrol update nodename=" + node + " state=resume");
    return true;
  }
  if (kind == "daemon and tasks killed" || kind == "daemon killed") {
    cluster.kill_node(node);
    if (kind == "daemon and tasks killed") shell(kill_processes(node));
    ::sleep(1);
    cluster.start_node(node);
    return true;
  }
  if (running.empty()) return false;
  if (kind == "element killed") return shell("scancel --signal=KILL " + running).code == 0;
  if (kind == "element requeued") return shell("scontrol requeue " + running).code == 0;
  return shell(kill_processes(node)).code == 0;  // tasks killed
}

}  // namespace

TEST_CASE("submit: thirty faults of nodes, daemons and elements, none lost", "[slurm][.large]") {
  NEEDS_SLURM();
  const SlurmCluster cluster;
  REQUIRE(cluster.runs());
  const TempFolder folder;
  scan_into(folder, "--points 2M --noise 0.2s");
  const std::string job = "reconstruct scan.ply --tolerance 0.1 --no-html --memory 512M";
  REQUIRE(tessera_in(folder, job + " -o here.ply -q").code == 0);
  std::mt19937 random(5);
  int faults = 0, rounds = 0, submissions = 0;
  std::map<std::string, int> hits;
  while (faults < 30) {
    REQUIRE(++rounds < 20);
    shell("cd " + folder.path().string() + " && rm -rf out.ply*");
    const std::string submit = "submit " + job + " -o out.ply" + kArrays;
    REQUIRE(tessera_in(folder, submit).code == 0);
    ++submissions;
    for (int wait = 0; !fs::exists(folder / "out.ply.report.json"); ++wait) {
      REQUIRE(wait < 400);
      ::usleep(static_cast<useconds_t>(200000 + random() % 1500000));
      static const std::vector<std::string> kinds = {
          "node down",      "daemon killed",    "daemon and tasks killed",
          "element killed", "element requeued", "tasks killed"};
      const std::string kind = kinds[random() % kinds.size()];
      if (faults < 30 && inject(cluster, kind, random() % 2 == 0 ? "n1" : "n2")) ++faults, ++hits[kind];
      if (!cluster.idle_within(0) && wait % 8 != 7) continue;
      // All have ended, or a chain that lost an element is: with a sentence, and the same command goes on.
      if (shell("squeue --noheader").said.empty() && fs::exists(folder / "out.ply.tessera")) {
        const Outcome again = tessera_in(folder, submit);
        INFO(again.said);
        REQUIRE(again.code == 0);
        ++submissions;
      }
    }
    REQUIRE(hash_of(folder / "out.ply") == hash_of(folder / "here.ply"));
    REQUIRE(cluster.idle_within(kPatience));
  }
  std::string status;
  for (const auto& [kind, count] : hits) status += kind + " " + std::to_string(count) + ", ";
  WARN(status << rounds << " jobs, submitted " << submissions << " times");
}

}  // namespace submit_test
