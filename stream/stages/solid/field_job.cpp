#include "stream/stages/solid/field_job.h"

#include <nlohmann/json.hpp>

#include "stream/page/report_page.h"
#include "stream/runtime/report.h"
#include "stream/stages/solid/resurface_job.h"

namespace tessera {
namespace {

void summarise_field(nlohmann::json& report) {
  summarise_solids(report);
  if (const nlohmann::json field = result_of(report, "grid"); field.is_object()) report["field"] = field;
}

}  // namespace

OptionTable option_table(FieldJobOptions& o) {
  OptionTable t("What it computes");
  t.add("resolution,voxel", &o.resolution,
        "lattice spacing h, units of the meshes: what is thinner may go; 0 = a 300th of the diagonal")
      .at_least(0);
  t.add("band", &o.band, "cells on both sides of the surface that get a distance").within(1, 64);
  t.add("meshes", &o.meshes, "how many meshes there are").hidden();
  return t;
}

JobDescription field_job(const FieldJobOptions& options) {
  SolidModel model = model_of_soup(options.meshes);
  model.resolution = options.resolution;
  model.band = options.band;
  std::vector<StageEntry> stages = solid_surface_stages(model);
  stages.push_back({"distances", [model](const JobState& s) { return make_distances_stage(s, model); }});
  stages.push_back({"grid", [model](const JobState& s) { return make_grid_stage(s, model); }});
  JobDescription job{"field", std::move(stages), 0, summarise_field, {}, job_page()};
  job.needs = [meshes = model.inputs()](const JobState& state) { return solid_needs(state, meshes); };
  return job;
}

}  // namespace tessera
