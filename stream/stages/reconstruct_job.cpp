#include "stream/stages/reconstruct_job.h"

#include <nlohmann/json.hpp>

#include "stream/stages/closing_stages.h"
#include "stream/stages/distribute_stage.h"
#include "stream/stages/holes_stage.h"
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
}

}  // namespace

std::vector<StageEntry> reconstruct_stages() {
  return {
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
      {"write", make_write_stage},
  };
}

JobDescription reconstruct_job() {
  return {"reconstruct", reconstruct_stages(), 0, summarise};
}

JobDescription plan_job() {
  JobDescription job = reconstruct_job();
  while (job.stages[job.only_stages++].name != "survey") {
  }
  return job;
}

}  // namespace tessera
