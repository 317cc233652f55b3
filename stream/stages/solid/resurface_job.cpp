#include "stream/stages/solid/resurface_job.h"

#include <numeric>

#include "stream/files/json.h"
#include "stream/import/import_stages.h"
#include "stream/meshes/store_write_stage.h"
#include "stream/page/report_page.h"
#include "stream/runtime/report.h"
#include "stream/stages/solid/solid_needs.h"
#include "stream/stages/solid/solid_stages.h"
#include "stream/stages/surface/output_frame.h"
#include "stream/stages/surface/write_stage.h"
#include "stream/stages/weld/uncross_stage.h"
#include "stream/stages/weld/weld_stage.h"

namespace tessera {
namespace {

constexpr std::uint64_t kCrumbFaces = 100;  ///< islands below are thinner than 3 h: a cube of 3 h has 108

}  // namespace

void add_surface_options(OptionTable& table, SolidSurfaceOptions& options) {
  table
      .add("resolution,voxel", &options.resolution,
           "lattice spacing h, units of the solids: what is thinner may go, sharp edges stay sharp whatever "
           "it "
           "is; 0 = a 300th of the diagonal")
      .at_least(0);
  table
      .add("method", &options.method,
           "emc: extended marching cubes with sharp edges and corners; mc: plain marching cubes")
      .one_of({"emc", "mc"});
  table
      .add("feature-angle", &options.feature_angle_deg,
           "degrees between normals from which a cell holds a sharp edge")
      .within(0, 180);
  table.add("min-component", &options.min_component,
            "faces; smaller islands are dropped and counted: crumbs come off where surfaces run out into a "
            "wedge thinner than "
            "h; 0 = 100, which a cube of 3 h has, and the largest stays; 1 = keep all. Where more than 100 "
            "islands have fewer than 100 faces each and none has more, what is enclosed is thinner than h: "
            "exit code 5");
  table.add("offset", &options.offset,
            "units of the solids: the surface moves so far outwards, below 0 inwards; edges turned outwards "
            "come out as --corners says, grooves sharp, and the other way round inwards");
  table
      .add("corners", &options.corners,
           "what an offset makes of edges and corners that it turns outwards: round, or mitre: they stay "
           "sharp, as their faces "
           "go on until they meet")
      .one_of({"round", "mitre"});
  table
      .add("mitre-limit", &options.mitre_limit,
           "with --corners mitre: no tip lies farther from the surface than so many offsets (2: edges down "
           "to 60 degrees), "
           "there it is cut off round")
      .within(1, 10);
  table
      .add("shell", &options.shell,
           "units of the solids, at least 2 h: thickness of a wall below the surface, what lies deeper is "
           "hollow; 0 = solid")
      .at_least(0);
}

void apply(const SolidSurfaceOptions& options, SolidModel& model) {
  model.resolution = options.resolution;
  model.extract.method =
      options.method == "mc" ? ExtractMethod::kMarchingCubes : ExtractMethod::kExtendedMarchingCubes;
  model.extract.feature_angle_deg = options.feature_angle_deg;
  model.offset = options.offset;
  model.mitre = options.corners == "mitre" ? options.mitre_limit : 1.0;
  model.shell = options.shell;
}

OptionTable option_table(ResurfaceOptions& o) {
  OptionTable t("What it computes");
  add_surface_options(t, o);
  t.add("meshes", &o.meshes, "how many meshes there are").hidden();
  return t;
}

void summarise_solids(Json& report) {
  if (const Json lattice = result_of(report, "lattice"); lattice.is_object())
    report["resolution"] = {{"h", lattice.at("h")}, {"reason", lattice.at("resolution_reason")}};
  if (const Json lines = result_of(report, "lines"); lines.is_object()) report["solids"] = lines;
  Json mesh = result_of(report, "weld");
  const Json written = result_of(report, "write");
  if (mesh.is_object() && written.is_object()) {
    mesh.update(written);
    report["mesh"] = mesh;
  }
}

std::vector<StageEntry> solid_surface_stages(const SolidModel& model) {
  std::vector<StageEntry> stages;
  for (std::size_t i = 0; i < model.inputs(); ++i)
    for (StageEntry& entry : import_stages({i, solid_import(i)})) stages.push_back(std::move(entry));
  stages.push_back({"lattice", [model](const JobState& s) { return make_solid_lattice_stage(s, model); }});
  stages.push_back({"lines", [model](const JobState& s) { return make_solid_lines_stage(s, model); }});
  stages.push_back({"inside", [model](const JobState& s) { return make_solid_inside_stage(s, model); }});
  stages.push_back({"surface", [model](const JobState& s) { return make_solid_surface_stage(s, model); }});
  return stages;
}

std::vector<StageEntry> solid_stages(const SolidModel& model, std::uint64_t min_component,
                                     const std::string& maker) {
  std::vector<StageEntry> stages = solid_surface_stages(model);
  if (model.is_offset())
    stages.push_back({"offset", [model](const JobState& s) { return make_solid_offset_stage(s, model); }});
  stages.push_back({"weld", [min_component](const JobState& s) {
                      return make_weld_stage_by(
                          s,
                          {min_component, "nothing is left: the solids have no common inside", kCrumbFaces});
                    }});
  for (StageEntry& entry : uncross_stages(written_by(false))) stages.push_back(std::move(entry));
  stages.push_back({"write", [maker](const JobState& s) { return make_write_stage_of(s, maker); }});
  return stages;
}

SolidModel model_of_soup(std::size_t meshes) {
  SolidModel model;
  std::vector<std::size_t> inputs(meshes);
  std::iota(inputs.begin(), inputs.end(), std::size_t{0});
  model.meshes.push_back({std::move(inputs)});
  model.tree.push_operand(0);
  return model;
}

JobDescription resurface_job(const ResurfaceOptions& options) {
  SolidModel model = model_of_soup(options.meshes);
  apply(options, model);
  JobDescription job{"resurface",
                     solid_stages(model, options.min_component, "tessera resurface"),
                     0,
                     summarise_solids,
                     {known_origin()},
                     job_page()};
  job.needs = [model](const JobState& state) { return solid_needs(state, model); };
  return job;
}

}  // namespace tessera
