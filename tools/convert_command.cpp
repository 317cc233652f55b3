#include <memory>

#include <fmt/format.h>

#include "stream/commands/convert_mesh.h"
#include "stream/commands/convert_points.h"
#include "stream/points/reconstruct_options.h"
#include "stream/runtime/stop.h"
#include "tools/commands.h"
#include "tools/frame/cli.h"

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
  ConvertMeshOptions options;
  options.floats = command.floats;
  options.check_stop = throw_if_stopped;
  const ConvertMeshReport report = convert_mesh(cli::one_input(inputs, "converted"), command.output, options);
  fmt::print("{}: {} vertices, {} faces, {} bytes{}\n", command.output.string(), report.vertices,
             report.faces, report.bytes, report.welded ? " (vertices merged by position)" : "");
  for (const std::string& note : report.notes) fmt::print("note: {}\n", note);
}

void run_convert(const ConvertCommand& command) {
  cli::require_inputs(command.inputs);
  const std::vector<std::filesystem::path> inputs = expand_inputs(command.inputs);
  std::vector<std::filesystem::path> reads = cli::also_read(command.inputs);
  reads.insert(reads.end(), inputs.begin(), inputs.end());
  cli::require_new_output(command.output, command.force, reads);
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

cli::Command convert_command() {
  auto shared = std::make_shared<ConvertCommand>();
  ConvertCommand& c = *shared;
  OptionTable t;
  cli::add_inputs(t, c.inputs);
  cli::add_output(
      t, c.output,
      "file to write: scans .ply (binary), .las (1.4), .laz, .xyz; meshes .ply, .obj, .stl, .glb");
  add_columns(t, c.options.columns);
  t.add("double", &c.options.force_double, "PLY: double coordinates even where floats are exact");
  t.add("las-scale", &c.options.las_scale,
        "step of LAS and LAZ coordinates, units of the scan; 0 = the finest power of ten that fits")
      .at_least(0);
  t.add("float", &c.floats, "meshes: positions as floats even where the source has doubles");
  cli::add_threads(t, c.options.threads, "threads; never changes the result");
  cli::add_force(t, c.force);
  return {"convert", "Write scans, or one mesh, into one file of another format.", t,
          [shared] { run_convert(*shared); }};
}

}  // namespace tessera
