#include "stream/stages/reconstruct_job.h"

#include <nlohmann/json.hpp>

#include "stream/point_inputs.h"
#include "stream/stages/distribute_stage.h"
#include "stream/stages/normals_stage.h"
#include "stream/stages/order_stage.h"
#include "stream/stages/surface_stage.h"
#include "stream/stages/survey_stage.h"
#include "stream/stages/weld_stage.h"
#include "stream/stages/write_stage.h"

namespace tessera {
namespace {

std::unique_ptr<Stage> make_survey(const JobState& state) {
  return std::make_unique<SurveyStage>(state, open_point_inputs(state), state.options.resolution, false);
}

std::unique_ptr<Stage> make_distribute(const JobState& state) {
  return std::make_unique<DistributeStage>(state, open_point_inputs(state));
}

std::unique_ptr<Stage> make_order(const JobState& state) {
  return std::make_unique<OrderStage>(state);
}

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
    report["mesh"] = mesh;
  }
}

}  // namespace

std::vector<StageEntry> reconstruct_stages() {
  return {{"survey", make_survey},         {"distribute", make_distribute}, {"order", make_order},
          {"normals", make_normals_stage}, {"orient", make_orient_stage},   {"surface", make_surface_stage},
          {"weld", make_weld_stage},       {"write", make_write_stage}};
}

JobDescription reconstruct_job() {
  return {"reconstruct", reconstruct_stages(), 0, summarise};
}

}  // namespace tessera
