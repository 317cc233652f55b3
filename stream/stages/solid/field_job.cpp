#include "stream/stages/solid/field_job.h"

#include "stream/files/json.h"
#include "stream/page/report_page.h"
#include "stream/runtime/report.h"
#include "stream/stages/solid/resurface_job.h"
#include "stream/stages/solid/solid_needs.h"
#include "stream/stages/solid/solid_stages.h"

namespace tessera {
namespace {

void summarise_field(Json& report) {
  summarise_solids(report);
  if (const Json field = result_of(report, "grid"); field.is_object()) report["field"] = field;
  if (const Json octree = result_of(report, "octree"); octree.is_object()) {
    report["field"] = result_of(report, "cells");
    report["field"].update(octree);
  }
}

}  // namespace

OptionTable option_table(FieldJobOptions& o) {
  OptionTable t("What it computes");
  t.add("resolution,voxel", &o.resolution,
        "lattice spacing h, units of the meshes: what is thinner may go; 0 = a 300th of the diagonal")
      .at_least(0);
  t.add("band", &o.band, "cells on both sides of the surface that get a distance").within(1, 64);
  t.add("full", &o.full,
        "every node of the box of the meshes gets its distance, not those of the band alone");
  t.add("tolerance", &o.tolerance,
        "units of the meshes, at least h: instead of a grid an octree (.octree), its cells as large as a "
        "tri-linear "
        "field within this of the distance lets them be, in the whole box; 0 = a grid")
      .at_least(0);
  t.add("meshes", &o.meshes, "how many meshes there are").hidden();
  return t;
}

JobDescription field_job(const FieldJobOptions& options) {
  SolidModel model = model_of_soup(options.meshes);
  model.resolution = options.resolution;
  model.band = options.full || options.tolerance > 0.0 ? 0.0 : options.band;
  model.full = options.full;
  model.tolerance = options.tolerance;
  std::vector<StageEntry> stages = solid_surface_stages(model);
  if (options.tolerance > 0.0) {
    stages.push_back({"cells", [model](const JobState& s) { return make_cells_stage(s, model); }});
    stages.push_back({"octree", [model](const JobState& s) { return make_octree_stage(s, model); }});
  } else {
    stages.push_back({"distances", [model](const JobState& s) {
                        return model.full ? make_far_distances_stage(s, model)
                                          : make_distances_stage(s, model);
                      }});
    stages.push_back({"grid", [model](const JobState& s) { return make_grid_stage(s, model); }});
  }
  JobDescription job{"field", std::move(stages), 0, summarise_field, {}, job_page()};
  job.needs = [model](const JobState& state) { return solid_needs(state, model); };
  return job;
}

}  // namespace tessera
