#include <unistd.h>

#include <catch2/catch.hpp>
#include <random>

#include "tests/helpers/skip.h"
#include "tests/helpers/toy.h"

namespace job_fault_test {

using namespace tessera;
using test::file_bytes;
using test::Outcome;
using test::shell;
using test::spill;
using test::TempFolder;
using test::Toy;
using test::toy_truth;

namespace fs = std::filesystem;

namespace {

constexpr int kKilled = 128 + 9;
/// 9 + 7 + 2 + 2 tasks and 4 finishes, four points each.
constexpr int kCommitPoints = 24 * 4;

bool output_is_whole_or_absent(const Toy& toy) {
  return !fs::exists(toy.output()) || toy.result() == toy_truth();
}

}  // namespace

TEST_CASE("fault: killed at a commit point of every stage, the same command gives the same bytes",
          "[fault]") {
  for (int point = 1; point <= kCommitPoints; point += 5) {  // all four points of a commit in turn
    const TempFolder scratch;
    const Toy toy(scratch.path());
    CAPTURE(point);
    REQUIRE(toy.run("", "TESSERA_FAULT=commit:" + std::to_string(point)).code == kKilled);
    REQUIRE(output_is_whole_or_absent(toy));
    const Outcome outcome = toy.run();
    CAPTURE(outcome.said);
    REQUIRE(outcome.code == 0);
    REQUIRE(toy.result() == toy_truth());
    REQUIRE(toy.tidy());
  }
  const TempFolder scratch;
  CHECK(Toy(scratch.path()).run("", "TESSERA_FAULT=commit:" + std::to_string(kCommitPoints + 1)).code == 0);
}

TEST_CASE("fault: killed again and again, it still arrives", "[fault]") {
  // Each run gets past one whole commit (four points), so it ends; all points of all commits are met.
  for (int point = 5; point <= 8; ++point) {
    const TempFolder scratch;
    const Toy toy(scratch.path());
    CAPTURE(point);
    int kills = 0;
    while (toy.run("-t 1", "TESSERA_FAULT=commit:" + std::to_string(point)).code == kKilled) {
      REQUIRE(output_is_whole_or_absent(toy));
      REQUIRE(++kills < 100);
    }
    CHECK(kills > 10);
    CHECK(toy.result() == toy_truth());
    CHECK(toy.tidy());
  }
}

TEST_CASE("fault: task processes killed at their commit points are started again or resumed", "[fault]") {
  for (int point = 1; point <= 4; ++point) {
    const TempFolder scratch;
    const Toy toy(scratch.path());
    CAPTURE(point);
    // Every child kills itself: the driver gives up on the task, says so, and stays resumable.
    const Outcome outcome = toy.run("--processes", "TESSERA_FAULT=commit:" + std::to_string(point));
    CHECK(outcome.code == 4);
    CHECK_THAT(outcome.said, Catch::Contains("signal 9"));
    CHECK(toy.run("--processes").code == 0);
    CHECK(toy.result() == toy_truth());
    CHECK(toy.tidy());
  }
}

TEST_CASE("fault: killed at random moments, driver and children alike", "[fault]") {
  std::mt19937 random(7);
  for (int round = 0; round < 6; ++round) {
    const TempFolder scratch;
    const Toy toy(scratch.path());
    const std::string how = round % 2 == 0 ? "--processes" : "";
    for (int kill = 0; kill < 4; ++kill) {
      const double after = 0.02 + 0.0001 * static_cast<double>(random() % 3000);
      toy.run(how, "TESSERA_TOY=sleep:20 timeout -s KILL " + std::to_string(after));
      REQUIRE(output_is_whole_or_absent(toy));
    }
    const Outcome outcome = toy.run(how);
    CAPTURE(round, outcome.said);
    REQUIRE(outcome.code == 0);
    REQUIRE(toy.result() == toy_truth());
    REQUIRE(toy.tidy());
  }
}

TEST_CASE("fault: what a kill left of a removed work directory goes with the next command", "[fault]") {
  const TempFolder scratch;
  const Toy toy(scratch.path());
  REQUIRE(toy.run().code == 0);
  std::filesystem::create_directories(scratch.path() / "out.txt.tessera.discarded" / "journal");
  REQUIRE(!toy.tidy());
  CHECK(toy.run().code == 0);
  CHECK(toy.result() == toy_truth());
  CHECK(toy.tidy());
}

TEST_CASE("fault: a signal ends it cleanly with 128 + signal", "[fault]") {
  for (const std::string signal : {"INT", "TERM"}) {
    for (const std::string how : {"", "--processes"}) {
      const TempFolder scratch;
      const Toy toy(scratch.path());
      const Outcome outcome =
          toy.run_alongside(how, "TESSERA_TOY=sleep:60", "kill -" + signal + " $first; wait $first");
      CAPTURE(signal, how, outcome.said);
      CHECK(outcome.code == (signal == "INT" ? 130 : 143));
      CHECK_THAT(outcome.said, Catch::Contains("the same command goes on"));
      CHECK(std::count(outcome.said.begin(), outcome.said.end(), '\n') == 1);
      CHECK(toy.run(how).code == 0);
      CHECK(toy.result() == toy_truth());
    }
  }
}

TEST_CASE("fault: damaged, truncated, missing and foreign files are never mixed in", "[fault]") {
  const TempFolder scratch;
  const Toy toy(scratch.path());
  SECTION("in a stage that is complete") {
    REQUIRE(toy.run("--until make").code == 7);
    std::string text = file_bytes(toy.work() / "a/7");
    SECTION("same size, one bit") {
      text[100] ^= 1;
      spill(toy.work() / "a/7", text);
    }
    SECTION("truncated") {
      spill(toy.work() / "a/7", text.substr(0, 50));
    }
    SECTION("missing") {
      fs::remove(toy.work() / "a/7");
    }
    SECTION("a file of nobody") {
      spill(toy.work() / "a/99", "foreign");
    }
    SECTION("a whole folder of nobody") {
      spill(toy.work() / "a/sub/99", "foreign");
    }
  }
  SECTION("in a stage that is half done") {
    REQUIRE(toy.run("-t 1", "TESSERA_TOY=fail:make/5").code == 3);
    SECTION("damaged") {
      spill(toy.work() / "a/3", "x");
    }
    SECTION("a later one of nobody") {
      spill(toy.work() / "a/99", "foreign");
    }
  }
  SECTION("after what it was made from has gone: everything back to it is done again") {
    REQUIRE(toy.run("--until sum").code == 7);
    REQUIRE_FALSE(fs::exists(toy.work() / "a"));
    spill(toy.work() / "b/2", "x");
  }
  SECTION("the last stage's input") {
    REQUIRE(toy.run("--until sum").code == 7);
    spill(toy.work() / "c/all", "x");
  }
  SECTION("the journal, a bit in the middle") {
    REQUIRE(toy.run("--until mix").code == 7);
    std::string lines = file_bytes(toy.work() / "journal/main.jsonl");
    lines[lines.size() / 2] ^= 4;
    spill(toy.work() / "journal/main.jsonl", lines);
  }
  SECTION("the journal, cut") {
    REQUIRE(toy.run("--until mix").code == 7);
    const std::string lines = file_bytes(toy.work() / "journal/main.jsonl");
    spill(toy.work() / "journal/main.jsonl", lines.substr(0, lines.size() * 2 / 3));
  }
  SECTION("the journal, gone") {
    REQUIRE(toy.run("--until mix").code == 7);
    fs::remove(toy.work() / "journal/main.jsonl");
  }
  const Outcome outcome = toy.run();
  CAPTURE(outcome.said);
  CHECK(outcome.code == 0);
  CHECK(toy.result() == toy_truth());
  CHECK(toy.tidy());
}

TEST_CASE("fault: the journal of another job is not believed", "[fault]") {
  const TempFolder scratch;
  const Toy toy(scratch.path());
  const Toy other((scratch / "other"));
  spill(scratch / "other/in.txt", "another seed");
  REQUIRE(toy.run("--until mix").code == 7);
  REQUIRE(other.run("--until make").code == 7);
  fs::copy(toy.work() / "journal/main.jsonl", other.work() / "journal/stray.jsonl");
  fs::copy(toy.work() / "b", other.work() / "b");
  REQUIRE(other.run().code == 0);
  CHECK(other.result() != toy_truth());
  const TempFolder fresh;
  const Toy again(fresh.path());
  spill(fresh / "in.txt", "another seed");
  REQUIRE(again.run().code == 0);
  CHECK(other.result() == again.result());
}

TEST_CASE("fault: another job's work directory is refused, --force starts over", "[fault]") {
  const TempFolder scratch;
  const Toy toy(scratch.path());
  REQUIRE(toy.run("--until mix").code == 7);
  const Outcome refused = toy.run("--radius 3");
  CHECK(refused.code == 2);
  CHECK_THAT(refused.said, Catch::Contains("radius was 0.0 and is 3.0"));
  spill(scratch / "in.txt", "changed");
  CHECK(toy.run().code == 2);
  CHECK(toy.run("--force").code == 0);
  CHECK(toy.result() != toy_truth());
  CHECK(toy.tidy());
}

TEST_CASE("fault: two drivers of one job: one works, the other is told", "[fault]") {
  const TempFolder scratch;
  const Toy toy(scratch.path());
  const std::string sleep = "TESSERA_TOY=sleep:40";
  const Outcome both =
      toy.run_alongside("", sleep, toy.command("", sleep) + "; echo second $?; wait $first; echo first $?");
  CAPTURE(both.said);
  CHECK_THAT(both.said, Catch::Contains("another process works on this job"));
  CHECK_THAT(both.said, Catch::Contains("second 2"));
  CHECK_THAT(both.said, Catch::Contains("first 0"));
  CHECK(toy.result() == toy_truth());
}

TEST_CASE("fault: a full disk is one sentence and exit 4, and with space the same command goes on",
          "[fault]") {
  if (::geteuid() != 0) {
    test::skip("mounting a small tmpfs needs root");
    return;
  }
  const TempFolder scratch;
  const std::string disk = (scratch / "disk").string();
  fs::create_directories(disk);
  int full = 0;
  for (const int kib : {64, 100, 140, 164, 180, 196, 212}) {
    if (shell("mount -t tmpfs -o size=" + std::to_string(kib) + "k tessera-test " + disk).code != 0) {
      test::skip("this machine does not let root mount a tmpfs");
      return;
    }
    const Toy toy(disk);
    const Outcome outcome = toy.run();
    CAPTURE(kib, outcome.said);
    CHECK((outcome.code == 4 || outcome.code == 0));
    if (outcome.code == 4) {
      ++full;
      CHECK_THAT(outcome.said, Catch::Contains("No space left") && Catch::Contains("goes on"));
      CHECK(std::count(outcome.said.begin(), outcome.said.end(), '\n') == 1);
      CHECK(output_is_whole_or_absent(toy));
    }
    shell("mount -o remount,size=4m " + disk);
    const Outcome rest = toy.run();
    CAPTURE(rest.said);
    CHECK(rest.code == 0);
    CHECK(toy.result() == toy_truth());
    CHECK(toy.tidy());
    REQUIRE(shell("umount " + disk).code == 0);
  }
  CHECK(full >= 3);
}

}  // namespace job_fault_test
