#include <fmt/format.h>

#include "stream/files/json.h"
#include "stream/formats/meshes/mesh_io.h"
#include "stream/runtime/job_report.h"
#include "stream/stages/solid/resurface_job.h"
#include "tools/commands.h"
#include "tools/frame/cli.h"

namespace tessera {
namespace {

void run_resurface(const ResurfaceOptions& given, JobState state) {
  cli::require_output(state.output);
  require_mesh_extension(state.output);
  ResurfaceOptions options = given;
  options.meshes = state.inputs.size();
  state.settings = to_settings(options);
  const Json report = run_job(state, resurface_job(options), cli::stderr_sink());
  if (state.run.verbosity < 0) return;
  const Json mesh = report.value("mesh", Json::object());
  fmt::print("{}: {} vertices, {} faces, {} components, {} faces close gaps, {}\n", state.output.string(),
             mesh.value("vertices", std::uint64_t{0}), mesh.value("faces", std::uint64_t{0}),
             mesh.value("components", std::uint64_t{0}), mesh.value("synthetic_faces", std::uint64_t{0}),
             cost_text(report));
}

}  // namespace

cli::Command resurface_command() {
  return cli::job_command<ResurfaceOptions>("resurface",
                                            "Dirty meshes (soups, gaps, self-intersections, doubled walls) "
                                            "become one closed manifold with their sharp "
                                            "edges: holes are always closed. Resumable.",
                                            "the mesh to write: .ply, .obj, .stl, .glb, .3mf, .vtu or .msh",
                                            run_resurface);
}

}  // namespace tessera
