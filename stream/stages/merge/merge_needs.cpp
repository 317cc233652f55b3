#include "stream/stages/merge/merge_needs.h"

#include <algorithm>

#include "stream/meshes/mesh_store.h"
#include "stream/stages/merge/merge_stages.h"

namespace tessera {
namespace {

// Patches around one of two sheets over each other, itself too: as a rule, and all.
constexpr std::uint64_t kAround = 16, kMostAround = 18;
/// Of the strip in a brick, of 512.
constexpr std::uint64_t kStripLeaves = 64, kMostStripLeaves = 192;

}  // namespace

std::vector<StageNeed> merge_needs(const RunOptions& run, const MeshSize& all) {
  const auto patches = [&](std::uint64_t count) {
    return MeshSize{std::min(all.vertices, count * ImportPlan::kBrickVertices),
                    std::min(all.faces, 2 * count * ImportPlan::kBrickVertices)};
  };
  const MeshSize one = patches(1);
  const std::uint64_t patch = MeshStore::block_bytes(one.vertices, one.faces),
                      near = merge_near_bytes(patches(kAround)),
                      most = merge_near_bytes(patches(kMostAround));
  return {{"scale", patch + (std::uint64_t{1} << 20), 0},
          {"joints", merge_joints_bytes(run, patch, near), merge_joints_bytes(run, patch, most)},
          {"cover", merge_cover_bytes(run, one, near), merge_cover_bytes(run, one, most)},
          {"strip", merge_strip_bytes(kStripLeaves, near, merge_near_bytes(one)),
           merge_strip_bytes(kMostStripLeaves, most, near)},
          {"zip", merge_zip_bytes({0, 0}, patch), merge_zip_bytes(patches(4), patch)}};
}

}  // namespace tessera
