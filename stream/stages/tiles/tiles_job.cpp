#include "stream/stages/tiles/tiles_job.h"

#include "octree/error.h"
#include "stream/files/json.h"
#include "stream/import/import_stages.h"
#include "stream/runtime/report.h"
#include "stream/runtime/serial_stage.h"
#include "stream/stages/decimate/certify_stage.h"
#include "stream/stages/decimate/simplify_stage.h"
#include "stream/stages/tiles/cluster_stage.h"
#include "stream/stages/tiles/colour_stage.h"
#include "stream/stages/tiles/folder_stage.h"
#include "stream/stages/tiles/grid_stage.h"
#include "stream/stages/tiles/tile_levels.h"
#include "stream/stages/tiles/tile_points_stage.h"
#include "stream/stages/tiles/tiles_needs.h"
#include "stream/stages/tiles/tiles_stage.h"
#include "stream/stages/tiles/tileset_stage.h"

namespace tessera {
namespace {

/// Passes stay within the tolerance: a bound up to this times it is good enough, up to five quarters of that are told.
constexpr double kReportedScale = 1.04;

/// \param state  with the level's folder as its work directory
bool is_there(const JobState& state, int level) {
  return level_tolerance(state.work.parent_path(), level) > 0.0;
}

/// The same where decimation makes the level.
bool is_decimated(const JobState& state, int level) {
  return is_there(state, level) && !level_is_clustered(state.work.parent_path(), level);
}

SimplifyOptions options_of(const JobState& state, int level) {
  return level_options(level_method(state.work.parent_path(), level));
}

void require_bound(const Json& certificate) {
  if (!certificate.at("certified_max").is_number())
    throw ValidationError("a level is farther from the one below than it may be: please report this");
}

void add_level(std::vector<StageEntry>& stages, const TilesOptions& options, int level) {
  const auto add = [&](const StageEntry& entry, const std::string& result = "",
                       const std::function<void(const Json&)>& check = {}) {
    stages.push_back(stage_in_folder(level_folder(level), entry, result, check));
  };
  if (level > 0) {
    add({"tolerance", [=](const JobState& s) {
           return level == 1 || is_there(s, level - 1)
                      ? make_level_tolerance_stage(s, level, options.tile_faces)
                      : make_idle_stage("tolerance");
         }});
    SimplifyStores stores;
    stores.full = [=](const JobState& s) { return open_level(s.work.parent_path(), level - 1); };
    stores.tolerance_left = [=](const JobState& s) { return level_tolerance(s.work.parent_path(), level); };
    for (int p = 0; p < kLevelPasses; ++p) {
      const SimplifyPass pass{p, 0, false};
      add({pass.stage_name(), [=](const JobState& s) {
             return is_decimated(s, level)
                        ? make_simplify_stage(s, stores.options(s, options_of(s, level)), stores, pass)
                        : make_idle_stage(pass.stage_name());
           }});
    }
    add({"certify",
         [=](const JobState& s) {
           if (!is_decimated(s, level)) return make_idle_stage("certify");
           CertifyRequest request;
           request.name = "certify";
           request.scale = kReportedScale * stores.tolerance_left(s);
           request.tight = false;
           request.mesh = [=](const JobState& now) {
             return open_decimated_level(now.work.parent_path(), level);
           };
           request.reference = stores.full;
           return make_certify_stage(s, request);
         }},
        kLevelCertificate, require_bound);
    add({"colours", [=](const JobState& s) -> std::unique_ptr<Stage> {
           if (!is_decimated(s, level)) return make_idle_stage("colours");
           const std::filesystem::path work = s.work.parent_path();
           MeshStore decimated = open_decimated_level(work, level);
           if (!decimated.info().colour) return make_idle_stage("colours");
           return make_level_colour_stage(std::move(decimated), open_level(work, level - 1),
                                          kReportedScale * level_tolerance(work, level));
         }});
    add({"cluster",
         [=](const JobState& s) {
           return level_is_clustered(s.work.parent_path(), level) ? make_level_cluster_stage(s, level)
                                                                  : make_idle_stage("cluster");
         }},
        kLevelCertificate);
    add({"cluster-certify",
         [=](const JobState& s) {
           if (!level_is_clustered(s.work.parent_path(), level)) return make_idle_stage("cluster-certify");
           CertifyRequest request;
           request.name = "cluster-certify";
           request.scale = level_step_bound(s.work.parent_path(), level);
           request.mesh = [=](const JobState& now) { return open_level(now.work.parent_path(), level); };
           request.reference = stores.full;
           return make_certify_stage(s, request);
         }},
        kClusterCertificate);
  }
  if (options.has_texture() && level > 0)
    add({"texture-points", [=](const JobState& s) {
           return is_there(s, level) ? make_level_points_stage(s, level) : make_idle_stage("texture-points");
         }});
  add({"grid", [=](const JobState& s) {
         return level == 0 || is_there(s, level) ? make_grid_stage(s, options, level)
                                                 : make_idle_stage("grid");
       }});
  add({"finer-grid", [=](const JobState& s) {
         return level == 0 || is_there(s, level) ? make_finer_grid_stage(s, options, level)
                                                 : make_idle_stage("finer-grid");
       }});
  add({"tiles", [=](const JobState& s) {
         return level == 0 || is_there(s, level) ? make_tiles_stage(s, options, level)
                                                 : make_idle_stage("tiles");
       }});
}

void summarise(Json& report) {
  report["input"] = import_report(report, kTilesImport);
  report["tiles"] = result_of(report, "tileset");
}

}  // namespace

JobDescription tiles_job(const TilesOptions& options) {
  std::vector<StageEntry> stages = import_stages({0, kTilesImport});
  stages.front().make = [=, read = stages.front().make](const JobState& state) {
    const TilesDisk disk = tiles_disk(options, claimed_mesh_size(state.inputs.at(0)));
    require_disk(tiles_disk_needs(disk, state.output.parent_path(), state.work), kLargerDisk);
    return read(state);
  };
  if (options.has_texture())
    stages.push_back(
        {"texture-points", [=](const JobState& state) { return make_tile_points_stage(state, options); }});
  for (int level = 0; level <= kMaxLevels; ++level) add_level(stages, options, level);
  stages.push_back({"tileset", [](const JobState& state) { return make_tileset_stage(state); }});
  JobDescription job{"tiles", std::move(stages), 0, summarise, {}, {}};
  job.needs = [options](const JobState& state) {
    const std::filesystem::path& mesh = state.inputs.at(0);
    return tiles_needs(state.run, options, claimed_mesh_size(mesh),
                       options.has_texture() ? size_of_pages(mesh) : PagesSize());
  };
  return job;
}

}  // namespace tessera
