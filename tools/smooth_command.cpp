#include <fmt/format.h>

#include <memory>

#include "stream/files/json.h"
#include "stream/formats/meshes/mesh_io.h"
#include "stream/runtime/job_report.h"
#include "stream/stages/smooth/smooth_job.h"
#include "tools/commands.h"
#include "tools/frame/cli.h"

namespace tessera {
namespace {

void run_smooth(const SmoothOptions& options, JobState state) {
  const std::filesystem::path input = cli::one_input(state.inputs, "smoothed");
  cli::require_output(state.output);
  require_mesh_extension(state.output);
  const Json report = run_job(state, smooth_job(options), cli::stderr_sink());
  if (state.run.verbosity < 0) return;
  cli::print_repairs(input.string(), report);
  const Json mesh = report.value("mesh", Json::object());
  fmt::print("{}: {} vertices, {} faces, moved {:.6g} at most, {:.6g} rms, {}\n", state.output.string(),
             mesh.value("vertices", std::uint64_t{0}), mesh.value("faces", std::uint64_t{0}),
             mesh.value("largest_move", 0.0), mesh.value("rms_move", 0.0), cost_text(report));
}

}  // namespace

cli::Command smooth_command() {
  return cli::job_command<SmoothOptions>(
      "smooth", "Smooth a mesh of any size; creases, corners and borders keep their shape. Resumable.",
      "the mesh to write: .ply, .obj, .stl, .glb, .3mf, .vtu or .msh", run_smooth);
}

}  // namespace tessera
