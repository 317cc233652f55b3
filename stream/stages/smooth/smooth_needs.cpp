#include "stream/stages/smooth/smooth_needs.h"

#include <algorithm>
#include <cmath>

#include "stream/stages/smooth/smooth_before.h"
#include "stream/stages/smooth/smooth_stage.h"
#include "stream/stages/smooth/untangle_stages.h"

namespace tessera {

StageNeed smooth_round_need(const SmoothRound& rule, std::size_t round, const MeshSize& mesh,
                            std::uint64_t patch_vertices) {
  const auto with = [&](std::uint64_t edge, std::uint64_t all) {
    const std::uint64_t vertices = rule.by_flow ? all : std::min(all, edge * edge);
    const std::uint64_t faces = std::min(mesh.faces, 2 * vertices);
    const std::uint64_t patch = std::min(mesh.vertices, patch_vertices);
    return smooth_tile_bytes(rule, vertices, faces, MeshStore::block_bytes(patch, 2 * patch));
  };
  const auto across = static_cast<std::uint64_t>(std::sqrt(static_cast<double>(patch_vertices)));
  const auto rings = static_cast<std::uint64_t>(round_rings(rule));
  // Rings are reached by whole patches, and by the longest edge. Vertices at seams are in every patch.
  return {smooth_folder(round), with(across, mesh.vertices),
          with(4 * (across + 2 * rings), mesh.vertices + mesh.vertices / 4)};
}

std::vector<StageNeed> noise_needs(const MeshSize& mesh, std::uint64_t patch_vertices) {
  const std::uint64_t patch = std::min(mesh.vertices, patch_vertices);
  std::vector<StageNeed> needs = {
      {"reach", 2 * MeshStore::block_bytes(patch, 2 * patch) + kTileSlackBytes, 0}};
  const std::uint64_t around = std::min(27 * patch, mesh.vertices + mesh.vertices / 4);
  // A patch, and all that may lie around it.
  needs.push_back({"noise", noise_task_bytes(patch, 2 * patch), noise_task_bytes(around, 2 * around)});
  return needs;
}

std::vector<StageNeed> smooth_before_needs(const std::string& method, const MeshSize& mesh,
                                           std::uint64_t patch_vertices) {
  std::vector<StageNeed> needs = noise_needs(mesh, patch_vertices);
  needs.push_back({"noise-left", needs.back().sure, needs.back().likely});
  const std::vector<SmoothRound> rounds = smooth_before_rounds(method);
  for (std::size_t round = 1; round <= rounds.size(); ++round)
    needs.push_back(smooth_round_need(rounds[round - 1], round, mesh, patch_vertices));
  if (!rounds.empty())
    for (const StageNeed& need : untangle_needs(mesh, patch_vertices)) needs.push_back(need);
  for (StageNeed& need : needs) need.likely = std::max(need.likely, need.sure);
  return needs;
}

std::vector<StageNeed> smooth_needs(const std::vector<SmoothRound>& rounds, const MeshSize& mesh) {
  std::vector<StageNeed> needs;
  for (std::size_t round = 1; round <= rounds.size(); ++round)
    needs.push_back(smooth_round_need(rounds[round - 1], round, mesh, ImportPlan::kBrickVertices));
  for (const StageNeed& need : untangle_needs(mesh, ImportPlan::kBrickVertices)) needs.push_back(need);
  return needs;
}

}  // namespace tessera
