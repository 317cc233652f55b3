#include "stream/queue/job_status.h"

#include <catch2/catch.hpp>

#include "octree/error.h"
#include "stream/runtime/journal.h"
#include "stream/runtime/resume.h"
#include "stream/runtime/task_notes.h"
#include "stream/runtime/work_dir.h"
#include "tests/helpers/toy.h"

namespace job_status_test {

using namespace tessera;
using test::TempFolder;
using test::Toy;

namespace {

/// Names alone: nothing of a stage is asked for.
JobDescription names_of_toy(const std::string&, const std::string&) {
  return {"toy", {{"make", {}}, {"mix", {}}, {"sum", {}}, {"write", {}}}, 0, {}};
}

}  // namespace

TEST_CASE("status: what is done, at work, failed and still to come", "[property]") {
  const TempFolder scratch;
  const Toy toy(scratch.path());
  REQUIRE(toy.run("--until make").code == 7);
  REQUIRE(toy.run("-t 1", "TESSERA_TOY=fail:mix/3").code == 3);
  JobStatus status = job_status(toy.work(), names_of_toy);
  REQUIRE(status.stages.size() == 4);
  CHECK(status.command == "toy");
  CHECK(status.stages[0].complete);
  CHECK(status.stages[0].tasks == 9);
  CHECK(status.stages[0].done == 9);
  CHECK(status.stages[0].bytes_written > 0);
  CHECK_FALSE(status.stages[1].complete);
  CHECK(status.stages[1].tasks == 7);
  CHECK(status.stages[1].done < 7);
  CHECK(status.stages[1].failed == 1);
  CHECK_FALSE(status.stages[2].tasks);
  REQUIRE(status.failures.size() == 1);
  CHECK_THAT(status.failures[0], Catch::Contains("stage mix, task 3") && Catch::Contains("told to fail"));
  CHECK_FALSE(status.left_s);
  // Another process takes it up.
  {
    TaskNotes notes(toy.work() / "journal", "other");
    notes.started("mix", 3);
    status = job_status(toy.work(), names_of_toy);
    CHECK(status.stages[1].running == 1);
    CHECK(status.failures.empty());
    CHECK(status.left_s);
    CHECK(status.left_is_of_stage);
  }
  test::shell("touch -d '10 minutes ago' " + (toy.work() / "journal/other.notes").string());
  CHECK(job_status(toy.work(), names_of_toy).stages[1].lost == 1);
  test::spill(toy.work() / "forecast.json",
              R"({"forecast":[{"stage":"mix","seconds":10},{"stage":"sum","seconds":50}]})");
  test::shell("touch " + (toy.work() / "journal/other.notes").string());
  status = job_status(toy.work(), names_of_toy);
  CHECK_FALSE(status.left_is_of_stage);
  CHECK(status.left_s.value_or(0) > 49);
  std::filesystem::remove(toy.work() / "forecast.json");
  REQUIRE(toy.run("--until write --keep").code == 7);
  CHECK(job_status(toy.work(), names_of_toy).stages[3].complete);
}

TEST_CASE("status: of a folder that is none it says so", "[unit]") {
  const TempFolder scratch;
  CHECK_THROWS_AS(job_status(scratch.path(), names_of_toy), InputError);
  CHECK_THROWS_AS(job_status(scratch / "none", names_of_toy), InputError);
}

}  // namespace job_status_test
