#include <algorithm>
#include <cmath>

#include <nlohmann/json.hpp>

#include "octree/error.h"
#include "stream/files/task_files.h"
#include "stream/import/import_needs.h"
#include "stream/import/import_stages.h"
#include "stream/import/system_beside.h"
#include "stream/meshes/store_write_stage.h"
#include "stream/page/report_page.h"
#include "stream/stages/smooth/coarse_files.h"
#include "stream/stages/smooth/smooth_stage.h"

namespace tessera {
namespace {

using json = nlohmann::json;

constexpr std::uint64_t kSortBytes = std::uint64_t{32} << 20;

/// The report's `input`, and its `mesh`: what was written, and how far vertices moved in the last round (with a tolerance: in
/// all).
void summarise(json& report) {
  json mesh = json::object();
  for (const json& stage : report.at("stages")) {
    const std::string name = stage.at("name").get<std::string>();
    if (name == "write" || name.rfind("smooth-", 0) == 0) mesh.update(stage.at("result"));
  }
  report["mesh"] = mesh;
  report["input"] = import_report(report, kSmoothImport);
}

/// Of a round over one patch and the rings around it, the least that a tile can be; of the whole mesh where there is one
/// block. Rings are reached by whole patches, and by the longest edge.
StageNeed round_need(const SmoothRound& rule, const std::string& stage, const MeshSize& mesh) {
  const auto with = [&](std::uint64_t edge, std::uint64_t all) {
    const std::uint64_t vertices = rule.by_flow ? all : std::min(all, edge * edge);
    const std::uint64_t faces = std::min(mesh.faces, 2 * vertices);
    const std::uint64_t patch = std::min(mesh.vertices, ImportPlan::kBrickVertices);
    return smooth_tile_bytes(rule, vertices, faces, MeshStore::block_bytes(patch, 2 * patch));
  };
  const auto across = static_cast<std::uint64_t>(std::sqrt(static_cast<double>(ImportPlan::kBrickVertices)));
  const auto rings = static_cast<std::uint64_t>(round_rings(rule));
  // Vertices at seams are in every patch.
  return {stage, with(across, mesh.vertices),
          with(4 * (across + 2 * rings), mesh.vertices + mesh.vertices / 4)};
}

}  // namespace

OptionTable option_table(SmoothOptions& o) {
  OptionTable t("What it computes");
  t.add("method", &o.method,
        "implicit: solves (1 + lambda L^order) x = b; laplacian, bilaplacian: explicit steps; taubin: does "
        "not shrink; bilateral: filters normals, moves vertices after them, finds creases through noise; "
        "denoise: fits a quadric to every smooth side of a vertex, in a window as wide as the noise asks for "
        "and the shape allows; creases and corners come out sharp, then implicit; curvature-flow: implicit "
        "steps with fresh geometry, any lambda, the whole mesh in memory (about 1,200 bytes a vertex; "
        "refused with 4 if it does not fit), no face folds over, else exit code 6")
      .shown_as("METHOD");
  t.add("weights", &o.weights, "cotangent: vertices stay in place along the surface; uniform")
      .shown_as("cotangent|uniform");
  t.add("steps", &o.steps, "how often; explicit methods want 10 to 100, others 1 to 3");
  t.add("lambda", &o.lambda,
        "strength of a step, no unit: waves shorter than about 3 lambda^(1/2) edges (order 2: 3 "
        "lambda^(1/4)) lose more than half; implicit and denoise: up to 1e9, long waves by a coarse level "
        "(order 1 from 140, order 2 from 2300 on); curvature-flow: any; laplacian, taubin: up to 1, "
        "bilaplacian: up to 0.5; 0 = 10 for implicit, 1 for denoise, 0.5 for laplacian and taubin, 0.25 for "
        "bilaplacian, 1 for curvature-flow");
  t.add("order", &o.order,
        "implicit, denoise, curvature-flow: 1 = membrane, 2 = thin plate (keeps more shape); 0 = 2 for "
        "denoise, else 1");
  t.add("degree", &o.degree,
        "implicit, denoise: Chebyshev steps, a ring each, without a coarse level; 0 = enough for an error of "
        "0.001");
  t.add("tolerance", &o.tolerance, "no vertex moves farther than this, units of the mesh; 0 = no limit");
  t.add("feature-angle", &o.feature_angle_deg,
        "edges whose faces open more, in degrees, are creases, smoothed along themselves only; 0 = none");
  t.add("normal-rounds", &o.normal_rounds, "bilateral, denoise: rounds on normals");
  t.add("vertex-rounds", &o.vertex_rounds, "bilateral: rounds on vertices");
  t.add("noise", &o.noise,
        "denoise: standard deviation of the noise along the normal, units of the mesh; 0 = measured "
        "everywhere in the mesh itself");
  return t;
}

JobDescription smooth_job(const SmoothOptions& options) {
  const SmoothPlan plan{smooth_rounds(options), options.tolerance};
  JobDescription job{"smooth",  import_stages({0, kSmoothImport}), 0, summarise, {carried_system()},
                     job_page()};
  job.needs = [plan](const JobState& state) {
    const MeshSize mesh = claimed_mesh_size(state.inputs.at(0));
    std::vector<StageNeed> needs = import_needs(state.run, {0, kSmoothImport}, mesh);
    for (std::size_t round = 1; round <= plan.rounds.size(); ++round)
      needs.push_back(round_need(plan.rounds[round - 1], "smooth-" + std::to_string(round), mesh));
    return needs;
  };
  job.stages.push_back({"reach", make_reach_stage});
  for (std::size_t round = 1; round <= plan.rounds.size(); ++round) {
    if (plan.rounds[round - 1].cycle >= 0) {
      job.stages.push_back({coarse_sums_folder(round), [plan, round](const JobState& state) {
                              return make_coarse_sums_stage(state, plan, round);
                            }});
      job.stages.push_back({coarse_folder(round), [plan, round](const JobState& state) {
                              return make_coarse_stage(state, plan, round);
                            }});
    }
    job.stages.push_back({"smooth-" + std::to_string(round), [plan, round](const JobState& state) {
                            return make_smooth_stage(state, plan, round);
                          }});
  }
  const std::size_t rounds = plan.rounds.size();
  job.stages.push_back({"write", [rounds](const JobState& state) {
                          return make_store_write_stage(
                              state, MeshStore(list_task_files(state.work / smooth_folder(rounds), ".tmm")),
                              "made by tessera smooth " + state.settings, kSortBytes);
                        }});
  return job;
}

}  // namespace tessera
