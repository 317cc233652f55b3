#include "stream/stages/reconstruct_job.h"

#include <nlohmann/json.hpp>

#include "stream/stages/closing_stages.h"
#include "stream/stages/decimate_job.h"
#include "stream/stages/distribute_stage.h"
#include "stream/stages/holes_stage.h"
#include "stream/stages/import_stages.h"
#include "stream/stages/loops_stage.h"
#include "stream/stages/normals_stage.h"
#include "stream/stages/order_stage.h"
#include "stream/stages/probe_stage.h"
#include "stream/stages/surface_stage.h"
#include "stream/stages/survey_stage.h"
#include "stream/stages/weld_stage.h"
#include "stream/stages/write_stage.h"

namespace tessera {
namespace {

nlohmann::json result_of(const nlohmann::json& report, const std::string& stage) {
  for (const nlohmann::json& entry : report.at("stages")) {
    if (entry.at("name") == stage) return entry.at("result");
  }
  return nullptr;
}

void summarise(nlohmann::json& report) {
  const nlohmann::json survey = result_of(report, "survey");
  if (survey.is_object() && survey.contains("points")) report["points"] = survey.at("points").at("read");
  nlohmann::json mesh = result_of(report, "weld");
  const nlohmann::json written = result_of(report, "write");
  if (mesh.is_object() && written.is_object()) {
    mesh.update(written);
    const nlohmann::json holes = result_of(report, "holes");
    if (holes.is_object() && holes.value("loops", 0) > 0) mesh["holes"] = holes;
    report["mesh"] = mesh;
  }
  const nlohmann::json raw = result_of(report, "raw");
  if (raw.is_object()) {
    report["raw_mesh"] = {{"vertices", raw.at("vertices")}, {"faces", raw.at("faces")}};
    report["certificate"] = certificate_of(report);
  }
}

}  // namespace

std::vector<StageEntry> reconstruct_stages(double tolerance) {
  std::vector<StageEntry> stages = {
      // in the order in which they run
      {"probe", [](const JobState& state) { return make_probe_stage(state); }},
      {"spacing", [](const JobState& state) { return make_spacing_stage(state); }},
      {"survey", make_survey_stage},
      {"distribute", make_distribute_stage},
      {"order", make_order_stage},
      {"normals", make_normals_stage},
      {"orient", make_orient_stage},
      {"multipole", make_multipole_stage},
      {"rims", make_rims_stage},
      {"close", make_close_stage},
      {"surface", make_surface_stage},
      {"weld", make_weld_stage},
      {"loops", make_loops_stage},
      {"holes", make_holes_stage},
  };
  if (tolerance == 0.0) {
    stages.push_back({"write", make_write_stage});
    return stages;
  }
  stages.push_back({"raw", make_raw_write_stage});
  SimplifyOptions options;
  options.tolerance = tolerance;
  for (StageEntry& entry : import_stages({0, "mesh", kRawMeshFile})) stages.push_back(std::move(entry));
  for (StageEntry& entry : simplify_stages(options, "tessera reconstruct"))
    stages.push_back(std::move(entry));
  return stages;
}

JobDescription reconstruct_job(double tolerance) {
  return {"reconstruct", reconstruct_stages(tolerance), 0, summarise};
}

JobDescription plan_job() {
  JobDescription job = reconstruct_job();
  while (job.stages[job.only_stages++].name != "survey") {
  }
  return job;
}

}  // namespace tessera
