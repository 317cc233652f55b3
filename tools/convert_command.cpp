#include <memory>

#include <fmt/format.h>

#include "octree/error.h"
#include "stream/commands/convert_mesh.h"
#include "stream/commands/convert_points.h"
#include "stream/runtime/stop.h"
#include "tools/cli.h"
#include "tools/commands.h"

namespace tessera {
namespace {

struct ConvertCommand {
  std::vector<std::string> inputs;
  std::filesystem::path output;
  ConvertOptions options;
  bool floats = false;
  bool force = false;
};

void run_convert_mesh(const std::vector<std::filesystem::path>& inputs, const ConvertCommand& command) {
  if (inputs.size() > 1) {
    throw UsageError(command.output.string() + ": meshes are converted one at a time, but there are " +
                     std::to_string(inputs.size()) + " inputs");
  }
  ConvertMeshOptions options;
  options.floats = command.floats;
  options.check_stop = throw_if_stopped;
  const ConvertMeshReport report = convert_mesh(inputs.front(), command.output, options);
  fmt::print("{}: {} vertices, {} faces, {} bytes{}\n", command.output.string(), report.vertices,
             report.faces, report.bytes, report.welded ? " (vertices merged by position)" : "");
}

void run_convert(const ConvertCommand& command) {
  cli::require_inputs(command.inputs);
  cli::require_output(command.output);
  if (std::filesystem::exists(command.output) && !command.force) {
    throw UsageError(command.output.string() + ": exists already; give --force to replace it");
  }
  catch_stop_signals();
  const std::vector<std::filesystem::path> inputs = expand_inputs(command.inputs);
  if (converts_as_mesh(inputs.front(), command.output)) {
    run_convert_mesh(inputs, command);
    return;
  }
  const ConvertReport report = convert_points(inputs, command.output, command.options);
  fmt::print("{}: {} points, {} bytes\n", command.output.string(), report.points, report.bytes);
  const std::uint64_t dropped = report.not_finite + report.withheld + report.empty + report.missing;
  if (dropped > 0) {
    fmt::print("left out: {} not finite, {} withheld, {} empty, {} missing\n", report.not_finite,
               report.withheld, report.empty, report.missing);
  }
  for (const std::string& note : report.notes) fmt::print("note: {}\n", note);
}

}  // namespace

void add_convert(CLI::App& app) {
  auto shared = std::make_shared<ConvertCommand>();
  CLI::App* command =
      cli::add_command(app, "convert", "Write scans, or one mesh, into one file of another format.",
                       [shared] { run_convert(*shared); });
  cli::add_inputs(*command, shared->inputs);
  cli::add_output(*command, shared->output,
                  "file to write: scans .ply (binary), .las (1.4), .xyz; meshes .ply, .obj, .stl, .glb");
  cli::add_columns(*command, shared->options.columns);
  command->add_flag("--double", shared->options.force_double,
                    "PLY: double coordinates even where floats are exact");
  command
      ->add_option("--las-scale", shared->options.las_scale,
                   "step of LAS coordinates, units of the scan; 0 = the finest power of ten that fits")
      ->capture_default_str()
      ->check(CLI::NonNegativeNumber);
  command->add_flag("--float", shared->floats,
                    "meshes: positions as floats even where the source has doubles");
  command
      ->add_option("-t,--threads", shared->options.threads,
                   "threads; 0 = one per core; never changes the result")
      ->check(CLI::NonNegativeNumber);
  command->add_flag("--force", shared->force, "replace the output if it exists");
}

}  // namespace tessera
