#include <fmt/format.h>

#include <memory>

#include "octree/error.h"
#include "stream/files/json.h"
#include "stream/formats/meshes/mesh_io.h"
#include "stream/formats/meshes/textured_mesh_writer.h"
#include "stream/runtime/job_report.h"
#include "stream/runtime/numbers.h"
#include "stream/stages/bake/texture_colours.h"
#include "stream/stages/decimate/decimate_job.h"
#include "tools/commands.h"
#include "tools/frame/cli.h"

namespace tessera {
namespace {

void run_decimate(const SimplifyOptions& options, JobState state) {
  const std::filesystem::path input = cli::one_input(state.inputs, "decimated");
  cli::require_output(state.output);
  options.has_texture() ? require_textured_extension(state.output, options.normal_map)
                        : require_mesh_extension(state.output);
  const bool textured = has_textures(input);
  if (textured && !options.has_texture())
    fmt::print(stderr, "tessera: warning: {}: its textures are left out; --texture auto bakes them anew\n",
               input.string());
  if (options.has_texture() && !options.normal_map && !textured && !open_mesh_file(input)->header().colour)
    throw InputError(
        input.string() +
        ": has no colours, so there is nothing for --texture to show; tessera bake takes those of a scan");
  if (options.reference != "surface") state.inputs.emplace_back(options.reference);
  const Json report = run_job(state, decimate_job(options), cli::stderr_sink());
  if (state.run.verbosity < 0) return;
  cli::print_repairs(input.string(), report);
  fmt::print("{}: {} of {} faces, {}\n", state.output.string(),
             report.at("mesh").value("faces", std::uint64_t{0}),
             report.at("input").value("faces", std::uint64_t{0}), cost_text(report));
  cli::print_tolerance(report);
  cli::print_smoothing(report);
  cli::print_texture(report);
  const Json& certificate = report.at("certificate");
  if (certificate.at("certified_max").is_number())
    fmt::print("distance: at most {} both ways, proven; rms {:.3g} to the reference, {:.3g} back\n",
               bound_text(certificate.at("certified_max").get<double>()),
               certificate.at("mesh_to_reference").at("rms").get<double>(),
               certificate.at("reference_to_mesh").at("rms").get<double>());
  if (const int again = report.at("certificate").value("rounds_again", 0); again > 0)
    fmt::print("the certificate sent parts back {} time{}: the reference is kept there\n", again,
               again == 1 ? "" : "s");
}

}  // namespace

cli::Command decimate_command() {
  return cli::job_command<SimplifyOptions>(
      "decimate", "A mesh of any size shrinks to what its geometry needs, within a tolerance that is proven.",
      "the mesh to write: .ply, .obj, .stl, .glb, .3mf, .vtu or .msh", run_decimate);
}

}  // namespace tessera
