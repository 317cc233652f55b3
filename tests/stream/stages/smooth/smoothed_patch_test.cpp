// Vertices that a tile could not see far enough around: their rings give them the positions that the whole mesh does.
#include "stream/stages/smooth/smoothed_patch.h"

#include <catch2/catch.hpp>

#include <algorithm>
#include <map>
#include <vector>

#include "octree/error.h"
#include "stream/stages/smooth/smooth_plan.h"
#include "tests/helpers/temp_folder.h"
#include "tests/helpers/torn_sheet.h"

namespace smoothed_patch_test {

namespace {

using namespace tessera;

SmoothRound rule_of(const std::string& method) {
  SmoothOptions options;
  options.method = method;
  options.normal_rounds = 2;
  options.vertex_rounds = 3;
  options.degree = 5;
  options.noise = 1.0;
  return smooth_rounds(options).front();
}

}  // namespace

TEST_CASE("smoothed patch: what a tile left open gets the bytes of the whole mesh, in parts too",
          "[property]") {
  const test::TempFolder folder;
  const MeshBlock mesh = test::torn_sheet(40, 200, 3);
  const MeshStore store = test::store_of(mesh, folder / "a.tmm");
  const std::uint64_t patch_bytes = store.largest_patch_bytes();
  const std::string method = GENERATE("implicit", "bilateral", "denoise");
  CAPTURE(method);
  const SmoothRound rule = rule_of(method);
  const SmoothedBlock whole = smooth_block(mesh, rule);
  std::map<std::uint64_t, std::size_t> at;
  for (std::size_t v = 0; v < mesh.key.size(); ++v) {
    REQUIRE(whole.complete[v] == 1);
    at[mesh.key[v]] = v;
  }
  // All at once; and so little that a patch goes in parts, where rings are not all of the mesh.
  const bool local = method != "denoise";
  const std::uint64_t all = smooth_by_rings_bytes(rule, mesh.key.size(), mesh.faces.size(), patch_bytes),
                      little = smooth_by_rings_bytes(rule, 230, 420, patch_bytes);
  std::uint64_t read_at_once = 0, read_in_parts = 0, first = 0;
  for (std::size_t p = 0; p < store.patches().size(); ++p)
    for (const bool parts : {false, true}) {
      if (parts && !local) continue;
      (parts ? read_in_parts : read_at_once) += smooth_by_rings(
          store, rule, {&p, 1}, parts ? little : all, [] {},
          [&](std::size_t of, const SmoothedPatch& patch) {
            CHECK(of == p);
            REQUIRE(patch.whole());
            for (std::size_t v = 0; v < patch.key.size(); ++v) {
              CHECK(patch.position[v] == whole.position[at.at(patch.key[v])]);
              CHECK(patch.role[v] == whole.role[at.at(patch.key[v])]);
              CHECK(patch.from[v] == mesh.position[at.at(patch.key[v])]);
              first += parts ? 0 : patch.first[v];
            }
          });
    }
  CHECK(first == mesh.key.size());
  if (local) CHECK(read_in_parts > read_at_once);
}

TEST_CASE("smoothed patch: groups are cut until they fit, what not even one vertex fits into is said",
          "[unit]") {
  const test::TempFolder folder;
  const MeshBlock mesh = test::torn_sheet(40, 200, 3);
  const MeshStore store = test::store_of(mesh, folder / "a.tmm");
  const SmoothRound rule = rule_of("implicit");
  std::vector<std::size_t> all;
  for (std::size_t p = 0; p < store.patches().size(); ++p) all.push_back(p);
  CHECK_THROWS_AS(smooth_by_rings(
                      store, rule, all, kTileSlackBytes, [] {}, [](std::size_t, const auto&) {}),
                  ResourceError);
  // Groups of them go by themselves.
  std::vector<std::size_t> done;
  smooth_by_rings(
      store, rule, all, smooth_by_rings_bytes(rule, 600, 1100, store.largest_patch_bytes()), [] {},
      [&](std::size_t p, const SmoothedPatch& patch) {
        CHECK(patch.whole());
        done.push_back(p);
      });
  std::sort(done.begin(), done.end());
  CHECK(done == all);
}

}  // namespace smoothed_patch_test
