#include "stream/stages/bake/bake_job.h"

#include "octree/error.h"
#include "stream/files/json.h"
#include "stream/formats/meshes/textured_mesh_writer.h"
#include "stream/import/crs_sidecar.h"
#include "stream/import/import_needs.h"
#include "stream/import/import_stages.h"
#include "stream/page/report_page.h"
#include "stream/points/point_inputs.h"
#include "stream/runtime/report.h"
#include "stream/stages/bake/bake_needs.h"
#include "stream/stages/bake/bake_pages.h"
#include "stream/stages/bake/bake_stages.h"

namespace tessera {
namespace {

constexpr const char* kBakedMesh = "mesh";
constexpr const char* kFineMesh = "fine";

/// Patches small enough for blocks of few texels: a decimated mesh has a hundred points a face.
ImportSource baked_source() {
  ImportSource source{0, kBakedMesh};
  source.brick_vertices = 1000;
  return source;
}

void summarise(Json& report) {
  report["input"] = import_report(report, kBakedMesh);
  report["mesh"] = result_of(report, "write");
  summarise_texture(report);
}

/// Pages lie beside files that cannot hold them.
std::filesystem::path first_page(const std::filesystem::path& output, bool jpeg) {
  if (material_path(output).empty() && output.extension() != ".ply" && output.extension() != ".PLY")
    return {};
  return output.parent_path() / page_image_name(output, 0, jpeg);
}

}  // namespace

void summarise_texture(Json& report) {
  Json texture;
  for (const char* stage : {"points", "scale", "charts", "pack", "texels", "pages"})
    if (Json result = result_of(report, std::string("texture-") + stage); result.is_object()) {
      result.erase("warnings");
      texture[stage] = result;
    }
  if (texture.contains("scale") && texture.contains("pack"))  // pages may have asked for finer ones
    texture["scale"]["texel"] = texture["pack"].at("texel");
  if (texture.is_object()) report["texture"] = std::move(texture);
}

void add_texture_sidecars(JobDescription& job, const BakeOptions& options, bool wanted) {
  if (!wanted) return;
  job.sidecars.push_back({material_path, "the material beside -o", true});
  job.sidecars.push_back(
      {[jpeg = options.is_jpeg()](const std::filesystem::path& out) { return first_page(out, jpeg); },
       "the pages beside -o", true});
}

std::vector<StageEntry> bake_stages(const BakeOptions& options, const BakeStores& stores) {
  return {{"texture-points", [=](const JobState& s) { return make_bake_points_stage(s, stores); }},
          {"texture-scale", [=](const JobState& s) { return make_bake_scale_stage(s, options, stores); }},
          {"texture-charts", [=](const JobState& s) { return make_bake_charts_stage(s, options, stores); }},
          {"texture-pack", [=](const JobState& s) { return make_bake_pack_stage(s, options); }},
          {"texture-texels", [=](const JobState& s) { return make_bake_texels_stage(s, options, stores); }},
          {"texture-pages", [=](const JobState& s) { return make_bake_pages_stage(s, options); }},
          {"write", [=](const JobState& s) { return make_bake_write_stage(s, options, stores); }}};
}

JobDescription bake_job(const BakeOptions& options) {
  options.validate();
  BakeStores stores;
  stores.mesh = [](const JobState& s) { return open_imported_mesh(s.work, kBakedMesh); };
  stores.comment = [](const JobState&) { return std::string("made by tessera bake"); };
  std::vector<StageEntry> stages = import_stages(baked_source());
  if (options.fine_mesh) {
    for (StageEntry& entry : import_stages({1, kFineMesh})) stages.push_back(std::move(entry));
    stores.colours = [colourless = options.normal_map](const JobState& s) {
      return colours_of_store(open_imported_mesh(s.work, kFineMesh), colourless);
    };
  } else {
    stores.colours =
        [scans = options.scans,
         choice = ScanColourChoice{options.shows_intensity(), options.normal_map}](const JobState& s) {
          const auto first = s.inputs.begin() + 1;
          return colours_of_scans({first, first + static_cast<std::ptrdiff_t>(scans)}, choice);
        };
  }
  for (StageEntry& entry : bake_stages(options, stores)) stages.push_back(std::move(entry));
  JobDescription job{"bake", std::move(stages), 0, summarise, {carried_crs()}, job_page()};
  add_texture_sidecars(job, options);
  job.needs = [options](const JobState& state) {
    const MeshSize mesh = claimed_mesh_size(state.inputs.at(0));
    std::vector<StageNeed> needs = import_needs(state.run, baked_source(), mesh);
    if (options.fine_mesh)
      for (const StageNeed& need :
           import_needs(state.run, {1, kFineMesh}, claimed_mesh_size(state.inputs.at(1))))
        needs.push_back(need);
    for (StageNeed& need :
         bake_needs(state.run, options.page_size, mesh.faces, baked_source().brick_vertices)) {
      if (need.stage == "texture-points" && !options.fine_mesh) need.sure += PointInputs::kReadBytes;
      needs.push_back(std::move(need));
    }
    return needs;
  };
  return job;
}

}  // namespace tessera
