// What jobs ask for before their first pass: their last stages too, and only stages that they have.
#include <catch2/catch.hpp>

#include <algorithm>
#include <string>

#include "stream/stages/bake/bake_job.h"
#include "stream/stages/merge/merge_job.h"
#include "stream/stages/smooth/smooth_job.h"
#include "tests/helpers/mesh_files.h"
#include "tests/helpers/temp_folder.h"

namespace job_needs_test {

using namespace tessera;

namespace {

/// What is surely needed of the stage, 0 where nobody asks.
std::uint64_t need_of(const JobDescription& job, const JobState& state, const std::string& stage) {
  REQUIRE(std::any_of(job.stages.begin(), job.stages.end(),
                      [&](const StageEntry& entry) { return entry.name == stage; }));
  std::uint64_t bytes = 0;
  for (const StageNeed& need : job.needs(state))
    if (need.stage == stage) bytes = std::max(bytes, need.sure);
  return bytes;
}

}  // namespace

TEST_CASE("job needs: the last stages of smooth, merge and bake are asked for", "[unit]") {
  const test::TempFolder folder;
  test::WholeMesh mesh;
  mesh.points = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}};
  mesh.faces = {{0, 1, 2}};
  mesh.header.vertices = 3, mesh.header.faces = 1;
  JobState state;
  for (const char* name : {"a.ply", "b.ply"}) {
    state.inputs.push_back(folder.path() / name);
    test::write_whole(state.inputs.back(), mesh);
  }
  state.output = folder.path() / "out.ply";
  state.run.memory_bytes = std::uint64_t{1} << 30;
  state.run.threads = 2;
  // Sorts and buffers of a mesh's file; one page of four channels, sums and weights.
  constexpr std::uint64_t kMiB = std::uint64_t{1} << 20;
  CHECK(need_of(smooth_job({}), state, "write") >= 32 * kMiB);
  CHECK(need_of(smooth_job({}), state, "reach") > 0);
  CHECK(need_of(merge_job({}), state, "write") >= 64 * kMiB);
  BakeOptions bake;
  CHECK(need_of(bake_job(bake), state, "texture-pages") >=
        13 * std::uint64_t{bake.page_size} * bake.page_size);
  CHECK(need_of(bake_job(bake), state, "texture-points") > 0);
}

}  // namespace job_needs_test
