#include "stream/stages/decimate/decimate_job.h"

#include <algorithm>

#include "kernels/decimate/auto_tolerance.h"
#include "octree/error.h"
#include "stream/files/json.h"
#include "stream/import/crs_sidecar.h"
#include "stream/import/import_needs.h"
#include "stream/import/import_stages.h"
#include "stream/meshes/store_write_stage.h"
#include "stream/page/report_page.h"
#include "stream/runtime/report.h"
#include "stream/runtime/serial_stage.h"
#include "stream/stages/bake/bake_needs.h"
#include "stream/stages/bake/bake_stages.h"
#include "stream/stages/bake/texture_colours.h"
#include "stream/stages/decimate/certify_stage.h"
#include "stream/stages/decimate/result_mend.h"
#include "stream/stages/decimate/simplify_needs.h"
#include "stream/stages/plan/planned_scan.h"
#include "stream/stages/smooth/smooth_before.h"
#include "stream/stages/smooth/smooth_needs.h"

namespace tessera {
namespace {

const std::string kDecimateImport = "mesh";

std::string certify_name(int round) {
  return round == 0 ? "certify" : "again-" + std::to_string(round) + "-certify";
}

StageEntry simplify_entry(const SimplifyOptions& options, const SimplifyStores& stores,
                          const SimplifyPass& pass) {
  StageEntry entry = {pass.stage_name(), [=](const JobState& state) {
                        return make_simplify_stage(state, stores.options(state, options), stores, pass);
                      }};
  if (pass.round == 0)  // later ones have something to do only where the proof fails
    entry.forecast = [=, elsewhere = pass.pass == 0 && stores.after_first](const PlannedScan& scan) {
      return elsewhere && scan.fuses_stores ? idle_forecast() : forecast_simplify(scan, options, pass.pass);
    };
  return entry;
}

/// The stores of the passes once the mesh is smoothed.
SimplifyStores after(const SmoothBefore& smoothing, SimplifyStores stores) {
  stores.given = stores.full;
  stores.full = [=](const JobState& state) { return open_smoothed_before(state, smoothing); };
  return stores;
}

std::string made_with(const std::string& made_by, double tolerance) {
  return "made by " + made_by + ", tolerance " + dump_json(Json(tolerance));
}

/// The result with textures, in place of what writes it.
std::vector<StageEntry> texture_stages(const SimplifyOptions& options, const SimplifyStores& stores,
                                       const std::string& made_by) {
  BakeStores bake;
  bake.mesh = [=](const JobState& s) { return open_round_result(s, options.passes, last_round(s.work)); };
  bake.colours = [=](const JobState& s) {
    std::unique_ptr<BakeColours> colours = stores.colours(s);
    if (!options.normal_map || colours->has_normals()) return colours;
    return with_directions(std::move(colours), stores.full(s));
  };
  bake.comment = [=](const JobState& s) {
    return made_with(made_by, stores.requested(s, options).tolerance);
  };
  bake.placement = [=](const JobState& s) {
    return stores.placement(s, stores.requested(s, options).tolerance);
  };
  std::vector<StageEntry> stages =
      bake_stages(BakeOptions::of_texture(options.texture, options.normal_map), bake);
  for (StageEntry& entry : stages)
    entry.forecast = [name = entry.name, texel = options.texture,
                      normals = options.normal_map](const PlannedScan& scan) {
      return name == "write" ? forecast_store_write(scan) : forecast_texture(scan, name, texel, normals);
    };
  return stages;
}

void summarise(Json& report) {
  report["input"] = import_report(report, kDecimateImport);
  report["mesh"] = result_of(report, "write");
  if (const Json noise = result_of(report, "noise");
      report.at("options").at("tolerance") == "auto" && noise.is_object()) {
    const double edge = noise.at("edge").get<double>(), deviation = noise.at("noise").get<double>();
    report["tolerance"] = {{"taken", auto_tolerance(edge, deviation)}, {"edge", edge}, {"noise", deviation}};
  }
  report["certificate"] = certificate_of(report);
  if (const Json colours = kept_colours_of(report); colours.is_object()) report["colours"] = colours;
  summarise_texture(report);
  if (const Json smoothing = smoothing_of(report); smoothing.is_object()) report["smoothing"] = smoothing;
  if (const Json mended = mendings_of(report, kMaxRounds); mended.is_object()) report["crossings"] = mended;
}

}  // namespace

Json certificate_of(const Json& report) {
  Json last = result_of(report, certify_name(0));
  for (int round = 1; round < kMaxRounds; ++round) {
    const Json again = result_of(report, certify_name(round));
    if (!again.is_object()) continue;
    last = again;
    last["rounds_again"] = round;
  }
  return last;
}

Json kept_colours_of(const Json& report) {
  double tolerance = 0.0;
  std::uint64_t kept = 0;
  const auto add = [&](const Json& pass) {
    if (!pass.contains("kept_for_colour")) return;
    tolerance = std::max(tolerance, pass.at("colour_tolerance").get<double>());
    // Later passes meet the same ones again.
    kept = std::max(kept, pass.at("kept_for_colour").get<std::uint64_t>());
  };
  for (const Json& stage : report.at("stages")) {
    const Json& result = stage.at("result");
    if (!result.is_object()) continue;
    add(result);
    if (result.contains("first_pass")) add(result.at("first_pass"));
  }
  return tolerance > 0.0 ? Json{{"tolerance_max", tolerance}, {"vertices_kept", kept}} : Json(nullptr);
}

std::vector<StageEntry> simplify_stages(const SimplifyOptions& options, SimplifyStores stores,
                                        const std::string& made_by) {
  std::vector<StageEntry> stages;
  if (options.tolerance == kAutoTolerance && !stores.tolerance_left) {
    if (!options.smooths()) stages = noise_stages(stores.full);
    stores.tolerance_left = [](const JobState& state) {
      const auto found = measured_noise(state.work);  // nothing before who asks needs it
      return found ? auto_tolerance(found->edge, found->noise) : 0.0;
    };
  }
  if (options.smooths()) {
    const SmoothBefore smoothing = {
        options.smooth, stores.full,
        [=](const JobState& state) { return stores.options(state, options).tolerance; },
        options.crossings == "keep"};
    stages = smooth_before_stages(smoothing);
    stores = after(smoothing, stores);
  }
  const bool own = options.reference == "surface";
  // Against a reference of its own a mesh may fail for good; another round helps where the passes were too bold.
  const int rounds = own && options.tolerance != 0.0 ? kMaxRounds : 1;
  for (int round = 0; round < rounds; ++round) {
    for (int p = round == 0 && stores.after_first && !stores.first_done ? 1 : 0; p < options.passes; ++p) {
      if (options.target_faces > 0 && round == 0)
        stages.push_back(simplify_entry(options, stores, {p, round, true}));
      stages.push_back(simplify_entry(options, stores, {p, round, false}));
    }
    if (options.crossings != "keep") {
      const auto tolerance = [=](const JobState& s) { return stores.requested(s, options).tolerance; };
      for (StageEntry& entry :
           crossing_stages(result_mend(stores, tolerance, options.passes, round, rounds))) {
        if (round == 0)
          entry.forecast = [name = entry.name](const PlannedScan& scan) { return forecast_mend(scan, name); };
        stages.push_back(std::move(entry));
      }
    }
    if (!own)
      for (StageEntry& entry : import_stages({1, "reference"})) stages.push_back(std::move(entry));
    CertifyRequest request;
    request.name = certify_name(round);
    request.tolerance = options.tolerance;
    request.mesh = [=](const JobState& s) { return open_round_result(s, options.passes, round); };
    request.reference = [=](const JobState& s) {
      return own ? stores.reference(s) : open_imported_mesh(s.work, "reference");
    };
    if (round + 1 < rounds) request.failed_file = failed_faces_file(round);
    if (options.crossings != "keep") request.crossing_file = left_faces_file(round);
    if (round > 0) {
      request.name_before = certify_name(round - 1);
      request.mesh_before = [=](const JobState& s) {
        return open_round_result(s, options.passes, round - 1);
      };
    }
    stages.push_back({request.name, [=](const JobState& state) {
                        if (round > last_round(state.work)) return make_idle_stage(request.name);
                        CertifyRequest now = request;
                        now.tolerance = stores.options(state, options).tolerance;
                        now.placement = stores.placement(state, stores.requested(state, options).tolerance);
                        return make_certify_stage(state, now);
                      }});
    if (round == 0) stages.back().forecast = forecast_certify;
  }
  if (options.has_texture()) {
    for (StageEntry& entry : texture_stages(options, stores, made_by)) stages.push_back(std::move(entry));
    return stages;
  }
  stages.push_back({"write",
                    [=](const JobState& state) {
                      const double tolerance = stores.requested(state, options).tolerance;
                      return make_store_write_stage(
                          state, open_round_result(state, options.passes, last_round(state.work)),
                          made_with(made_by, tolerance), sort_bytes(state.run),
                          stores.placement(state, tolerance));
                    },
                    forecast_store_write});
  return stages;
}

SimplifyStores imported_stores(const std::string& folder) {
  return {[=](const JobState& state) { return open_imported_mesh(state.work, folder); }, nullptr, nullptr};
}

JobDescription decimate_job(const SimplifyOptions& options) {
  std::vector<StageEntry> stages = import_stages({0, kDecimateImport});
  const bool repairs = options.crossings == "repair";
  const CrossingPlan input = input_mend(kDecimateImport);
  if (repairs)
    for (StageEntry& entry : crossing_stages(input)) stages.push_back(std::move(entry));
  SimplifyStores stores = repairs ? mended_stores(input) : imported_stores(kDecimateImport);
  stores.colours = [given = stores.full, colourless = options.normal_map](const JobState& s) {
    return has_textures(s.inputs.at(0)) ? colours_of_textures(s.inputs.at(0), s)
                                        : colours_of_store(given(s), colourless);
  };
  for (StageEntry& entry : simplify_stages(options, stores, "tessera decimate"))
    stages.push_back(std::move(entry));
  JobDescription job = {"decimate", std::move(stages), 0, summarise, {carried_crs(), known_origin()},
                        job_page()};
  add_texture_sidecars(job, BakeOptions(), options.has_texture());
  job.needs = [=](const JobState& state) {
    const MeshSize mesh = claimed_mesh_size(state.inputs.at(0));
    std::vector<StageNeed> needs = import_needs(state.run, {0, kDecimateImport}, mesh);
    const auto append = [&](const std::vector<StageNeed>& more) {
      needs.insert(needs.end(), more.begin(), more.end());
    };
    if (options.smooths()) {
      append(smooth_before_needs(options.smooth, mesh));
    } else if (options.tolerance == kAutoTolerance) {
      append(noise_needs(mesh));
    }
    if (repairs) append(crossing_needs(input, mesh, ImportPlan::kBrickVertices));
    append(simplify_needs(state.run, options, mesh.faces));
    // How few faces are left is not known.
    if (options.has_texture())
      append(bake_needs(state.run, BakeOptions().page_size, 0, ImportPlan::kBrickVertices));
    if (state.inputs.size() > 1)
      append(import_needs(state.run, {1, "reference"}, claimed_mesh_size(state.inputs[1])));
    return needs;
  };
  return job;
}

}  // namespace tessera
