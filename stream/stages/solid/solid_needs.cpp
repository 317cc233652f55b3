#include "stream/stages/solid/solid_needs.h"

#include <algorithm>
#include <vector>

#include "stream/import/import_needs.h"
#include "stream/meshes/mesh_store.h"
#include "stream/meshes/patch_store.h"
#include "stream/stages/solid/solid_stages.h"
#include "stream/stages/surface/output_frame.h"
#include "stream/stages/surface/write_stage.h"
#include "stream/stages/weld/uncross_stage.h"
#include "stream/stages/weld/weld_stage.h"

namespace tessera {
namespace {

// Leaves of a brick that a plane passes, and its faces with some for slopes; what the most have.
constexpr std::uint64_t kPlaneLeaves = 64, kMostLeaves = 128;
constexpr std::uint64_t kPlaneFaces = std::uint64_t{3} * kBrickCells * kBrickCells;
/// Bricks with a surface around one, itself too: of the machine parts of `synth` 17, by the boxes of their patches; all there are.
constexpr std::uint64_t kPlaneBricks = 18, kMostBricks = 27;
constexpr std::uint64_t kFewPatches = std::uint64_t{8} << 20;

/// A patch of the surface in a brick, with so many sheets. Its border, twice.
PatchEntry patch_of(std::uint64_t sheets) {
  PatchEntry patch;
  patch.faces = static_cast<std::uint32_t>(sheets * kPlaneFaces);
  patch.vertices = static_cast<std::uint32_t>(sheets * kPlaneFaces / 2);
  patch.foreign = patch.exported = 8 * kBrickCells;
  patch.components = 4;
  return patch;
}

}  // namespace

std::vector<StageNeed> solid_needs(const JobState& state, const SolidModel& model) {
  std::vector<StageNeed> needs = import_needs(state, model.inputs(), solid_import);
  std::uint64_t vertices = 0;
  for (std::size_t i = 0; i < model.inputs(); ++i)
    vertices = std::max(vertices, claimed_mesh_size(state.inputs.at(i)).vertices);
  vertices = std::min(vertices, ImportPlan::kBrickVertices);
  const std::uint64_t patch = MeshStore::block_bytes(vertices, 2 * vertices);
  const auto surface = [&](std::uint64_t leaves) { return solid_surface_bytes(state, model, leaves, patch); };
  const auto add = [&](const char* stage, std::uint64_t sure, std::uint64_t likely = 0) {
    needs.push_back({stage, sure, likely});
  };
  add("lattice", solid_lattice_bytes(state, model));
  add("lines", std::max(solid_lines_task_bytes(vertices, 2 * vertices), solid_lines_finish_bytes()));
  add("surface", surface(kPlaneLeaves), surface(kMostLeaves));
  if (model.is_offset())
    add("offset", solid_offset_bytes(kPlaneBricks * kPlaneFaces),
        solid_offset_bytes(kMostBricks * kPlaneFaces));
  if (model.is_measured() && !model.is_offset()) {
    if (model.tolerance > 0.0) {
      add("cells", cells_bytes(kPlaneFaces));
      add("octree", octree_bytes());
      return needs;
    }
    if (model.full)
      add("distances", far_distances_bytes(kPlaneFaces));
    else
      add("distances", distances_bytes(kPlaneBricks * kPlaneFaces),
          distances_bytes(kMostBricks * kPlaneFaces));
    add("grid", grid_bytes(), grid_bytes() + kFewPatches);
    return needs;
  }
  // Where bodies meet or get walls two sheets in a brick are usual; one body may have a single one. More are not rare.
  const bool is_one_body = model.inputs() == 1 && !model.is_offset();
  const std::vector<PatchEntry> patches = {patch_of(is_one_body ? 1 : 2)}, most = {patch_of(4)};
  add("weld", std::max(weld_task_bytes(patches), weld_finish_bytes(patches.size(), 1)),
      weld_finish_bytes(patches.size(), 1) + kFewPatches);
  for (const StageEntry& round : uncross_stages(written_by(false)))
    add(round.name.c_str(), uncross_task_bytes(patches), uncross_task_bytes(most));
  add("write", write_bytes({}, 0), write_bytes({}, 0) + kFewPatches);
  return needs;
}

}  // namespace tessera
