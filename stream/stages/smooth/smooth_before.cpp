#include "stream/stages/smooth/smooth_before.h"

#include <algorithm>
#include <filesystem>

#include "stream/files/durable_file.h"
#include "stream/files/json.h"
#include "stream/runtime/report.h"
#include "stream/stages/plan/planned_scan.h"
#include "stream/stages/smooth/smooth_job.h"
#include "stream/stages/smooth/smooth_needs.h"
#include "stream/stages/smooth/untangle_stages.h"

namespace tessera {
namespace {

/// Of the tolerance, for moves. With three quarters the passes had to keep 10 to 60 % more faces near those that moved
/// far, and the result lay no nearer to the truth.
constexpr double kMoveShare = 0.5;
/// Noise, in edges, from which `auto` takes denoise: below, a plate leaves as little within a hundredth of an edge, and
/// takes a fifteenth of the time.
constexpr double kDenoiseFrom = 0.02;
/// Strength of the plate over the squared noise in edges: of 1, 10, 100 ... this one left least on terrain and fandisk at
/// 0.03, 0.1 and 0.3 spacings of noise (0.004, 0.013 and 0.038 edges in the mesh).
constexpr double kPlateStrength = 7e4;
/// Stronger plates need a coarse level; weaker ones do nothing.
constexpr double kStrongestPlate = 2000.0, kWeakestPlate = 0.1;

/// \param noise  of the given mesh, in edges
SmoothOptions options_of(const std::string& method, double noise) {
  SmoothOptions options;
  options.method = method == "auto" ? (noise >= kDenoiseFrom ? "denoise" : "implicit") : method;
  if (options.method == "implicit") {
    options.order = 2;
    options.lambda = std::clamp(kPlateStrength * noise * noise, kWeakestPlate, kStrongestPlate);
  }
  return options;
}

SmoothOptions options_of(const std::string& method, const MeshNoise& found) {
  return options_of(method, found.edge > 0.0 ? found.noise / found.edge : 0.0);
}

MeshNoise noise_of(const Json& found) {
  return {found.at("noise").get<double>(), found.at("edge").get<double>()};
}

StageEntry noise_entry(const char* name, const std::function<MeshStore(const JobState&)>& mesh) {
  return {name, [=](const JobState& state) { return make_noise_stage(state, name, mesh(state)); }};
}

SmoothPlan plan_of(const JobState& state, const SmoothBefore& before) {
  SmoothPlan plan;
  if (const auto found = measured_noise(state.work))  // else no round is due yet
    plan.rounds = smooth_rounds(options_of(before.method, *found));
  plan.tolerance = kMoveShare * before.tolerance(state);
  plan.mesh = before.mesh;
  plan.bounds = true;
  plan.keep_crossings = before.keep_crossings;
  return plan;
}

}  // namespace

std::vector<SmoothRound> smooth_before_rounds(const std::string& method) {
  // The noisiest mesh takes the most: denoise rather than a plate, or the strongest plate.
  return smooth_rounds(options_of(method, 1.0));
}

std::optional<MeshNoise> measured_noise(const std::filesystem::path& work) {
  if (!std::filesystem::exists(work / kNoiseFile)) return std::nullopt;
  return noise_of(parse_json(read_text(work / kNoiseFile)));
}

std::vector<StageEntry> noise_stages(const std::function<MeshStore(const JobState&)>& mesh) {
  SmoothPlan plan;
  plan.mesh = mesh;
  std::vector<StageEntry> stages = smooth_stages({}, [plan](const JobState&) { return plan; });
  for (const char* name : {kNoiseLook, kNoise}) stages.push_back(noise_entry(name, mesh));
  return stages;
}

std::vector<StageEntry> smooth_before_stages(const SmoothBefore& before) {
  std::vector<StageEntry> stages = smooth_stages(
      smooth_before_rounds(before.method), [=](const JobState& state) { return plan_of(state, before); });
  stages.insert(stages.begin() + 1, noise_entry(kNoise, before.mesh));
  stages.push_back({kNoiseLeft, [=](const JobState& state) {
                      return make_noise_stage(state, kNoiseLeft, open_smoothed_before(state, before));
                    }});
  for (StageEntry& entry : stages)
    entry.forecast = [name = entry.name](const PlannedScan& scan) { return forecast_smoothing(scan, name); };
  return stages;
}

MeshStore open_smoothed_before(const JobState& state, const SmoothBefore& before) {
  return open_untangled(state, plan_of(state, before));
}

Json smoothing_of(const Json& report) {
  const Json before = result_of(report, kNoise), left = result_of(report, kNoiseLeft);
  const std::string method = report.at("options").value("smooth", std::string("off"));
  if (!before.is_object() || method == "off") return nullptr;
  const SmoothOptions used = options_of(method, noise_of(before));
  Json moved = Json::object();
  for (const Json& stage : report.at("stages")) {
    const Json& result = stage.at("result");
    const std::string name = stage.at("name").get<std::string>();
    if (result.empty()) continue;
    if (name.starts_with("smooth-")) moved.update(result);
    if (name.starts_with("untangle")) add_untangling(result, moved);
  }
  Json out = {{"method", used.method},
              {"noise",
               {{"before", before.at("noise")},
                {"after", left.is_object() ? left.at("noise") : Json()},
                {"edge", before.at("edge")},
                {"vertices", before.at("vertices")}}}};
  if (used.lambda > 0.0) out["lambda"] = used.lambda;
  for (const char* name : {"largest_move", "rms_move", "limited"}) out[name] = moved.value(name, Json());
  for (const char* name : {"turned_faces_before", "turned_faces"})
    if (moved.contains(name)) out[name] = moved.at(name);
  return out;
}

}  // namespace tessera
