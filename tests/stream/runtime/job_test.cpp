#include <catch2/catch.hpp>

#include "stream/files/json.h"
#include "stream/runtime/job.h"
#include "tests/helpers/toy.h"

namespace job_test {

using namespace tessera;
using test::file_bytes;
using test::Outcome;
using test::spill;
using test::TempFolder;
using test::Toy;
using test::toy_truth;

namespace fs = std::filesystem;

TEST_CASE("job: an undisturbed run leaves the output and its report, nothing else", "[pipeline]") {
  const TempFolder scratch;
  const Toy toy(scratch.path());
  const Outcome outcome = toy.run();
  CHECK(outcome.code == 0);
  CHECK(outcome.said.empty());
  CHECK(toy.tidy());
  CHECK(fs::file_size(toy.output()) == 8002);
  const Json report = parse_json(file_bytes(toy.report()));
  CHECK(report.at("schema") == 1);
  CHECK(report.at("stages").size() == 4);
  CHECK(report.at("stages").at(0).at("name") == "make");
  CHECK(report.at("stages").at(0).at("tasks") == 9);
  CHECK(report.at("stages").at(0).at("bytes_written") == 36);
  CHECK(report.at("stages").at(1).at("bytes_read").get<int>() == 7 * 36 * 4001);
  CHECK(report.at("output").at("bytes") == 8002);
  CHECK(report.at("inputs").at(0).at("bytes") == 4);
  CHECK(report.at("peak_bytes").get<std::uint64_t>() > 1000000);
  CHECK(report.at("options").at("resolution") == 1.0);
}

TEST_CASE("job: same bytes over threads, caps, tile sizes and processes", "[property]") {
  REQUIRE(toy_truth().rfind("8002 bytes", 0) == 0);
  for (const char* how : {"-t 1", "-t 5", "--memory 64M", "--memory 8G", "--tile-size 64", "--processes",
                          "--processes -t 4 --tile-size 64", "--keep", "--temp ."}) {
    const TempFolder scratch;
    const Toy toy(scratch.path());
    CAPTURE(how);
    const Outcome outcome = test::shell("cd " + scratch.path().string() + " && " + toy.command(how));
    CHECK(outcome.said.empty());
    CHECK(outcome.code == 0);
    CHECK(toy.result() == toy_truth());
  }
}

TEST_CASE("job: --keep keeps the work, and running again does nothing but look", "[pipeline]") {
  const TempFolder scratch;
  const Toy toy(scratch.path());
  CHECK(toy.run("--keep").code == 0);
  CHECK(fs::exists(toy.work() / "a/0"));
  CHECK(fs::exists(toy.work() / "report.json"));
  const auto lines = file_bytes(toy.work() / "journal/main.jsonl");
  CHECK(toy.run("--keep").code == 0);
  CHECK(file_bytes(toy.work() / "journal/main.jsonl") == lines);
  SECTION("a lost output is written again, from the last stage on") {
    fs::remove(toy.output());
    CHECK(toy.run("--keep").code == 0);
    CHECK(toy.result() == toy_truth());
    const auto more = file_bytes(toy.work() / "journal/main.jsonl").substr(lines.size());
    CHECK(std::count(more.begin(), more.end(), '\n') == 3);  // two tasks and finish of write
  }
  SECTION("so is one that was changed") {
    spill(toy.output(), "changed");
    CHECK(toy.run("--keep").code == 0);
    CHECK(toy.result() == toy_truth());
  }
}

TEST_CASE("job: a finished job run again has nothing to do", "[pipeline]") {
  const TempFolder scratch;
  const Toy toy(scratch.path());
  REQUIRE(toy.run().code == 0);
  const auto time = fs::last_write_time(toy.output());
  CHECK(toy.run().code == 0);
  CHECK(fs::last_write_time(toy.output()) == time);
  SECTION("but an output that is something else is not overwritten without --force") {
    spill(toy.output(), "precious");
    const Outcome refused = toy.run();
    CHECK(refused.code == 2);
    CHECK_THAT(refused.said, Catch::Contains("--force"));
    CHECK(file_bytes(toy.output()) == "precious");
    CHECK(toy.run("--force").code == 0);
    CHECK(toy.result() == toy_truth());
  }
}

TEST_CASE("job: --until stops with 7 and the same command goes on", "[pipeline]") {
  const TempFolder scratch;
  const Toy toy(scratch.path());
  for (const char* stage : {"make", "mix", "mix", "sum"}) {
    const Outcome outcome = toy.run(std::string("--until ") + stage);
    CAPTURE(stage, outcome.said);
    CHECK(outcome.code == 7);
    CHECK_FALSE(fs::exists(toy.output()));
  }
  CHECK_FALSE(fs::exists(toy.work() / "a"));  // obsolete since mix
  CHECK(toy.run().code == 0);
  CHECK(toy.result() == toy_truth());
  CHECK(toy.run("--until nonsense").code == 2);
}

TEST_CASE("job: completed stages survive another cap and tile size, a half-done one is cut anew",
          "[property]") {
  const TempFolder scratch;
  const Toy toy(scratch.path());
  CHECK(toy.run("--tile-size 64", "TESSERA_TOY=fail:make/10").code == 3);
  CHECK(toy.run("", "TESSERA_TOY=fail:mix/3").code == 3);
  CHECK(toy.run("--tile-size 128").code == 0);
  CHECK(toy.result() == toy_truth());
}

TEST_CASE("job: a failing task names itself by its own message and leaves the rest resumable", "[pipeline]") {
  const TempFolder scratch;
  const Toy toy(scratch.path());
  for (const char* how : {"", "--processes"}) {
    const Outcome outcome = toy.run(how, "TESSERA_TOY=fail:sum/1");
    CHECK(outcome.code == 3);
    CHECK(outcome.said == "tessera: error: toy: task was told to fail\n");
    CHECK_FALSE(fs::exists(toy.output()));
  }
  CHECK(toy.run().code == 0);
  CHECK(toy.result() == toy_truth());
}

TEST_CASE("job: a failure before anything is committed leaves nothing behind", "[pipeline]") {
  const TempFolder scratch;
  const Toy toy(scratch.path());
  CHECK(toy.run("-t 1", "TESSERA_TOY=fail:make/0").code == 3);
  CHECK_FALSE(fs::exists(toy.work()));
  CHECK(toy.run("--tile-size 65").code == 2);
  CHECK_FALSE(fs::exists(toy.work()));
}

TEST_CASE("job: a task that cannot fit is refused with the cap that would do, and that one does",
          "[memory]") {
  const TempFolder scratch;
  const Toy toy(scratch.path());
  const Outcome refused = toy.run("", "TESSERA_TOY=fat:800000000");
  CHECK(refused.code == 4);
  CAPTURE(refused.said);
  const std::size_t at = refused.said.find("--memory ");
  REQUIRE(at != std::string::npos);
  CHECK_THAT(refused.said, Catch::Contains("task 0 of stage mix"));
  const std::string cap = refused.said.substr(at + 9, refused.said.find('M', at + 9) - at - 8);
  const Outcome taken = toy.run("--memory " + cap, "TESSERA_TOY=fat:800000000");
  CAPTURE(taken.said);
  CHECK(taken.code == 0);
  CHECK(toy.result() == toy_truth());
}

TEST_CASE("job: tasks one by one as processes on a shared folder give the same bytes", "[property]") {
  const TempFolder scratch;
  const Toy toy(scratch.path());
  REQUIRE(toy.run("--until make").code == 7);
  CHECK(toy.task("sum", "0").code == 2);  // mix is not complete
  CHECK(toy.task("mix", "7").code == 2);  // no such task
  CHECK(toy.task("nothing", "0").code == 2);
  CHECK(toy.task("mix", "finish").code == 2);
  // In any order, repeated, at once.
  std::string all;
  for (const char* k : {"6", "3", "0", "1", "5", "2", "4"}) {
    all += TESSERA_TOY_JOB " task " + toy.work().string() + " mix " + k + " & ";
  }
  CHECK(test::shell(all + "wait").said.empty());
  CHECK(toy.task("mix", "3").code == 0);
  CHECK(toy.task("mix", "finish").code == 0);
  CHECK(toy.task("mix", "finish").code == 0);
  CHECK(toy.task("sum", "1").code == 0);
  CHECK(toy.task("sum", "0").code == 0);
  CHECK(toy.task("sum", "finish").code == 0);
  CHECK(toy.run().code == 0);
  CHECK(toy.result() == toy_truth());
  CHECK(toy.tidy());
}

TEST_CASE("job: progress lines are JSON, one a line, on stderr", "[pipeline]") {
  const TempFolder scratch;
  const Toy toy(scratch.path());
  const Outcome outcome = toy.run("--progress json");
  CHECK(outcome.code == 0);
  std::istringstream lines(outcome.said);
  std::string line;
  int ends = 0;
  while (std::getline(lines, line)) {
    const Json j = parse_json(line);
    if (j.at("event") == "stage_end") {
      ++ends;
      CHECK(j.at("done") == j.at("total"));
      CHECK(j.at("peak_bytes").get<std::uint64_t>() > 0);
    }
  }
  CHECK(ends == 4);
}

TEST_CASE("job: options from a job file, flags win, unknown keys are errors", "[pipeline]") {
  const TempFolder scratch;
  const Toy toy(scratch.path());
  const std::string call = TESSERA_TOY_JOB " run --job " + (scratch / "job.json").string();
  Json job = {{"inputs", {(scratch / "in.txt").string()}},
              {"out", toy.output().string()},
              {"resolution", 2},
              {"memory", "512M"},
              {"viewpoint", {"1,2,3", "4,5,6"}},
              {"up", {0, 0, 1}},
              {"keep", true},
              {"progress", "none"}};
  spill(scratch / "job.json", dump_json(job));
  const Outcome outcome = test::shell(call + " --resolution 1");
  CHECK(outcome.said.empty());
  CHECK(outcome.code == 0);
  CHECK(toy.result() == toy_truth());
  const Json options = parse_json(file_bytes(toy.report())).at("options");
  CHECK(options.at("resolution") == 1.0);
  CHECK(options.at("viewpoint") == Json({{1.0, 2.0, 3.0}, {4.0, 5.0, 6.0}}));
  CHECK(options.at("up") == Json({0.0, 0.0, 1.0}));
  CHECK(fs::exists(toy.work()));
  job["resolutoin"] = 3;
  spill(scratch / "job.json", dump_json(job));
  const Outcome unknown = test::shell(call);
  CHECK(unknown.code == 2);
  CHECK_THAT(unknown.said, Catch::Contains("resolutoin") && Catch::Contains("--resolution"));
  spill(scratch / "job.json", "{");
  CHECK(test::shell(call).code == 3);
}

}  // namespace job_test
