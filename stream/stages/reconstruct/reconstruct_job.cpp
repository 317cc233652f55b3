#include "stream/stages/reconstruct/reconstruct_job.h"

#include "kernels/decimate/auto_tolerance.h"
#include "stream/files/json.h"
#include "stream/runtime/report.h"
#include "stream/runtime/serial_stage.h"

#include <algorithm>
#include <iterator>

#include "stream/files/task_files.h"
#include "stream/import/crs_sidecar.h"
#include "stream/meshes/mesh_store_output.h"
#include "stream/meshes/store_write_stage.h"
#include "stream/page/report_page.h"
#include "stream/stages/bake/bake_stages.h"
#include "stream/stages/coverage/coverage_stage.h"
#include "stream/stages/coverage/missing_picture.h"
#include "stream/stages/coverage/seen_stages.h"
#include "stream/stages/decimate/decimate_job.h"
#include "stream/stages/decimate/result_mend.h"
#include "stream/stages/decimate/simplify_needs.h"
#include "stream/stages/levels/level_ends.h"
#include "stream/stages/plan/planned_scan.h"
#include "stream/stages/reconstruct/forecast.h"
#include "stream/stages/reconstruct/forecast_stage.h"
#include "stream/stages/reconstruct/scan_colours.h"
#include "stream/stages/reconstruct/weld_stages.h"
#include "stream/stages/scan/distribute_stage.h"
#include "stream/stages/scan/ground_stages.h"
#include "stream/stages/scan/normals_stage.h"
#include "stream/stages/scan/order_stage.h"
#include "stream/stages/scan/probe_stage.h"
#include "stream/stages/scan/survey_stage.h"
#include "stream/stages/scan/thin_stage.h"
#include "stream/stages/scan/top_stage.h"
#include "stream/stages/scan/uncertain_picture.h"
#include "stream/stages/scan/unpack_stage.h"
#include "stream/stages/smooth/smooth_before.h"
#include "stream/stages/surface/closing_stages.h"
#include "stream/stages/surface/first_pass.h"
#include "stream/stages/surface/islands_stage.h"
#include "stream/stages/surface/level_surface_stage.h"
#include "stream/stages/surface/levels_stage.h"
#include "stream/stages/surface/output_frame.h"
#include "stream/stages/surface/samples_stage.h"
#include "stream/stages/surface/surface_stage.h"
#include "stream/stages/surface/uncross_holes_stage.h"
#include "stream/stages/surface/write_stage.h"

namespace tessera {
namespace {

/// Of the terrain: its cells, and how much of it is a membrane below what stood or was strewn there.
Json ground_figures(Json told, const Json& top) {
  told.erase("needed"), told.erase("warnings");
  const auto columns = top.at("skin_columns").get<double>();
  told["unseen_columns"] = top.at("filled_columns");
  told[columns > 0.0 ? "columns" : "cleared_columns"] =
      top.at(columns > 0.0 ? "skin_columns" : "cleared_columns");
  if (columns > 0.0) told["unseen_share"] = top.at("filled_columns").get<double>() / columns;
  return told;
}

void summarise(Json& report) {
  const Json survey = result_of(report, "survey");
  if (survey.is_object() && survey.contains("points")) report["points"] = survey.at("points").at("read");
  if (survey.is_object() && survey.contains("h"))
    report["resolution"] = {{"h", survey.at("h")}, {"reason", survey.at("resolution_reason")}};
  if (survey.is_object() && survey.contains("coordinate_system"))
    report["coordinate_system"] = survey.at("coordinate_system");
  if (const Json normals = result_of(report, "normals"); normals.is_object() && survey.is_object())
    report["normals"] = {{"from", normals.value("kept", "") == "directions"
                                      ? "given directions, sides found anew"
                                  : normals.value("kept", "") == "given" ? "given, missing ones estimated"
                                  : normals.value("estimated", false)    ? "estimated"
                                  : survey.value("grid_normals", false)  ? "rows and columns of the scans"
                                                                         : "given"}};
  if (const Json ground = result_of(report, "ground"), top = result_of(report, "top");
      ground.is_object() && ground.contains("cell"))
    report["ground"] = ground_figures(ground, top);
  Json mesh = result_of(report, "weld");
  const Json islands = result_of(report, "islands");
  if (const Json samples = result_of(report, "samples"); samples.is_object()) report["samples"] = samples;
  if (const Json points = result_of(report, "points"); points.is_object())
    report["points_to_surface"] = points;
  if (Json coverage = result_of(report, "coverage");
      coverage.is_object() && coverage.value("measured", false)) {
    coverage.erase("measured");
    report["coverage"] = std::move(coverage);
  }
  if (islands.is_object()) {
    mesh = islands;
    mesh.erase("full_faces");
    if (const Json certificate = certificate_of(report); certificate.is_object()) {
      report["raw_mesh"] = {{"faces", islands.at("full_faces")}};
      report["certificate"] = certificate;
    }
  }
  // What rounding in the file may add to the distance of a point.
  if (const Json certificate = certificate_of(report);
      report.contains("samples") && certificate.is_object() && certificate.contains("rounding"))
    report["samples"]["certified_max"] =
        report["samples"]["certified_max"].get<double>() + certificate.at("rounding").get<double>();
  if (const Json colours = kept_colours_of(report); colours.is_object()) report["colours"] = colours;
  summarise_texture(report);
  if (const Json smoothing = smoothing_of(report); smoothing.is_object()) report["smoothing"] = smoothing;
  if (const Json mended = mendings_of(report, kMaxRounds); mended.is_object()) report["crossings"] = mended;
  const Json written = result_of(report, "write");
  if (mesh.is_object() && written.is_object()) {
    mesh.update(written);
    const Json holes = holes_of(report);
    if (holes.is_object() && holes.value("loops", 0) > 0) mesh["holes"] = holes;
    report["mesh"] = mesh;
  }
  if (report.at("options").at("tolerance") == "auto" && survey.is_object() && survey.contains("h")) {
    const double h = survey.at("h").get<double>(), noise = survey.at("noise_cells").get<double>() * h;
    report["tolerance"] = {{"taken", auto_tolerance(h, noise)}, {"h", h}, {"noise", noise}};
  }
  const Json raw = result_of(report, "raw");
  if (raw.is_object()) {
    report["raw_mesh"] = {{"vertices", raw.at("vertices")}, {"faces", raw.at("faces")}};
    report["certificate"] = certificate_of(report);
  }
}

/// What the passes before the forecast take, and of later ones what no scan is too small for.
std::vector<StageNeed> early_needs(const JobState& state) {
  const ReconstructOptions options = reconstruct_options(state);
  if (options.has_texture()) require_colours(state);
  std::uint64_t bytes = 0;
  for (const std::filesystem::path& input : state.inputs) bytes += std::filesystem::file_size(input);
  std::vector<StageNeed> needs = {{"survey", survey_finish_bytes(state.run, bytes), 0}};
  if (options.resolution == 0.0) needs.push_back({"spacing", spacing_bytes(), 0});
  const std::uint64_t sorts = options.decimates() || options.has_levels()
                                  ? write_mesh_store_bytes(0, 0, sort_bytes(state.run))
                                  : write_bytes({}, 0);
  needs.push_back({"write", sorts, 0});
  return needs;
}

StageEntry coverage_of(const std::function<MeshStore(const JobState&)>& store) {
  return {"coverage",
          [=](const JobState& state) {
            return make_coverage_stage(state, [=](const JobState& s) {
              return stored_faces(store(s), Plan::of_work(s.work).lattice);
            });
          },
          forecast_coverage};
}

/// \pre the survey is done
bool fuses_stores(const JobState& state) {
  return reconstruct_options(state).fuses_stores(Plan::of_work(state.work));
}

/// The stages of one of the two ways that the surface of a job may go, which only its survey knows.
/// \param fused  without welding (ReconstructOptions::fuses_stores)
std::vector<StageEntry> stages_if_fused(bool fused, std::vector<StageEntry> stages) {
  for (StageEntry& entry : stages) {
    entry.make = [make = entry.make, name = entry.name, fused](const JobState& state) {
      return fuses_stores(state) == fused ? make(state) : make_idle_stage(name);
    };
    if (entry.forecast)
      entry.forecast = [forecast = entry.forecast, fused](const PlannedScan& scan) {
        return scan.fuses_stores == fused ? forecast(scan) : idle_forecast();
      };
  }
  return stages;
}

MeshStore open_ended_surface(const JobState& state) {
  const StoreFiles found = ended_surface_files(state);
  return MeshStore(found.files, found.newer);
}

/// With levels alone the stores are the result.
std::vector<StageEntry> written_level_stages() {
  CrossingPlan mend;
  mend.may_cut = true;
  mend.mesh = ended_surface_files;
  const auto whole = [=](const JobState& state) { return open_mended(state, mend); };
  std::vector<StageEntry> stages = crossing_stages(mend);
  for (StageEntry& e : stages)
    e.forecast = [name = e.name](const PlannedScan& scan) { return forecast_mend(scan, name); };
  stages.push_back(coverage_of(whole));
  stages.push_back({"write",
                    [=](const JobState& state) {
                      return make_store_write_stage(state, whole(state), "made by tessera reconstruct",
                                                    sort_bytes(state.run));
                    },
                    forecast_write});
  return stages;
}

}  // namespace

std::vector<StageEntry> reconstruct_stages(const ReconstructOptions& options) {
  std::vector<StageEntry> stages = {
      // in the order in which they run
      {"unpack",
       [](const JobState& state) {
         auto inputs = open_packed_inputs(state, false);
         require_points_disk(*inputs, state);
         return make_unpack_stage(state, std::move(inputs));
       }},
      {"thin", [](const JobState& state) { return make_thin_stage(state); }},
      {"probe", [](const JobState& state) { return make_probe_stage(state); }},
      {"spacing", [](const JobState& state) { return make_spacing_stage(state); }},
      {"survey", make_survey_stage},
      {"forecast", make_forecast_stage},
      {"distribute", make_distribute_stage, forecast_distribute},
      {"order", make_order_stage, forecast_order},
      {"seen-spacing", make_seen_spacing_stage, forecast_seen_spacing},
      {"seen", make_seen_stage, forecast_seen},
      {"normals", make_normals_stage, forecast_normals},
      {"links", make_links_stage, forecast_links},
      {"orient", make_orient_stage, forecast_orient},
      {"top", make_top_stage, forecast_top},
      {"top-points", make_top_points_stage, forecast_top_points},
      {"multipole", make_multipole_stage, forecast_multipole},
      {"rims", make_boundaries_stage, forecast_boundaries},
      {"close", make_close_stage, forecast_close},
  };
  if (options.finds_ground()) {
    const auto top =
        std::find_if(stages.begin(), stages.end(), [](const StageEntry& e) { return e.name == "top"; });
    stages.insert(top, {{"ground-cells", make_ground_cells_stage, forecast_ground_cells},
                        {"ground", make_ground_stage, forecast_ground}});
  }
  if (options.has_levels()) {
    stages.push_back({"levels", make_levels_stage});
    stages.push_back({"surface", make_level_surface_stage, forecast_level_surface});
  } else {
    stages.push_back({"surface", make_surface_stage, forecast_surface});
  }
  const auto append = [&](std::vector<StageEntry> more) {
    std::move(more.begin(), more.end(), std::back_inserter(stages));
  };
  const auto finish = [&](SimplifyStores stores) {
    stores.placed = [](const JobState& state) { return plan_placement(state, Plan::of_work(state.work)); };
    stores.colours = colours_of_job;
    const SimplifyOptions simplify = reconstruct_simplify_options(options);
    append(simplify_stages(simplify, stores, "tessera reconstruct"));
    const auto result = [=](const JobState& s) {
      return open_round_result(s, simplify.passes, last_round(s.work));
    };
    // The last stage ends the job.
    if (options.reference == "points")
      stages.insert(stages.end() - 1,
                    {"samples",
                     [=](const JobState& state) {
                       return make_samples_stage(state, {reconstruct_tolerance(state), result, false});
                     },
                     [](const PlannedScan& scan) { return forecast_samples(scan, false); }});
    stages.insert(stages.end() - 1, coverage_of(result));
    if (options.keep_raw)
      stages.insert(stages.end() - 1, {"keep-raw",
                                       [=](const JobState& state) {
                                         return make_keep_raw_stage(state, stores.full(state),
                                                                    "made by tessera reconstruct",
                                                                    sort_bytes(state.run));
                                       },
                                       forecast_store_write});
  };
  const bool fuses = options.may_fuse_stores(), welds = options.may_weld();
  if (options.has_levels()) {
    append(store_end_stages(options));
    append(level_end_stages(options));
    if (!options.decimates()) {
      append(written_level_stages());
      return stages;
    }
    if (options.reference == "points") append({points_stage(open_ended_surface)});
  } else if (fuses) {
    append(welds ? stages_if_fused(true, store_end_stages(options)) : store_end_stages(options));
  }
  if (welds) append(fuses ? stages_if_fused(false, weld_stages(options)) : weld_stages(options));
  if (!options.decimates()) {
    append({{"coverage", [](const JobState& state) { return make_coverage_stage(state, welded_faces); },
             forecast_coverage},
            {"write", make_write_stage, forecast_write}});
    return stages;
  }
  SimplifyStores stores = welded_stores();
  stores.tolerance_left = reconstruct_tolerance;
  if (fuses) {
    stores.full = [welded = stores.full](const JobState& state) {
      return fuses_stores(state) ? open_ended_surface(state) : welded(state);
    };
  }
  if (options.fuses_first_pass()) {
    stores.after_first = open_first_pass;
    stores.first_blocks = first_pass_blocks;
    if (welds) stores.first_done = fuses_stores;
  }
  if (options.reference == "points")
    stores.tolerance_left = [](const JobState& state) { return tolerance_left(state.work); };
  finish(stores);
  return stages;
}

JobDescription reconstruct_job(const ReconstructOptions& options) {
  HolesMode{options.holes};  // a word that makes no sense is told before any pass
  JobDescription job = {"reconstruct", reconstruct_stages(options), 0, summarise};
  job.page = job_page();
  job.needs = early_needs;
  if (options.normals != "given") {
    job.sidecars.push_back({uncertain_picture_path, "the picture of --normals"});
    job.sidecars.push_back({uncertain_points_path, "the doubts of --normals"});
  }
  job.sidecars.push_back({missing_picture_path, "the picture of what is missing"});
  job.sidecars.push_back(found_crs());
  job.sidecars.push_back(known_origin());
  add_texture_sidecars(job, BakeOptions(), options.has_texture());
  if (options.keep_raw) {
    job.sidecars.push_back({raw_output_path, "--keep-raw", true});
    const auto path = [](const std::filesystem::path& out) { return stl_shift_path(raw_output_path(out)); };
    job.sidecars.push_back({path, "the origin beside --keep-raw", false,
                            [](const Json& report) { return origin_text(result_of(report, "keep-raw")); }});
  }
  return job;
}

JobDescription plan_job() {
  JobDescription job = reconstruct_job();
  while (job.stages[job.only_stages++].name != "forecast") continue;
  return job;
}

}  // namespace tessera
