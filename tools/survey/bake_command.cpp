#include <fmt/format.h>

#include <memory>

#include "octree/error.h"
#include "stream/files/json.h"
#include "stream/formats/meshes/textured_mesh_writer.h"
#include "stream/runtime/job_report.h"
#include "stream/stages/bake/bake_job.h"
#include "stream/survey/measured_inputs.h"
#include "tools/commands.h"
#include "tools/frame/cli.h"

namespace tessera {
namespace {

struct BakeCommand {
  std::vector<std::string> inputs, from;
  BakeOptions options;
  JobState state;
};

void run_bake(BakeCommand& command) {
  cli::require_inputs(command.inputs);
  command.options.validate();
  JobState& state = command.state;
  state.inputs = cli::expand_and_tell(command.inputs);
  state.also_read = cli::also_read(command.inputs);
  cli::one_input(state.inputs, "textured");
  cli::require_output(state.output);
  require_textured_extension(state.output, command.options.normal_map);
  if (command.from.empty())
    throw UsageError("--from is missing: the scans, or the finer mesh, that colours come from");
  const std::vector<std::filesystem::path> from = cli::expand_and_tell(command.from);
  command.options.scans = from.size();
  command.options.fine_mesh = measures_vertices(from.front());
  if (command.options.fine_mesh && from.size() > 1)
    throw UsageError("--from takes scans, or one mesh: " + from.front().string() + " is a mesh");
  state.inputs.insert(state.inputs.end(), from.begin(), from.end());
  state.settings = to_settings(command.options);
  const Json report = run_job(state, bake_job(command.options), cli::stderr_sink());
  if (state.run.verbosity < 0) return;
  cli::print_repairs(state.inputs.front().string(), report);
  fmt::print("{}: {} faces, {}\n", state.output.string(),
             report.value("mesh", Json::object()).value("faces", std::uint64_t{0}), cost_text(report));
  cli::print_texture(report);
}

}  // namespace

cli::Command bake_command() {
  auto shared = std::make_shared<BakeCommand>();
  BakeCommand& c = *shared;
  OptionTable t;
  cli::add_inputs(t, c.inputs);
  cli::add_output(t, c.state.output,
                  "the mesh to write: .glb with its textures, .obj or .ply with pictures beside it");
  t.add("from", &c.from,
        "what colours come from: scans with colours (files, folders, globs), or one finer mesh with colours")
      .shown_as("FILE");
  t.append(option_table(c.options));
  t.append(option_table(c.state.run));
  return {"bake",
          "A mesh of any size gets textures: colours of a scan, or of a finer mesh, on charts in pages. "
          "Resumable. "
          "Example: tessera bake small.ply --from scan.laz -o small.glb",
          t, [shared] { run_bake(*shared); }};
}

}  // namespace tessera
