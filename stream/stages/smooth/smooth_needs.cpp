#include "stream/stages/smooth/smooth_needs.h"

#include <algorithm>
#include <cmath>

#include "stream/stages/plan/forecast_rates.h"
#include "stream/stages/plan/planned_scan.h"
#include "stream/stages/smooth/coarse_files.h"
#include "stream/stages/smooth/smooth_before.h"
#include "stream/stages/smooth/smooth_plan.h"
#include "stream/stages/smooth/smooth_stages.h"
#include "stream/stages/smooth/untangle_stages.h"

namespace tessera {
namespace {

/// Of a coarse level (coarse_level.h): a large sheet has about so many unknowns (119,538 to 210,000 were counted), a small one
/// an unknown for so many vertices. Of each: entries of the matrix, sums that patches add to it; bytes of its solution, and of
/// a patch's sums, a vertex.
constexpr std::uint64_t kUnknowns = 150'000, kVerticesPerUnknown = 20, kEntries = 14, kLoads = 2;
constexpr std::uint64_t kSolutionBytes = sizeof(CoarseUnknown) + sizeof(CoarseValue), kSumsBytes = 100;

}  // namespace

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

std::vector<StageNeed> coarse_needs(const SmoothRound& rule, std::size_t round, const MeshSize& mesh,
                                    std::uint64_t patch_vertices) {
  // In edges: lengths of the mesh do not matter to how many vertices a tile sees.
  const CoarseOptions coarse = coarse_options(rule.filter.lambda, rule.filter.order, 1.0, mesh.faces);
  SmoothRound filter = rule;
  filter.filter.degree = coarse.degree;
  const auto across = static_cast<std::uint64_t>(std::sqrt(static_cast<double>(patch_vertices)));
  const auto halo = static_cast<std::uint64_t>(coarse_halo(coarse));
  const std::uint64_t most = mesh.vertices + mesh.vertices / 4,
                      patch = std::min(mesh.vertices, patch_vertices);
  const std::uint64_t patch_bytes = MeshStore::block_bytes(patch, 2 * patch);
  const auto vertices = [&](std::uint64_t rings, std::uint64_t wider) {
    const std::uint64_t edge = wider * (across + 2 * (rings + halo));
    return std::min(most, edge * edge);
  };
  const auto solved = [&](std::uint64_t unknowns) {
    return coarse_stage_bytes(rule.filter.order, unknowns, kEntries * unknowns, kLoads * unknowns,
                              kSumsBytes * patch);
  };
  const std::uint64_t unknowns = std::min(mesh.vertices / kVerticesPerUnknown, kUnknowns);
  const auto sums = [&](std::uint64_t wider) {
    const std::uint64_t v = vertices(1, wider);
    return coarse_sums_bytes(rule, v, 2 * v, patch);
  };
  const auto rings = static_cast<std::uint64_t>(round_rings(filter)) + 1;
  const auto filtered = [&](std::uint64_t wider) {
    const std::uint64_t v = vertices(rings, wider);
    return smooth_tile_bytes(filter, v, 2 * v, patch_bytes) + kSolutionBytes * unknowns;
  };
  // As far as the longest edge of a patch reaches, which on bodies with flat sides is several.
  constexpr std::uint64_t kWider = 4;
  return {{coarse_sums_folder(round), sums(1), sums(kWider)},
          {coarse_folder(round), solved(unknowns * 4 / 5), solved(unknowns * 3 / 2)},
          {smooth_folder(round), filtered(1), filtered(kWider)}};
}

std::vector<StageNeed> noise_needs(const MeshSize& mesh, std::uint64_t patch_vertices) {
  const std::uint64_t patch = std::min(mesh.vertices, patch_vertices);
  std::vector<StageNeed> needs = {
      {"reach", 2 * MeshStore::block_bytes(patch, 2 * patch) + kTileSlackBytes, 0}};
  const std::uint64_t around = std::min(27 * patch, mesh.vertices + mesh.vertices / 4);
  // A patch, and all that may lie around it.
  for (const char* name : {"noise-look", "noise"})
    needs.push_back({name, noise_task_bytes(patch, 2 * patch), noise_task_bytes(around, 2 * around)});
  return needs;
}

std::vector<StageNeed> smooth_before_needs(const std::string& method, const MeshSize& mesh,
                                           std::uint64_t patch_vertices) {
  std::vector<StageNeed> needs = noise_needs(mesh, patch_vertices);
  needs.erase(needs.begin() + 1);  // all is measured here
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
  std::vector<StageNeed> needs = noise_needs(mesh, ImportPlan::kBrickVertices);
  needs.resize(1);  // noise is measured by the rounds themselves
  for (std::size_t round = 1; round <= rounds.size(); ++round) {
    const SmoothRound& rule = rounds[round - 1];
    if (rule.cycle < 0)
      needs.push_back(smooth_round_need(rule, round, mesh, ImportPlan::kBrickVertices));
    else
      for (const StageNeed& need : coarse_needs(rule, round, mesh, ImportPlan::kBrickVertices))
        needs.push_back(need);
  }
  for (const StageNeed& need : untangle_needs(mesh, ImportPlan::kBrickVertices)) needs.push_back(need);
  return needs;
}

namespace {

// Microseconds a face: fits of denoise; filters; edges, and noise at a sample.
constexpr double kFitTime = 18.0, kFilterTime = 1.0, kRangeTime = 0.1;

}  // namespace

StageForecast forecast_smoothing(const PlannedScan& scan, const std::string& stage) {
  // The raw mesh comes back in bricks of an import's, and its faces are an estimate.
  const double faces = scan.faces * rates::kFacesMargin * rates::kFacesMargin;
  const MeshSize mesh = {bytes_of(faces, kVerticesPerFace), bytes_of(faces, 1.0)};
  const std::uint64_t patch =
      bytes_of(static_cast<double>(scan.largest_patch.faces), rates::kFacesMargin * kVerticesPerFace);
  for (const StageNeed& need : smooth_before_needs(scan.options.smooth, mesh, patch)) {
    if (need.stage != stage) continue;
    const bool moves = stage.starts_with("smooth-"), fits = stage == "smooth-1";
    const std::uint64_t disk = scan.smoothed_bytes / 2;
    return {.tasks = scan.groups.size(),
            .task_bytes = need.likely,
            .sure_bytes = kTileSlackBytes,
            .disk_bytes = moves ? disk : 0,
            .files = scan.groups.size(),
            .processor_us = scan.faces * (fits    ? kFitTime
                                          : moves ? kFilterTime
                                                  : kRangeTime),
            .moved_bytes = (moves ? 2.0 : 1.0) * static_cast<double>(disk)};
  }
  return idle_forecast();
}

}  // namespace tessera
