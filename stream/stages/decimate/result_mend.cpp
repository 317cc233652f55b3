#include "stream/stages/decimate/result_mend.h"

#include <algorithm>
#include <utility>

#include "stream/files/task_files.h"
#include "stream/stages/crossings/crossing_parts.h"
#include "stream/stages/plan/forecast_rates.h"
#include "stream/stages/plan/planned_scan.h"

namespace tessera {
namespace {

constexpr double kMendFaceTime = 0.2;  ///< microseconds a face of the mesh before decimation

std::string round_prefix(int round) {
  return round == 0 ? std::string() : "again-" + std::to_string(round) + "-";
}

StoreFiles round_files(const JobState& state, int passes, int round) {
  return {list_task_files(state.work / SimplifyPass{passes - 1, round, false}.folder(), ".tmm")};
}

}  // namespace

CrossingPlan result_mend(const SimplifyStores& stores,
                         const std::function<double(const JobState&)>& tolerance, int passes, int round,
                         int rounds) {
  CrossingPlan plan;
  plan.prefix = round_prefix(round);
  plan.mesh = [=](const JobState& state) { return round_files(state, passes, round); };
  // A job that knows where its output lies before there is a mesh makes it itself: all pairs are its own.
  if (!stores.placed) {
    plan.given = [=](const JobState& state) {
      std::vector<MeshStore> given;
      given.push_back(stores.full(state));
      return given;
    };
    plan.given_margin = tolerance;
  }
  // What is cut off at a border is farther than a tolerance as a rule: the rounds would come back with more faces and the pair.
  plan.may_cut = rounds == 1;
  plan.gentle = round > 0;  // what was taken out in an earlier round may have been filled too far away
  plan.final = round + 1 == rounds;
  plan.hands_on = !plan.final;
  plan.tells_only = plan.final && rounds > 1;
  plan.due = [=](const JobState& state) { return round <= last_round(state.work); };
  plan.placed = [=](const JobState& state) { return stores.placement(state, tolerance(state)); };
  return plan;
}

MeshStore open_round_result(const JobState& state, int passes, int round) {
  CrossingPlan plan;
  plan.prefix = round_prefix(round);
  plan.mesh = [=](const JobState& s) { return round_files(s, passes, round); };
  return open_mended(state, plan);
}

std::string left_faces_file(int round) {
  CrossingPlan plan;
  plan.prefix = round_prefix(round);
  return crossing_mend_name(plan) + "/" + kLeftFacesFile;
}

SimplifyStores mended_stores(const CrossingPlan& plan) {
  return {[=](const JobState& state) { return open_mended(state, plan); }, nullptr, nullptr};
}

StageForecast forecast_mend(const PlannedScan& scan, const std::string& stage) {
  StageForecast forecast;
  if (!stage.ends_with("crossings")) {
    forecast.sure_bytes = forecast.finish_bytes = crossing_mend_stage_bytes(0, 0);
    forecast.files = 1;
    return forecast;
  }
  forecast.sure_bytes = crossing_tile_bytes(0, 0);
  forecast.task_bytes = crossing_search_bytes(scan.run, bytes_of(scan.faces, rates::kFacesMargin));
  forecast.tasks = forecast.files = scan.groups.size() / 4 + 1;
  forecast.processor_us = scan.faces * kMendFaceTime;
  forecast.moved_bytes = 0.1 * static_cast<double>(scan.surface_bytes);
  return forecast;
}

Json mendings_of(const Json& report, int rounds) {
  Json out = Json::object();
  if (Json input = mending_of(report, kInputMendPrefix); input.is_object()) out["input"] = std::move(input);
  for (int round = 0; round < rounds; ++round)
    if (Json result = mending_of(report, round_prefix(round)); result.is_object())
      out["result"] = std::move(result);
  return out.empty() ? Json() : out;
}

}  // namespace tessera
