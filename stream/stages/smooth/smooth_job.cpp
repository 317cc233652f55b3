#include "stream/stages/smooth/smooth_job.h"

#include <algorithm>

#include "stream/files/json.h"
#include "stream/import/crs_sidecar.h"
#include "stream/import/import_needs.h"
#include "stream/import/import_stages.h"
#include "stream/meshes/store_write_stage.h"
#include "stream/page/report_page.h"
#include "stream/runtime/serial_stage.h"
#include "stream/stages/crossings/crossing_stages.h"
#include "stream/stages/smooth/coarse_files.h"
#include "stream/stages/smooth/smooth_needs.h"
#include "stream/stages/smooth/smooth_stages.h"
#include "stream/stages/smooth/untangle_stages.h"

namespace tessera {
namespace {

const std::string kImport = "mesh";
constexpr std::uint64_t kSortBytes = std::uint64_t{32} << 20;

/// The report's `input`, and its `mesh`: what was written, and how far from where they were given vertices lie now.
void summarise(Json& report) {
  Json mesh = Json::object();
  for (const Json& stage : report.at("stages")) {
    const std::string name = stage.at("name").get<std::string>();
    if (name == "write" || name.rfind("smooth-", 0) == 0) mesh.update(stage.at("result"));
    if (name.rfind("untangle", 0) == 0) add_untangling(stage.at("result"), mesh);
  }
  // What rounding in the file may add to a move.
  if (mesh.contains("largest_move") && mesh.contains("rounding"))
    mesh["largest_move"] = mesh.at("largest_move").get<double>() + mesh.at("rounding").get<double>();
  report["mesh"] = mesh;
  report["input"] = import_report(report, kImport);
  if (const Json mended = mending_of(report, kInputMendPrefix); mended.is_object())
    report["crossings"] = {{"input", mended}};
}

/// Of a patch of the imported mesh.
std::uint64_t patch_bytes(const MeshSize& mesh) {
  const std::uint64_t vertices = std::min(mesh.vertices, ImportPlan::kBrickVertices);
  return MeshStore::block_bytes(vertices, 2 * vertices);
}

MeshPlacement placement(const JobState& state, const SmoothPlan& plan) {
  if (!holds_floats_only(state.output)) return {};
  return store_placement(state.output, plan.mesh(state), plan.tolerance);
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
  t.add("crossings", &o.crossings,
        "refuse: where faces come to cross, overlap or touch others beyond what they share, vertices of both "
        "go back towards where they were, half the way at first; repair: those that do as given are cut out "
        "first and the holes closed anew, and closed bodies that pass through each other or themselves "
        "united; keep: that is not looked at")
      .one_of({"refuse", "repair", "keep"});
  return t;
}

std::vector<StageEntry> smooth_stages(const std::vector<SmoothRound>& rounds, const SmoothPlanner& plan) {
  std::vector<StageEntry> stages;
  stages.push_back({"reach", [=](const JobState& state) { return make_range_stage(state, plan(state)); }});
  const auto append = [&](const std::string& name, std::size_t round, auto make) {
    stages.push_back({name, [=](const JobState& state) {
                        const SmoothPlan now = plan(state);
                        return round > now.rounds.size() ? make_idle_stage(name) : make(state, now, round);
                      }});
  };
  for (std::size_t round = 1; round <= rounds.size(); ++round) {
    if (rounds[round - 1].cycle >= 0) {
      append(coarse_sums_folder(round), round, make_coarse_sums_stage);
      append(coarse_folder(round), round, make_coarse_stage);
    }
    append(smooth_folder(round), round, make_smooth_stage);
  }
  if (!rounds.empty())
    for (StageEntry& entry : untangle_stages(plan)) stages.push_back(std::move(entry));
  return stages;
}

JobDescription smooth_job(const SmoothOptions& options) {
  SmoothPlan plan;
  plan.rounds = smooth_rounds(options);
  plan.tolerance = options.tolerance;
  plan.mesh = [](const JobState& state) { return open_imported_mesh(state.work, kImport); };
  plan.mesh_folder = kImport + "/";
  plan.keep_crossings = options.crossings == "keep";
  JobDescription job{"smooth",  import_stages({0, kImport}),     0,
                     summarise, {carried_crs(), known_origin()}, job_page()};
  const bool repairs = options.crossings == "repair";
  const CrossingPlan input = input_mend(kImport);
  if (repairs) {
    for (StageEntry& entry : crossing_stages(input)) job.stages.push_back(std::move(entry));
    plan.mesh = [=](const JobState& state) { return open_mended(state, input); };
  }
  job.needs = [=, rounds = plan.rounds](const JobState& state) {
    const MeshSize mesh = claimed_mesh_size(state.inputs.at(0));
    std::vector<StageNeed> needs = import_needs(state.run, {0, kImport}, mesh);
    if (repairs)
      for (const StageNeed& need : crossing_needs(input, mesh, ImportPlan::kBrickVertices))
        needs.push_back(need);
    for (const StageNeed& need : smooth_needs(rounds, mesh)) needs.push_back(need);
    needs.push_back(store_write_need(state.run, patch_bytes(mesh), mesh.vertices / ImportPlan::kBrickVertices,
                                     kSortBytes));
    return needs;
  };
  const SmoothPlanner planner = [plan](const JobState& state) {
    SmoothPlan now = plan;
    if (now.tolerance > 0.0 && holds_floats_only(state.output))
      now.tolerance = tolerance_before_rounding(state.output, now.tolerance, placement(state, now));
    return now;
  };
  for (StageEntry& entry : smooth_stages(plan.rounds, planner)) job.stages.push_back(std::move(entry));
  job.stages.push_back(
      {"write", [plan](const JobState& state) {
         // From what is written: the imported mesh is gone.
         MeshStore smoothed = open_untangled(state, plan);
         const MeshPlacement at = holds_floats_only(state.output)
                                      ? store_placement(state.output, smoothed, plan.tolerance)
                                      : MeshPlacement{};
         return make_store_write_stage(state, std::move(smoothed), "made by tessera smooth " + state.settings,
                                       kSortBytes, at);
       }});
  return job;
}

}  // namespace tessera
