#include <fmt/format.h>

#include <memory>
#include <nlohmann/json.hpp>

#include "octree/error.h"
#include "stream/formats/meshes/mesh_io.h"
#include "stream/formats/points/point_source.h"
#include "stream/runtime/memory_budget.h"
#include "stream/runtime/stop.h"
#include "stream/stages/reconstruct/reconstruct_job.h"
#include "tools/cli.h"
#include "tools/commands.h"

namespace tessera {
namespace {

struct Arguments {
  std::vector<std::string> inputs;
  JobState state;
};

void run(Arguments arguments) {
  cli::require_inputs(arguments.inputs);
  cli::require_output(arguments.state.output);
  require_mesh_extension(arguments.state.output);
  const ReconstructOptions& options = arguments.state.options;
  if (options.tolerance == 0.0 && (options.keep_raw || options.reference != "surface"))
    throw UsageError(
        std::string(options.keep_raw ? "--keep-raw" : "--reference") +
        ": means something with --tolerance only, without it the mesh of full resolution is the result");
  arguments.state.inputs = expand_inputs(arguments.inputs);
  catch_stop_signals();
  const nlohmann::json report =
      run_job(arguments.state, reconstruct_job(arguments.state.options), cli::stderr_sink());
  if (arguments.state.run.verbosity < 0) return;
  for (const nlohmann::json& w : report.value("warnings", nlohmann::json::array()))
    fmt::print(stderr, "tessera: warning: {}\n", w.get<std::string>());
  const nlohmann::json mesh = report.value("mesh", nlohmann::json::object());
  fmt::print("{}: {} vertices, {} faces, {:.1f} s, peak {}\n", arguments.state.output.string(),
             mesh.value("vertices", std::uint64_t{0}), mesh.value("faces", std::uint64_t{0}),
             report.at("wall_s").get<double>(), format_bytes(report.at("peak_bytes").get<std::uint64_t>()));
}

}  // namespace

void add_reconstruct(CLI::App& app) {
  auto arguments = std::make_shared<Arguments>();
  CLI::App* command =
      cli::add_command(app, "reconstruct", "A scan becomes a mesh. Run it again to go on after a stop.",
                       [arguments] { run(*arguments); });
  cli::add_inputs(*command, arguments->inputs);
  cli::add_output(*command, arguments->state.output, "the mesh to write: .ply, .obj, .stl or .glb");
  cli::add_reconstruct_options(*command, arguments->state.options);
  cli::add_run_options(*command, arguments->state.run);
}

}  // namespace tessera
