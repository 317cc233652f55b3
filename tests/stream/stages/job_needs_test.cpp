// What jobs ask for before their first pass: their last stages too, and only stages that they have.
#include <catch2/catch.hpp>

#include <algorithm>
#include <set>
#include <string>

#include "stream/stages/bake/bake_job.h"
#include "stream/stages/deform/deform_needs.h"
#include "stream/stages/merge/merge_job.h"
#include "stream/stages/resample/resample_job.h"
#include "stream/stages/smooth/smooth_job.h"
#include "stream/stages/solid/csg_job.h"
#include "stream/stages/solid/field_job.h"
#include "stream/stages/solid/resurface_job.h"
#include "stream/stages/tiles/tiles_job.h"
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

namespace {

/// Stages that nobody asks for before the first, in their order.
std::string unasked(const JobDescription& job, const JobState& state) {
  std::set<std::string> asked;
  for (const StageNeed& need : job.needs(state)) {
    CHECK(std::max(need.sure, need.likely) > 0);
    asked.insert(need.stage);
  }
  std::string names;
  for (const StageEntry& entry : job.stages)
    if (asked.count(entry.name) == 0) names += (names.empty() ? "" : " ") + entry.name;
  return names;
}

}  // namespace

TEST_CASE("job needs: what lies between import and output is asked for", "[unit]") {
  const test::TempFolder folder;
  JobState state;
  for (const char* name : {"a.ply", "b.ply"}) {
    state.inputs.push_back(folder.path() / name);
    test::write_sheet(state.inputs.back(), 100, [](int i, int j) { return Double3{1.0 * i, 1.0 * j, 0}; });
  }
  state.output = folder.path() / "out.ply";
  state.run.memory_bytes = std::uint64_t{1} << 30;
  state.run.threads = 2;
  // Repairs are of few places; of borders that are open nothing is known.
  CHECK(unasked(resurface_job({}), state) == "mesh-0-repair inside");
  ResurfaceOptions shell;
  shell.shell = 1.0;
  CHECK(unasked(resurface_job(shell), state) == "mesh-0-repair inside");
  CsgOptions csg;
  const std::string at = R"("placement":[1,0,0,0,1,0,0,0,1,0,0,0])";
  csg.program = "[{\"mesh\":0," + at + "},{\"mesh\":1," + at + "},{\"join\":\"union\"}]";
  CHECK(unasked(csg_job(csg), state) == "mesh-0-repair mesh-1-repair inside");
  FieldJobOptions field;
  CHECK(unasked(field_job(field), state) == "mesh-0-repair inside");
  field.full = true;
  CHECK(unasked(field_job(field), state) == "mesh-0-repair inside");
  field.tolerance = 1.0;
  CHECK(unasked(field_job(field), state) == "mesh-0-repair inside");
  CHECK(unasked(merge_job({}), state) == "mesh-0-repair mesh-1-repair");
  CHECK(unasked(resample_job({}), state) == "mesh-repair");
  CHECK(unasked(bake_job({}), state) == "mesh-repair");
  SmoothOptions far;
  far.lambda = 5000.0;
  CHECK(unasked(smooth_job(far), state) == "mesh-repair");
  // Levels that a mesh of 20,000 faces may have, one for each factor of four down to a tile.
  TilesOptions tiles;
  tiles.tile_faces = 1000;
  const std::string open = unasked(tiles_job(tiles), state);
  CHECK(open.rfind("mesh-repair level-4-tolerance ", 0) == 0);
}

TEST_CASE("job needs: the base of an edit of any mesh fits beside a process into 256 MiB", "[unit]") {
  const std::uint64_t vertices = DeformOptions().base_vertices;
  const BaseInput input = base_input(kDecimatedFaces * vertices);
  const std::uint64_t bytes = base_stage_bytes(false, input, vertices);
  // What there is of the cap beside a process of 40 MiB.
  CHECK(bytes <= (std::uint64_t{256 - 256 / 32 - 40} << 20));
  CHECK(bytes >= input.loading_bytes);
}

}  // namespace job_needs_test
