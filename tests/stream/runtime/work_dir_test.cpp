#include "stream/runtime/work_dir.h"
#include "stream/files/json.h"

#include <catch2/catch.hpp>
#include <chrono>

#include "octree/error.h"
#include "stream/files/durable_file.h"
#include "tests/helpers/shell.h"

namespace work_dir_test {

using namespace tessera;
using test::spill;
using test::TempFolder;

namespace {

JobState state_in(const TempFolder& scratch) {
  JobState state;
  spill(scratch / "in.txt", "1 2 3\n");
  state.inputs = {scratch / "in.txt"};
  state.output = scratch / "out.ply";
  state.work = work_path(state.output, {});
  state.settings = R"({"resolution": 0.1, "viewpoint": [[1.0, 2.0, 3.0]]})";
  state.run.memory_bytes = 1 << 30;
  state.run.threads = 3;
  return state;
}

Json identity_of(const JobState& state) {
  std::vector<InputFingerprint> inputs;
  for (const auto& input : state.inputs) inputs.push_back(fingerprint_input(input));
  return job_identity("reconstruct", state, inputs);
}

/// Makes the work directory and leaves it, as a stopped job does.
void begin(const JobState& state) {
  WorkDir::open_job(state.work, identity_of(state), false).write_run(state);
}

}  // namespace

TEST_CASE("work directory: beside the output or under --temp, named after it", "[unit]") {
  CHECK(work_path("/a/b/mesh.ply", {}) == "/a/b/mesh.ply.tessera");
  CHECK(work_path("/a/b/mesh.ply", "/fast/disk") == "/fast/disk/mesh.ply.tessera");
}

TEST_CASE("work directory: the same job goes on, and knows itself again", "[unit]") {
  const TempFolder scratch;
  const JobState state = state_in(scratch);
  begin(state);
  const WorkDir work = WorkDir::open_job(state.work, identity_of(state), false);
  CHECK_FALSE(work.created());
  const JobState read = work.read_state();
  CHECK(read.output == state.output);
  CHECK(read.inputs == state.inputs);
  CHECK(read.run.memory_bytes == state.run.memory_bytes);
  CHECK(read.run.threads == 3);
  CHECK(parse_json(read.settings) == parse_json(state.settings));
}

TEST_CASE("work directory: of another job is refused, and the sentence says what differs", "[fault]") {
  const TempFolder scratch;
  JobState state = state_in(scratch);
  begin(state);
  SECTION("an option") {
    state.settings = R"({"resolution": 0.2})";
    CHECK_THROWS_AS(WorkDir::open_job(state.work, identity_of(state), false), UsageError);
    CHECK_THROWS_WITH(WorkDir::open_job(state.work, identity_of(state), false),
                      Catch::Contains("resolution was 0.1 and is 0.2") && Catch::Contains("--force"));
  }
  SECTION("an input that was written again") {
    spill(scratch / "in.txt", "1 2 4\n");
    CHECK_THROWS_WITH(WorkDir::open_job(state.work, identity_of(state), false), Catch::Contains("input"));
  }
  SECTION("another version") {
    Json identity = identity_of(state);
    identity["version"] = "9.9.9";
    CHECK_THROWS_WITH(WorkDir::open_job(state.work, identity, false), Catch::Contains("version"));
  }
  SECTION("--force discards it with all it holds") {
    spill(state.work / "points/old.pts", "old");
    state.settings = R"({"resolution": 0.2})";
    const WorkDir work = WorkDir::open_job(state.work, identity_of(state), true);
    CHECK(work.created());
    CHECK_FALSE(std::filesystem::exists(state.work / "points/old.pts"));
  }
}

TEST_CASE("work directory: a damaged job.json is refused, --force discards it", "[fault]") {
  const TempFolder scratch;
  const JobState state = state_in(scratch);
  for (const std::string bad : {"", "{", "[]", "{\"identity\": 3}", "\xff\xff"}) {
    begin(state);
    spill(state.work / "job.json", bad);
    CAPTURE(bad);
    CHECK_THROWS_AS(WorkDir::open_job(state.work, identity_of(state), false), InputError);
    CHECK_THROWS_AS(WorkDir::open_existing(state.work, true), InputError);
    CHECK(WorkDir::open_job(state.work, identity_of(state), true).created());
    std::filesystem::remove_all(state.work);
  }
}

TEST_CASE("work directory: a folder that is none is never touched", "[fault]") {
  const TempFolder scratch;
  const JobState state = state_in(scratch);
  spill(state.work / "thesis.txt", "mine");
  for (const bool force : {false, true}) {
    CHECK_THROWS_AS(WorkDir::open_job(state.work, identity_of(state), force), UsageError);
    CHECK(test::file_bytes(state.work / "thesis.txt") == "mine");
  }
  CHECK_THROWS_AS(WorkDir::open_existing(state.work, true), InputError);
}

TEST_CASE("work directory: what a killed start or removal leaves does not stop the next run", "[fault]") {
  const TempFolder scratch;
  const JobState state = state_in(scratch);
  spill(state.work / "job.json.tessera-part", "{\"iden");
  spill(state.work / "lock", "");
  spill(state.work.string() + ".discarded/points/0", "x");
  const WorkDir work = WorkDir::open_job(state.work, identity_of(state), false);
  CHECK(work.created());
  CHECK_FALSE(std::filesystem::exists(state.work.string() + ".discarded"));
}

TEST_CASE("work directory: one driver at a time, tasks together", "[unit]") {
  const TempFolder scratch;
  const JobState state = state_in(scratch);
  CHECK_FALSE(work_in_use(state.work));
  begin(state);
  CHECK_FALSE(work_in_use(state.work));
  {
    const WorkDir work = WorkDir::open_job(state.work, identity_of(state), false);
    CHECK(work_in_use(state.work));
    CHECK_THROWS_WITH(WorkDir::open_job(state.work, identity_of(state), false),
                      Catch::Contains("another process"));
    CHECK_THROWS_AS(WorkDir::open_existing(state.work, true), UsageError);
    const WorkDir child = WorkDir::open_existing(state.work, false);
  }
  const WorkDir one = WorkDir::open_existing(state.work, true);
  const WorkDir two = WorkDir::open_existing(state.work, true);
  CHECK(work_in_use(state.work));
  CHECK_THROWS_AS(WorkDir::open_job(state.work, identity_of(state), false), UsageError);
}

TEST_CASE("work directory: leftovers of killed tasks go, committed files stay", "[unit]") {
  const TempFolder scratch;
  const JobState state = state_in(scratch);
  begin(state);
  spill(state.work / "points/1.pts", "good");
  spill(state.work / "points/2.pts.part", "half");
  const WorkDir work = WorkDir::open_job(state.work, identity_of(state), false);
  CHECK(std::filesystem::exists(state.work / "points/1.pts"));
  CHECK_FALSE(std::filesystem::exists(state.work / "points/2.pts.part"));
  CHECK(work.unknown_files({"points/1.pts"}).empty());
  CHECK(work.unknown_files({}) == std::vector<std::string>{"points/1.pts"});
}

TEST_CASE("fingerprint: sees a change at the start, at the end and of the length", "[property]") {
  const TempFolder scratch;
  const auto path = scratch / "in.las";
  std::string content(3000000, 'a');
  spill(path, content);
  const std::uint64_t before = fingerprint_input(path).xxh3;
  CHECK(fingerprint_input(path).xxh3 == before);
  CHECK(fingerprint_input(path).bytes == content.size());
  for (const std::size_t at : {std::size_t{0}, std::size_t{65535}, content.size() - 1}) {
    std::string other = content;
    other[at] = 'b';
    spill(path, other);
    CAPTURE(at);
    CHECK(fingerprint_input(path).xxh3 != before);
  }
  for (const std::size_t bytes : {0, 1, 65535, 65536, 65537, 100000}) {
    spill(path, std::string(bytes, 'a'));
    CHECK(fingerprint_input(path).bytes == bytes);
  }
  CHECK_THROWS_AS(fingerprint_input(scratch / "none"), InputError);
}

}  // namespace work_dir_test
