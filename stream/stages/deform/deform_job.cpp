#include "stream/stages/deform/deform_job.h"

#include "octree/error.h"
#include "stream/files/durable_file.h"
#include "stream/files/json.h"
#include "stream/files/path_text.h"
#include "stream/import/crs_sidecar.h"
#include "stream/import/import_stages.h"
#include "stream/meshes/store_write_stage.h"
#include "stream/page/report_page.h"
#include "stream/runtime/report.h"
#include "stream/runtime/serial_stage.h"
#include "stream/runtime/work_dir.h"
#include "stream/stages/decimate/decimate_job.h"
#include "stream/stages/deform/deform_files.h"
#include "stream/stages/deform/deform_needs.h"
#include "stream/stages/deform/deform_stages.h"
#include "stream/stages/deform/onto_stages.h"

namespace tessera {
namespace {

void summarise(Json& report) {
  report["mesh"] = result_of(report, "write");
  const Json basis = result_of(report, "basis");
  if (!basis.is_object()) return;
  report["input"] = import_report(report, kDeformImport);
  report["edit"] = basis;
  report["base"] = result_of(report, "base");
  report["base"]["thin_area"] = result_of(report, "shape").at("thin_area");
}

StageEntry unless_own(StageEntry entry) {
  return {entry.name, [=](const JobState& state) {
            return is_own_base(state) ? make_idle_stage(entry.name) : entry.make(state);
          }};
}

JobDescription onto_job(const DeformOptions& options) {
  JobDescription job{"deform",  onto_stages(options), 0, summarise_onto, {carried_crs(), known_origin()},
                     job_page()};
  job.needs = onto_needs;
  return job;
}

}  // namespace

JobDescription deform_job(const DeformOptions& options) {
  options.validate();
  if (options.mode == "onto") return onto_job(options);
  JobDescription job{"deform", {}, 0, summarise, {}, {}};
  if (options.mode != "prepare") {
    job.sidecars = {carried_crs(), known_origin()};
    job.page = job_page();
  }
  if (options.mode != "apply") {
    job.stages = import_stages({0, kDeformImport});
    job.stages.push_back({"shape", [=](const JobState& s) { return make_shape_stage(s, options); }});
    SimplifyOptions reduce;
    reduce.target_faces = kDecimatedFaces * options.base_vertices;
    const SimplifyStores stores = imported_stores(kDeformImport);
    // Of the stages of decimation the passes alone: how far the base is from the mesh is in the details.
    for (StageEntry& entry : simplify_stages(reduce, stores, ""))
      if (entry.name != "certify" && entry.name != "write" && entry.name != "crossings" &&
          entry.name != "mend")
        job.stages.push_back(unless_own(std::move(entry)));
    const int passes = reduce.passes;
    job.stages.push_back({"base", [=](const JobState& state) {
                            return make_base_stage(state, options, [=](const JobState& s) {
                              return open_pass_input(s, stores, {passes, 0, false});
                            });
                          }});
    job.stages.push_back({"basis", [=](const JobState& s) { return make_basis_stage(s, options); }});
  }
  job.stages.push_back({"write", [=](const JobState& s) { return make_deform_write_stage(s, options); }});
  job.needs = [options](const JobState& state) { return deform_needs(state, options); };
  return job;
}

std::filesystem::path mesh_of_basis(const std::filesystem::path& basis, const std::filesystem::path& mesh) {
  const Json about = parse_json(BasisReader(basis).about());
  if (!about.contains("mesh"))
    throw InputError(basis.string() +
                     ": it is no file of `tessera deform prepare`, which ends with the mesh's details");
  const Json& was = about.at("mesh");
  const std::filesystem::path path =
      mesh.empty() ? std::filesystem::path(bytes_of_json_text(was.at("path").get<std::string>())) : mesh;
  if (!std::filesystem::exists(path))
    throw InputError(path.string() + ": the mesh that " + basis.string() +
                     " was prepared for is gone: name it behind the basis");
  const InputFingerprint now = fingerprint_input(path);
  if (now.bytes != was.at("bytes").get<std::uint64_t>() ||
      hex64(now.xxh3) != was.at("xxh3").get<std::string>())
    throw InputError(path.string() + ": it is not the mesh that " + basis.string() +
                     " was prepared for: prepare again");
  return path;
}

}  // namespace tessera
