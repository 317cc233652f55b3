#include <nlohmann/json.hpp>

#include "octree/error.h"
#include "stream/files/task_files.h"
#include "stream/import/import_stages.h"
#include "stream/meshes/store_write_stage.h"
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

}  // namespace

std::string smooth_settings(const SmoothOptions& o) {
  o.validate();
  return json({{"method", o.method},
               {"weights", o.weights},
               {"steps", o.steps},
               {"lambda", o.lambda},
               {"order", o.order},
               {"degree", o.degree},
               {"tolerance", o.tolerance},
               {"feature-angle", o.feature_angle_deg},
               {"normal-rounds", o.normal_rounds},
               {"vertex-rounds", o.vertex_rounds},
               {"noise", o.noise}})
      .dump();
}

SmoothOptions smooth_options(const std::string& settings) {
  const json j = json::parse(settings);
  SmoothOptions o;
  j.at("method").get_to(o.method);
  j.at("weights").get_to(o.weights);
  j.at("steps").get_to(o.steps);
  j.at("lambda").get_to(o.lambda);
  j.at("order").get_to(o.order);
  j.at("degree").get_to(o.degree);
  j.at("tolerance").get_to(o.tolerance);
  j.at("feature-angle").get_to(o.feature_angle_deg);
  j.at("normal-rounds").get_to(o.normal_rounds);
  j.at("vertex-rounds").get_to(o.vertex_rounds);
  j.at("noise").get_to(o.noise);
  o.validate();
  return o;
}

JobDescription smooth_job(const SmoothOptions& options) {
  const SmoothPlan plan{smooth_rounds(options), options.tolerance};
  JobDescription job{"smooth", import_stages({0, kSmoothImport}), 0, summarise};
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
