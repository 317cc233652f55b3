#include <fmt/format.h>

#include <memory>

#include "octree/error.h"
#include "stream/files/json.h"
#include "stream/formats/meshes/mesh_io.h"
#include "stream/points/reconstruct_options.h"
#include "stream/runtime/job_report.h"
#include "stream/stages/reconstruct/reconstruct_job.h"
#include "stream/stages/solid/csg_job.h"
#include "tools/commands.h"
#include "tools/frame/cli.h"

namespace tessera {
namespace {

struct CsgArguments {
  std::vector<std::string> words;
  CsgOptions options;
  JobState state;
};

/// Every scan of the scene becomes a mesh beside the output, `part.scan-1.ply` of `part.ply`, by a job of its own under the
/// same cap; one that stands already is not made again.
void reconstruct_scans(const JobState& state, CsgScene& scene) {
  std::vector<std::filesystem::path> made;
  for (const CsgScan& scan : scene.scans) {
    JobState job = state;
    job.inputs = scan.files;
    for (const std::filesystem::path& file : job.inputs)
      if (!std::filesystem::exists(file)) throw InputError(file.string() + ": there is no such file");
    job.output.replace_extension();
    job.output += ".scan-" + std::to_string(made.size() + 1) + ".ply";
    job.run.report.clear();
    job.run.until.clear();
    job.run.page = false;
    auto options = from_settings<ReconstructOptions>(scan.options);
    options.validate();
    job.settings = to_settings(options);
    const Json report = run_job(job, reconstruct_job(options), cli::stderr_sink());
    made.push_back(job.output);
    if (state.run.verbosity < 0) continue;
    fmt::print("{}: {} faces of the scan, {}\n", job.output.string(),
               report.at("mesh").value("faces", std::uint64_t{0}), cost_text(report));
  }
  for (const auto& [mesh, scan] : scene.scan_of) scene.meshes.at(mesh) = made.at(scan);
}

void run_csg(CsgArguments& a) {
  cli::require_inputs(a.words);
  cli::require_output(a.state.output);
  require_mesh_extension(a.state.output);
  const bool is_scene = a.words.size() == 1 && a.words[0].ends_with(".json");
  CsgScene scene = is_scene ? read_csg_scene(a.words[0]) : parse_csg_words(a.words);
  a.state.also_read = cli::also_read({});
  if (is_scene) a.state.also_read.emplace_back(a.words[0]);
  if (!scene.scans.empty()) {
    a.options.program = scene.program;
    csg_job(a.options);  // what makes no sense is told before a scan is read
    reconstruct_scans(a.state, scene);
  }
  a.state.inputs = scene.meshes;
  a.state.inputs.insert(a.state.inputs.end(), scene.paths.begin(), scene.paths.end());
  for (const std::filesystem::path& file : a.state.inputs)
    if (!std::filesystem::exists(file)) throw InputError(file.string() + ": there is no such file");
  a.options.program = scene.program;
  a.state.settings = to_settings(a.options);
  const Json report = run_job(a.state, csg_job(a.options), cli::stderr_sink());
  if (a.state.run.verbosity < 0) return;
  const Json mesh = report.value("mesh", Json::object());
  fmt::print("{}: {} vertices, {} faces, {} components, {}\n", a.state.output.string(),
             mesh.value("vertices", std::uint64_t{0}), mesh.value("faces", std::uint64_t{0}),
             mesh.value("components", std::uint64_t{0}), cost_text(report));
  if (a.options.exact)
    fmt::print("{} faces as they were, {} along the cut ({} faces cut, {} coplanar pairs)\n",
               mesh.value("kept_faces", std::uint64_t{0}), mesh.value("made_faces", std::uint64_t{0}),
               mesh.value("cut_faces", std::uint64_t{0}), mesh.value("coplanar_pairs", std::uint64_t{0}));
  if (const auto dropped = mesh.value("islands_dropped", std::uint64_t{0}); dropped > 0)
    fmt::print(
        "{} islands of fewer than {} faces were dropped, {} faces together (--min-component 1 keeps them)\n",
        dropped, mesh.value("min_component_faces", std::uint64_t{0}),
        mesh.value("island_faces_dropped", std::uint64_t{0}));
}

}  // namespace

cli::Command csg_command() {
  auto arguments = std::make_shared<CsgArguments>();
  OptionTable table;
  cli::add_inputs(table, arguments->words);
  cli::add_output(table, arguments->state.output,
                  "the mesh to write: .ply, .obj, .stl, .glb, .3mf, .vtu or .msh");
  table.append(option_table(arguments->options));
  table.append(option_table(arguments->state.run));
  return {
      "csg",
      "Union (+), difference (-) and intersection (*, &) of meshes, from left to right, or of a scene file "
      "(SCENE.json); new edges are sharp, with --exact the faces are cut themselves. Resumable.",
      table, [arguments] { run_csg(*arguments); }};
}

}  // namespace tessera
