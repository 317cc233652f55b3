#include "stream/stages/remesh/remesh_job.h"

#include <algorithm>
#include <string>

#include "stream/files/json.h"
#include "stream/import/import_needs.h"
#include "stream/import/import_stages.h"
#include "stream/meshes/store_write_stage.h"
#include "stream/page/report_page.h"
#include "stream/runtime/report.h"
#include "stream/runtime/serial_stage.h"
#include "stream/stages/decimate/certify_stage.h"
#include "stream/stages/decimate/decimate_job.h"
#include "stream/stages/decimate/result_mend.h"
#include "stream/stages/decimate/simplify_needs.h"
#include "stream/stages/remesh/remesh_stage.h"
#include "stream/stages/remesh/sizing_stage.h"

namespace tessera {
namespace {

constexpr const char* kRemeshImport = "mesh";
/// Blocks of four bricks an axis or more, so that no two of the three passes have a seam in common (mesh_blocking.h).
constexpr std::uint64_t kBlockBricks = 16;
constexpr double kMeasuredShare = 0.25;  ///< of the edges: the scale of a distance that is only measured

ImportSource remesh_source(const RemeshJobOptions& options) {
  ImportSource source{0, kRemeshImport};
  source.brick_vertices =
      std::clamp<std::uint64_t>(options.block_faces / (2 * kBlockBricks), 100, ImportPlan::kBrickVertices);
  return source;
}

std::string certify_name(int round) {
  return round == 0 ? "certify" : "again-" + std::to_string(round) + "-certify";
}

/// What became of the faces below the smallest angle that is asked for: before in the first round, left in the last one.
Json small_angles(const RemeshJobOptions& options, const Json& stages) {
  Json out = {{"asked_deg", options.min_angle_deg}};
  const std::string first = SimplifyPass{options.passes, 0, false}.stage_name();
  for (const Json& stage : stages) {
    const Json& r = stage.at("result");
    if (!r.is_object()) continue;
    const auto count = [&](const char* key) { return r.value(key, std::uint64_t{0}); };
    if (stage.at("name") == first)
      out.update({{"faces_before", count("faces_in")}, {"below_before", count("sharp_in")}});
    // Passes that even lengths may come behind those that raise angles.
    if (r.contains("sharp_in"))
      out.update({{"held", count("sharp_held")}, {"at_tolerance", count("sharp_by_tolerance")}});
    if (r.contains("sharp_left"))
      out.update({{"faces", count("faces_out")},
                  {"below", count("sharp_left")},
                  {"between_lines", count("sharp_between_lines")}});
  }
  return out;
}

/// What became of edges between vertices whose mean edges differ by more than they may where lengths adapt: before in the
/// first round, left in the last one.
Json length_ratios(const RemeshJobOptions& options, const Json& stages) {
  Json out = {{"asked", RemeshJobOptions::kMaxLengthRatio}};
  const std::string first = SimplifyPass{options.first_even_pass(), 0, false}.stage_name();
  for (const Json& stage : stages) {
    const Json& r = stage.at("result");
    if (!r.is_object()) continue;
    const auto count = [&](const char* key) { return r.value(key, std::uint64_t{0}); };
    if (stage.at("name") == first) out["beyond_before"] = count("uneven_in");
    if (!r.contains("uneven_left")) continue;
    out.update({{"edges", count("edges_seen")},
                {"beyond", count("uneven_left")},
                {"held", count("uneven_held")},
                {"at_lines", count("uneven_at_lines")},
                {"at_tolerance", count("uneven_by_tolerance")}});
  }
  return out;
}

/// The shape of the last pass that ran, the input, what was written, the proof.
void summarise(const RemeshJobOptions& options, Json& report) {
  report["input"] = import_report(report, kRemeshImport);
  report["mesh"] = result_of(report, "write");
  report["certificate"] = certificate_of(report);
  if (const Json mended = mendings_of(report, kMaxRounds); mended.is_object()) report["crossings"] = mended;
  for (const Json& stage : report.at("stages"))
    if (stage.at("result").is_object() && stage.at("result").contains("quality"))
      report["quality"] = stage.at("result").at("quality");
  if (options.adaptive) report["length_ratios"] = length_ratios(options, report.at("stages"));
  if (options.min_angle_deg > 0.0) report["small_angles"] = small_angles(options, report.at("stages"));
}

MeshPlacement placement(const JobState& state, const RemeshJobOptions& options) {
  if (!holds_floats_only(state.output)) return {};
  return store_placement(state.output, open_imported_mesh(state.work, kRemeshImport), options.tolerance);
}
/// With what rounding in the output leaves of the tolerance.
RemeshJobOptions before_rounding(const JobState& state, RemeshJobOptions options) {
  if (options.tolerance > 0.0)
    options.tolerance = tolerance_before_rounding(state.output, options.tolerance, placement(state, options));
  return options;
}

/// How long edges were in the end.
Sizing last_sizing(const JobState& state) {
  return Sizing::of_work(state.work, last_remesh_round(state.work));
}

/// Where a round left faces that cross the next one keeps away from them, whether there is a tolerance to prove or not.
CrossingPlan mend_of_round(const RemeshJobOptions& options, const SimplifyStores& stores, int round) {
  const auto margin = [=](const JobState& state) {
    return options.tolerance > 0.0 ? options.tolerance : kMeasuredShare * last_sizing(state).edge;
  };
  CrossingPlan mend = result_mend(stores, margin, options.all_passes(), round, kMaxRounds);
  mend.strict = options.crossings == "repair";
  if (options.tolerance > 0.0) return mend;
  mend.may_cut = true;
  mend.tells_only = false;
  mend.due = [=](const JobState& state) {
    return round <= last_remesh_round(state.work) && !was_too_fine(state.work, round);
  };
  return mend;
}

StageEntry certify_entry(const RemeshJobOptions& options, const SimplifyStores& stores, int round,
                         bool last) {
  CertifyRequest request;
  request.name = certify_name(round);
  request.tolerance = options.tolerance;
  request.mesh = [=](const JobState& s) { return open_round_result(s, options.all_passes(), round); };
  request.reference = stores.full;
  const bool proves = options.tolerance > 0.0;
  if (!last) request.failed_file = failed_faces_file(round);
  request.crossing_file = left_faces_file(round);
  if (round > 0 && proves) {
    request.name_before = certify_name(round - 1);
    request.mesh_before = [=](const JobState& s) {
      return open_round_result(s, options.all_passes(), round - 1);
    };
  }
  return {request.name, [=](const JobState& state) {
            if (round > last_remesh_round(state.work) || was_too_fine(state.work, round))
              return make_idle_stage(request.name);
            CertifyRequest now = request;
            now.tolerance = before_rounding(state, options).tolerance;
            now.placement = placement(state, options);
            now.scale = kMeasuredShare * last_sizing(state).edge;
            return make_certify_stage(state, now);
          }};
}

}  // namespace

JobDescription remesh_job(const RemeshJobOptions& options) {
  options.validate();
  std::vector<StageEntry> stages = import_stages(remesh_source(options));
  stages.push_back({"sizing", [=](const JobState& state) {
                      return make_sizing_stage(state, before_rounding(state, options));
                    }});
  const bool repairs = options.crossings == "repair";
  const CrossingPlan input = input_mend(kRemeshImport);
  if (repairs)
    for (StageEntry& entry : crossing_stages(input)) stages.push_back(std::move(entry));
  const SimplifyStores stores = repairs ? mended_stores(input) : imported_stores(kRemeshImport);
  for (int round = 0; round < kMaxRounds; ++round) {
    for (int p = 0; p < options.all_passes(); ++p) {
      const SimplifyPass pass{p, round, false};
      stages.push_back({pass.stage_name(), [=](const JobState& state) {
                          return make_remesh_stage(state, before_rounding(state, options), stores, pass);
                        }});
    }
    for (StageEntry& entry : crossing_stages(mend_of_round(options, stores, round)))
      stages.push_back(std::move(entry));
    stages.push_back(certify_entry(options, stores, round, round + 1 == kMaxRounds));
  }
  stages.push_back({"write", [=](const JobState& state) {
                      return make_store_write_stage(
                          state,
                          open_round_result(state, options.all_passes(), last_remesh_round(state.work)),
                          "made by tessera remesh, edges of " + dump_json(Json(last_sizing(state).edge)),
                          sort_bytes(state.run), placement(state, options));
                    }});
  JobDescription job = {
      "remesh",         std::move(stages), 0, [=](Json& report) { summarise(options, report); },
      {known_origin()}, job_page()};
  job.needs = [=](const JobState& state) {
    const MeshSize mesh = claimed_mesh_size(state.inputs.at(0));
    std::vector<StageNeed> needs = import_needs(state.run, remesh_source(options), mesh);
    if (repairs)
      for (const StageNeed& need : crossing_needs(input, mesh, remesh_source(options).brick_vertices))
        needs.push_back(need);
    for (int p = 0; p < options.all_passes(); ++p)
      needs.push_back({SimplifyPass{p, 0, false}.stage_name(), remesh_pass_bytes(options, mesh.faces, 1, p),
                       remesh_pass_bytes(options, mesh.faces, 2 * kMaxAround, p)});
    // What comes out is decimated no further.
    for (const StageNeed& need : proof_needs(state.run, mesh.faces, std::max(mesh.faces, options.faces),
                                             remesh_source(options).brick_vertices))
      needs.push_back(need);
    return needs;
  };
  return job;
}

}  // namespace tessera
