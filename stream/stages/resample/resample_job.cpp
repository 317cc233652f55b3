#include "stream/stages/resample/resample_job.h"

#include <algorithm>

#include "stream/files/json.h"
#include "stream/import/crs_sidecar.h"
#include "stream/import/import_needs.h"
#include "stream/import/import_stages.h"
#include "stream/meshes/store_write_stage.h"
#include "stream/page/report_page.h"
#include "stream/runtime/report.h"
#include "stream/stages/decimate/certify_stage.h"
#include "stream/stages/decimate/decimate_job.h"
#include "stream/stages/decimate/simplify_needs.h"
#include "stream/stages/resample/resample_needs.h"
#include "stream/stages/resample/resample_stages.h"

namespace tessera {
namespace {

void summarise(Json& report) {
  report["input"] = import_report(report, kResampleImport);
  report["search"] = result_of(report, "bends");
  report["resampled"] = result_of(report, "blends");
  report["mesh"] = result_of(report, "write");
  report["certificate"] = certificate_of(report);
}

}  // namespace

JobDescription resample_job(const ResampleOptions& options) {
  options.validate();
  const auto placement = [options](const JobState& s) {
    if (!holds_floats_only(s.output)) return MeshPlacement{};
    return store_placement(s.output, open_imported_mesh(s.work, kResampleImport), options.tolerance);
  };
  std::vector<StageEntry> stages = import_stages({0, kResampleImport});
  stages.push_back({"scale", [=](const JobState& s) { return make_resample_scale_stage(s, options); }});
  stages.push_back({"bends", [=](const JobState& s) { return make_curvatures_stage(s, options); }});
  stages.push_back({"blends", [=](const JobState& s) { return make_blends_stage(s, options); }});
  stages.push_back({"apply", make_resample_apply_stage});
  stages.push_back({"certify", [=](const JobState& s) {
                      CertifyRequest request;
                      request.name = "certify";
                      // Blends that are edited on purpose leave the input: then it is measured only.
                      const double tolerance = MeshScale::of_work(s.work).tolerance;
                      (options.edits() ? request.scale : request.tolerance) = tolerance;
                      request.mesh = [](const JobState& state) { return open_resampled(state.work); };
                      request.reference = [](const JobState& state) {
                        return open_imported_mesh(state.work, kResampleImport);
                      };
                      request.placement = placement(s);
                      return make_certify_stage(s, request);
                    }});
  stages.push_back({"write", [=](const JobState& s) {
                      return make_store_write_stage(s, open_resampled(s.work), "made by tessera resample",
                                                    sort_bytes(s.run), placement(s));
                    }});
  JobDescription job{"resample", std::move(stages), 0, summarise, {carried_crs(), known_origin()},
                     job_page()};
  job.needs = [options](const JobState& state) {
    const MeshSize mesh = claimed_mesh_size(state.inputs.at(0));
    std::vector<StageNeed> needs = import_needs(state.run, {0, kResampleImport}, mesh);
    if (options.blends == "auto") {
      const std::uint64_t block = std::min(mesh.faces, options.block_faces);
      needs.push_back({"bends", curvatures_task_bytes(surface_block_bytes(block), block / 2, block),
                       curvatures_task_bytes(surface_block_bytes(std::min(mesh.faces, kMaxAround * block)),
                                             std::min(mesh.faces, kMaxAround * block) / 2,
                                             std::min(mesh.faces, kMaxAround * block))});
    }
    for (const StageNeed& need : resample_needs(mesh)) needs.push_back(need);
    for (const StageNeed& need : proof_needs(state.run, mesh.faces, mesh.faces)) needs.push_back(need);
    return needs;
  };
  return job;
}

}  // namespace tessera
