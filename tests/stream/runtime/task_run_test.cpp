// Many processes on one work directory, without locks, with late and wrong news of each other.
#include "stream/runtime/task_run.h"

#include <unistd.h>

#include <algorithm>
#include <catch2/catch.hpp>
#include <set>

#include "octree/error.h"
#include "stream/runtime/journal.h"
#include "stream/runtime/task_notes.h"
#include "tests/helpers/skip.h"
#include "tests/helpers/toy.h"

namespace task_run_test {

using namespace tessera;
using test::Outcome;
using test::shell;
using test::TempFolder;
using test::Toy;
using test::toy_truth;

namespace fs = std::filesystem;

namespace {

const std::vector<std::string> kStages = {"make", "mix", "sum", "write"};
/// Those whose tasks make files of their own; those of the last one fill the output together.
const std::vector<std::string> kOwnFiles = {"make", "mix", "sum"};

/// The toy job begun and not a task of it done.
void begin(const Toy& toy) {
  REQUIRE(toy.run("--until make").code == 7);
  for (const auto& entry : fs::directory_iterator(toy.work() / "journal")) fs::remove(entry.path());
  fs::remove_all(toy.work() / "a");
}

std::string call(const fs::path& work, const std::string& stage, const std::string& choice,
                 const std::string& options = "") {
  return TESSERA_TOY_JOB " task " + work.string() + " " + stage + " " + choice + " " + options;
}

/// Runs all of them at once; \returns what they said
std::string at_once(const std::vector<std::string>& calls) {
  std::string line;
  for (const std::string& c : calls) line += c + " & ";
  return shell(line + "wait").said;
}

void ends_as_ever(const Toy& toy) {
  const Outcome outcome = toy.run();
  CAPTURE(outcome.said);
  CHECK(outcome.code == 0);
  CHECK(toy.result() == toy_truth());
  CHECK(toy.tidy());
}

/// Records of one task that differ in what later stages build on.
std::size_t contradictions(const fs::path& work) {
  const Journal journal = read_journal(work / "journal");
  std::size_t count = 0;
  for (const auto& [stage, records] : journal.stages)
    for (const TaskRecord& a : records)
      for (const TaskRecord& b : records)
        if (a.task == b.task && a.basis == b.basis && a.plan == b.plan &&
            (!(a.files == b.files) || a.summary != b.summary))
          ++count;
  return count;
}

}  // namespace

TEST_CASE("task run: words for tasks", "[unit]") {
  using Kind = TaskChoice::Kind;
  CHECK(parse_task_choice("12").first == 12);
  CHECK(parse_task_choice("finish").first == kFinishTask);
  CHECK(parse_task_choice("all").kind == Kind::kAll);
  const TaskChoice share = parse_task_choice("3/16");
  CHECK(share.kind == Kind::kShare);
  CHECK(share.first == 3);
  CHECK(share.step == 16);
  for (const char* wrong : {"", "-1", "3/", "/3", "3/3", "0/0", "1/2/3", "every", "1.5"})
    CHECK_THROWS_AS(parse_task_choice(wrong), UsageError);
}

TEST_CASE("task run: shares of every stage, all at once, in one result", "[property]") {
  for (const int shares : {1, 2, 5, 20}) {
    const TempFolder scratch;
    const Toy toy(scratch.path());
    begin(toy);
    for (const std::string& stage : kStages) {
      std::vector<std::string> calls;
      for (int i = 0; i < shares; ++i)
        calls.push_back(call(toy.work(), stage, std::to_string(i) + "/" + std::to_string(shares)));
      CAPTURE(shares, stage);
      CHECK(at_once(calls).empty());
      CHECK(shell(call(toy.work(), stage, "finish")).code == 0);
    }
    ends_as_ever(toy);
  }
}

TEST_CASE("task run: a stage as a whole, what it makes obsolete goes at once", "[property]") {
  const TempFolder scratch;
  const Toy toy(scratch.path());
  begin(toy);
  CHECK(shell(call(toy.work(), "mix", "all")).code == 2);  // make is not complete
  for (const std::string& stage : kStages) {
    CHECK(shell(call(toy.work(), stage, "all")).said.empty());
    CHECK(shell(call(toy.work(), stage, "all")).said.empty());
    CHECK(fs::exists(toy.work() / "a") == (stage == "make"));
  }
  ends_as_ever(toy);
}

TEST_CASE("task run: two processes do the same at once, one result", "[property]") {
  for (int round = 0; round < 4; ++round) {
    const TempFolder scratch;
    const Toy toy(scratch.path());
    begin(toy);
    for (const std::string& stage : kOwnFiles) {
      const std::string all = call(toy.work(), stage, "all", "--wait 5");
      const std::string share = call(toy.work(), stage, "0/2", "--wait 5");
      const std::string said =
          at_once({all, share, all, "sleep 0.0" + std::to_string(round * 3) + "; " + all});
      CAPTURE(stage, said);
      CHECK(said.empty());
      CHECK(contradictions(toy.work()) == 0);
    }
    ends_as_ever(toy);
  }
}

TEST_CASE("task run: one of two that do the same is killed at any commit point", "[fault]") {
  for (int point = 1; point <= 40; point += 3) {
    const TempFolder scratch;
    const Toy toy(scratch.path());
    begin(toy);
    const std::string fault = "TESSERA_FAULT=commit:" + std::to_string(point) + " ";
    for (const std::string& stage : kOwnFiles) {
      const std::string all = call(toy.work(), stage, "all", "--wait 5");
      at_once({fault + all, all});
      CAPTURE(point, stage);
      CHECK(shell(all).said.empty());
      CHECK(contradictions(toy.work()) == 0);
    }
    ends_as_ever(toy);
  }
}

TEST_CASE("task run: the end of a stage waits for what others commit late", "[property]") {
  const TempFolder scratch;
  const Toy toy(scratch.path());
  begin(toy);
  const std::string said = at_once(
      {call(toy.work(), "make", "finish", "--wait 20"), call(toy.work(), "mix", "all", "--wait 20"),
       "sleep 0.5; " + call(toy.work(), "make", "1/2"), "sleep 0.2; " + call(toy.work(), "make", "0/2")});
  CHECK(said.empty());
  ends_as_ever(toy);
}

TEST_CASE("task run: clocks of machines may differ by a year", "[property]") {
  const TempFolder scratch;
  const Toy toy(scratch.path());
  begin(toy);
  for (const std::string& stage : kStages) {
    std::vector<std::string> calls;
    for (int i = 0; i < 3; ++i)
      calls.push_back("LD_PRELOAD=" TESSERA_FAULT_LAYER " TESSERA_FAULT=clock:" + std::to_string(i + 1) +
                      " " + call(toy.work(), stage, std::to_string(i) + "/3"));
    CHECK(at_once(calls).empty());
    CHECK(
        shell("LD_PRELOAD=" TESSERA_FAULT_LAYER " TESSERA_FAULT=clock:9 " + call(toy.work(), stage, "finish"))
            .code == 0);
  }
  ends_as_ever(toy);
}

TEST_CASE("task run: files made on a disk of the machine first", "[property]") {
  const TempFolder scratch;
  const TempFolder local;
  const Toy toy(scratch.path());
  begin(toy);
  for (const std::string& stage : kStages)
    CHECK(shell(call(toy.work(), stage, "all", "--scratch " + local.path().string())).said.empty());
  CHECK(fs::is_empty(local.path()));
  ends_as_ever(toy);
}

TEST_CASE("task run: a full disk of the machine is one sentence, and with space the same task goes on",
          "[fault]") {
  if (::geteuid() != 0) {
    test::skip("mounting a small tmpfs needs root");
    return;
  }
  const TempFolder scratch;
  const TempFolder local;
  const std::string disk = local.path().string();
  if (shell("mount -t tmpfs -o size=4k tessera-test " + disk).code != 0) {
    test::skip("this machine does not let root mount a tmpfs");
    return;
  }
  const Toy toy(scratch.path());
  begin(toy);
  const Outcome full = shell(call(toy.work(), "make", "all", "--scratch " + disk));
  CAPTURE(full.said);
  CHECK(full.code == 4);
  CHECK(std::count(full.said.begin(), full.said.end(), '\n') == 1);
  CHECK_THAT(full.said, Catch::Contains("No space left"));
  shell("mount -o remount,size=4m " + disk);
  for (const std::string& stage : kStages)
    CHECK(shell(call(toy.work(), stage, "all", "--scratch " + disk)).said.empty());
  REQUIRE(shell("umount " + disk).code == 0);
  ends_as_ever(toy);
}

TEST_CASE("task run: a file system that tells late of what others do", "[property]") {
  if (::geteuid() != 0 || shell("command -v bindfs").code != 0 || !fs::exists("/dev/fuse")) {
    test::skip("late news of a network file system are made by bindfs (FUSE) as root");
    return;
  }
  const TempFolder scratch;
  const fs::path real = scratch / "real";
  fs::create_directories(real);
  struct Mounted {
    std::vector<fs::path> paths;
    ~Mounted() {
      for (const fs::path& path : paths) shell("umount -l " + path.string());
    }
  } mounted;
  // Two machines: each remembers names, absent names and sizes for three seconds.
  for (const char* name : {"one", "two"}) {
    const fs::path at = scratch / name;
    fs::create_directories(at);
    if (shell("bindfs -o attr_timeout=3,entry_timeout=3,negative_timeout=3,ac_attr_timeout=3 " +
              real.string() + " " + at.string())
            .code != 0) {
      test::skip("this machine does not let root mount FUSE");
      return;
    }
    mounted.paths.push_back(at);
  }
  // The job is begun elsewhere; paths in it are those of one machine, as on a cluster all have the same: so both names lead
  // to one folder, and each process has its own view of it.
  const Toy toy(real);
  begin(toy);
  const auto on = [&](const char* machine, const std::string& stage, const std::string& choice) {
    const fs::path view = scratch / machine;
    return "unshare -m sh -c 'mount --bind " + view.string() + " " + real.string() + " && " +
           call(toy.work(), stage, choice, "--wait 30") + "'";
  };
  for (const std::string& stage : kOwnFiles) {
    CAPTURE(stage);
    // Each has looked before the other commits.
    shell(on("one", stage, "0/7") + "; true");
    shell(on("two", stage, "1/7") + "; true");
    CHECK(at_once({on("one", stage, "0/2"), on("two", stage, "1/2"), on("one", stage, "all"),
                   on("two", stage, "all")})
              .empty());
    CHECK(contradictions(toy.work()) == 0);
  }
  CHECK(
      at_once({on("one", "write", "0/2"), on("two", "write", "1/2"), on("one", "write", "finish")}).empty());
  ends_as_ever(toy);
}

TEST_CASE("journal: a file of one's own, whoever else begins one at the same moment", "[unit]") {
  const TempFolder scratch;
  std::set<std::string> names;
  for (int i = 0; i < 100; ++i) names.insert(JournalWriter(scratch.path(), "task-make-0of2").name());
  CHECK(names.size() == 100);
}

TEST_CASE("notes: what was begun, what failed and who has been silent", "[unit]") {
  const TempFolder scratch;
  {
    TaskNotes a(scratch.path(), "a");
    a.stage("order", 7, 100, "points");
    a.started("order", 3);
    a.started("order", 4);
    a.failed("order", 4, "no space left");
  }
  test::spill(scratch / "torn.notes", "{\"host\":\"n1\"}\n{\"stage\":\"order\",\"start\":5,\"t\":1}\n{\"sta");
  Notes notes = read_notes(scratch.path());
  CHECK(notes.stages.at("order").tasks == 7);
  REQUIRE(notes.tasks.size() == 3);
  CHECK_FALSE(notes.tasks[0].ended);
  CHECK(notes.tasks[1].ended);
  CHECK(notes.tasks[1].failure == "no space left");
  CHECK(notes.tasks[2].host == "n1");
  CHECK(notes.tasks[0].silent_s < 60.0);
  // A second run of the same writer ends what the first had begun.
  TaskNotes(scratch.path(), "a");
  CHECK(read_notes(scratch.path()).tasks[0].ended);
}

}  // namespace task_run_test
