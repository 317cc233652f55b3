#include "stream/stages/levels/level_ends.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "octree/morton.h"
#include "stream/files/task_files.h"
#include "stream/points/plan.h"
#include "stream/stages/plan/planned_scan.h"
#include "stream/stages/plan/stage_forecast.h"
#include "stream/stages/surface/first_pass.h"
#include "stream/stages/surface/level_files.h"

namespace tessera {
namespace {

LevelEnds ends_of(const ReconstructOptions& options, const Plan& plan) {
  LevelEnds ends;
  if (options.smooths_border()) ends.lift = plan.noise_cells * plan.lattice.h;
  ends.holes = hole_limit(options, plan, HoleScene::kOther);
  return ends;
}

// Microseconds a face.
constexpr double kBorderTime = 0.15, kLoopsTime = 0.1, kHolesTime = 0.3, kEndsTime = 0.1;

StageForecast forecast_end(const PlannedScan& scan, const std::string& stage) {
  const LevelEnds ends = ends_of(scan.options, scan.plan);
  const bool border = ends.lift > 0.0, holes = ends.holes.edges > 0;
  const std::uint64_t patch = MeshStore::block_bytes(scan.largest_patch.vertices, scan.largest_patch.faces);
  const auto told = [&](const auto& bytes, double time) {
    StageForecast out = {.tasks = scan.groups.size(), .task_bytes = bytes(patch), .sure_bytes = bytes(0)};
    out.files = scan.groups.size();
    out.processor_us = scan.faces * time;
    return out;
  };
  if (stage == "border" && border) return told(level_border_task_bytes, kBorderTime);
  if (stage == "loops" && holes) {
    StageForecast out = told(level_loops_task_bytes, kLoopsTime);
    out.finish_bytes = level_loops_finish_bytes();
    return out;
  }
  if (stage == "holes" && holes)
    return told([&](std::uint64_t bytes) { return level_holes_task_bytes(bytes, ends.holes.edges); },
                kHolesTime);
  if (stage == "ends" && ends.any()) {
    StageForecast out = told(level_ends_task_bytes, kEndsTime);
    out.disk_bytes = std::max(scan.surface_bytes, scan.output_bytes);  // what changes is not compact
    out.moved_bytes = 2.0 * static_cast<double>(scan.surface_bytes);
    return out;
  }
  return idle_forecast();
}

}  // namespace

LevelEnds level_ends(const JobState& state) {
  return ends_of(reconstruct_options(state), Plan::of_work(state.work));
}

MeshStore open_level_surface(const JobState& state) {
  return MeshStore(list_task_files(state.work / kFullFolder, ".tmm"),
                   list_task_files(state.work / kPrunedFullFolder, ".tmm"));
}

StoreFiles ended_surface_files(const JobState& state) {
  auto ended = list_task_files(state.work / kEndedFolder, ".tmm");
  if (!ended.empty()) return {std::move(ended)};
  return {list_task_files(state.work / kFullFolder, ".tmm"),
          list_task_files(state.work / kPrunedFullFolder, ".tmm")};
}

std::vector<double> patch_cells(const MeshStore& store, const JobState& state) {
  const ReconstructOptions options = reconstruct_options(state);
  const LevelTree tree = level_tree_of_work(state.work, static_cast<int>(options.levels));
  const double finest = finest_lattice(Plan::of_work(state.work).lattice, options).h;
  std::vector<double> cells;
  cells.reserve(store.patches().size());
  for (const MeshPatchEntry& e : store.patches())
    cells.push_back(std::ldexp(finest, tree.level_of(brick_of_key(e.key))));
  return cells;
}

std::vector<StageEntry> level_end_stages(const ReconstructOptions& options) {
  if (!options.smooths_border() && options.max_hole_edges() == 0) return {};
  std::vector<StageEntry> stages = {{"border", make_level_border_stage},
                                    {"loops", make_level_loops_stage},
                                    {"holes", make_level_holes_stage},
                                    {"ends", make_level_ends_stage}};
  for (StageEntry& e : stages)
    e.forecast = [name = e.name](const PlannedScan& scan) { return forecast_end(scan, name); };
  return stages;
}

}  // namespace tessera
