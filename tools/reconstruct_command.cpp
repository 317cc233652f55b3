#include <fmt/format.h>

#include <memory>
#include <nlohmann/json.hpp>

#include "stream/formats/meshes/mesh_io.h"
#include "stream/runtime/memory_budget.h"
#include "stream/stages/reconstruct/reconstruct_job.h"
#include "tools/commands.h"
#include "tools/frame/cli.h"

namespace tessera {
namespace {

void run(const ReconstructOptions& options, JobState state) {
  cli::require_output(state.output);
  require_mesh_extension(state.output);
  const nlohmann::json report = run_job(state, reconstruct_job(options), cli::stderr_sink());
  if (state.run.verbosity < 0) return;
  for (const nlohmann::json& w : report.value("warnings", nlohmann::json::array()))
    fmt::print(stderr, "tessera: warning: {}\n", w.get<std::string>());
  const nlohmann::json mesh = report.value("mesh", nlohmann::json::object());
  fmt::print("{}: {} vertices, {} faces, {:.1f} s, peak {}\n", state.output.string(),
             mesh.value("vertices", std::uint64_t{0}), mesh.value("faces", std::uint64_t{0}),
             report.at("wall_s").get<double>(), format_bytes(report.at("peak_bytes").get<std::uint64_t>()));
}

}  // namespace

cli::Command reconstruct_command() {
  return cli::job_command<ReconstructOptions>("reconstruct",
                                              "A scan becomes a mesh. Run it again to go on after a stop.",
                                              "the mesh to write: .ply, .obj, .stl or .glb", run);
}

}  // namespace tessera
