#include "stream/stages/crossings/crossing_stages.h"

#include <algorithm>

#include "kernels/mesh/mesh_block_ops.h"
#include "stream/files/task_files.h"
#include "stream/runtime/report.h"
#include "stream/runtime/serial_stage.h"
#include "stream/stages/crossings/crossing_parts.h"

namespace tessera {
namespace {

bool is_due(const JobState& state, const CrossingPlan& plan) {
  return !plan.due || plan.due(state);
}

}  // namespace

CrossingPlan input_mend(const std::string& folder) {
  CrossingPlan plan;
  plan.prefix = kInputMendPrefix;
  plan.mesh = [=](const JobState& state) {
    return StoreFiles{list_task_files(state.work / folder / "tiles", ".tmm"),
                      list_task_files(state.work / folder / "repaired", ".tmm")};
  };
  plan.may_cut = plan.asked_for = true;
  plan.generation = 1;
  return plan;
}

std::vector<StageEntry> crossing_stages(const CrossingPlan& plan) {
  const auto entry = [&](const std::string& name, auto make) {
    return StageEntry{name, [=](const JobState& state) -> std::unique_ptr<Stage> {
                        return is_due(state, plan) ? make(state, plan) : make_idle_stage(name);
                      }};
  };
  std::vector<StageEntry> stages = {entry(crossing_search_name(plan), make_crossing_search_stage),
                                    entry(crossing_mend_name(plan), make_crossing_mend_stage)};
  if (plan.asked_for) stages.push_back(entry(self_union_name(plan), make_self_union_stage));
  return stages;
}

MeshStore open_to_mend(const JobState& state, const CrossingPlan& plan) {
  const StoreFiles mesh = plan.mesh(state);
  return MeshStore(mesh.files, mesh.newer);
}

namespace {

MeshStore open_with(const JobState& state, const CrossingPlan& plan, const std::vector<std::string>& passes) {
  StoreFiles mesh = plan.mesh(state);
  for (const std::string& pass : passes)
    for (const auto& file : list_task_files(state.work / pass, ".tmm")) mesh.newer.push_back(file);
  return MeshStore(mesh.files, mesh.newer);
}

}  // namespace

MeshStore open_before_union(const JobState& state, const CrossingPlan& plan) {
  return open_with(state, plan, {crossing_mend_name(plan)});
}

MeshStore open_mended(const JobState& state, const CrossingPlan& plan) {
  return open_with(state, plan, {crossing_mend_name(plan), self_union_name(plan)});
}

Json mending_of(const Json& report, const std::string& prefix) {
  const Json found = result_of(report, prefix + "crossings");
  if (!found.is_object() || !found.contains("crossing_pairs")) return nullptr;
  Json out = found;
  if (const Json mended = result_of(report, prefix + "mend"); mended.is_object()) out.update(mended);
  if (const Json united = result_of(report, prefix + "unite");
      united.is_object() && united.contains("pairs")) {
    out["united"] = united;
    out["left_groups"] = out["left_pairs"] = 0;
    out["left"] = Json::array();
  }
  return out;
}

std::vector<StageNeed> crossing_needs(const CrossingPlan& plan, const MeshSize& mesh,
                                      std::uint64_t patch_vertices) {
  const auto tile = [&](std::uint64_t vertices) {
    return crossing_tile_bytes(vertices, std::min(mesh.faces, 2 * vertices));
  };
  const std::uint64_t patch = std::min(mesh.vertices, patch_vertices);
  const std::uint64_t around = std::min(9 * patch, mesh.vertices + mesh.vertices / 4);
  std::vector<StageNeed> needs = {
      {crossing_search_name(plan), tile(patch), std::max(tile(patch), tile(around))},
      {crossing_mend_name(plan), crossing_mend_stage_bytes(0, 0), 0}};
  if (plan.asked_for) needs.push_back({self_union_name(plan), 0, 0});
  return needs;
}

std::function<Double3(const Double3&)> written_position(const MeshPlacement& placement) {
  if (placement.rounding == 0.0) return {};
  return [origin = placement.origin](const Double3& p) {
    Double3 out = p - origin;
    for (double& x : out) x = static_cast<double>(static_cast<float>(x));
    return out;
  };
}

std::vector<std::uint8_t> faces_in_box(const MeshBlock& block, const MeshBox& box) {
  std::vector<std::uint8_t> in(block.faces.size());
  for (std::size_t f = 0; f < in.size(); ++f) {
    bool apart = false;
    for (std::size_t a = 0; a < 3; ++a) {
      const auto [low, high] =
          std::minmax({block.position[block.faces[f][0]][a], block.position[block.faces[f][1]][a],
                       block.position[block.faces[f][2]][a]});
      apart = apart || low > box.high[a] || high < box.low[a];
    }
    in[f] = !apart;
  }
  return in;
}

std::optional<MeshBlock> load_faces(const MeshStore& store, const MeshBox& box, std::size_t max_faces) {
  std::vector<MeshBlock> pieces;
  std::size_t faces = 0;
  for (const std::size_t p : store.select(box)) {
    const MeshBlock patch = store.load({&p, 1});
    MeshBlock piece = select_faces(patch, faces_in_box(patch, box));
    faces += piece.faces.size();
    if (faces > max_faces) return std::nullopt;
    if (!piece.faces.empty()) pieces.push_back(std::move(piece));
  }
  std::vector<const MeshBlock*> pointers;
  for (const MeshBlock& piece : pieces) pointers.push_back(&piece);
  return merge_blocks(pointers, {});
}

}  // namespace tessera
