#include "stream/stages/resample/resample_needs.h"

#include <algorithm>

#include "stream/meshes/mesh_store.h"
#include "stream/stages/resample/resample_stages.h"

namespace tessera {
namespace {

// Patches that the box of a blend meets: of a short one, and of one along a whole body.
constexpr std::uint64_t kPatches = 9, kMostPatches = 32;

}  // namespace

std::vector<StageNeed> resample_needs(const MeshSize& mesh) {
  const auto patches = [&](std::uint64_t count) {
    return MeshSize{std::min(mesh.vertices, count * ImportPlan::kBrickVertices),
                    std::min(mesh.faces, 2 * count * ImportPlan::kBrickVertices)};
  };
  const auto blend = [&](std::uint64_t count) {
    const MeshSize near = patches(count);
    return blends_task_bytes(MeshStore::block_bytes(near.vertices, near.faces), near.vertices, near.faces);
  };
  const MeshSize one = patches(1);
  const std::uint64_t patch = MeshStore::block_bytes(one.vertices, one.faces);
  return {{"scale", resample_scale_bytes(patch), 0},
          {"blends", blend(kPatches), blend(kMostPatches)},
          {"apply", resample_apply_bytes(patch, 0, 0), resample_apply_bytes(patch, patch, patch)}};
}

}  // namespace tessera
