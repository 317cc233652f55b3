#include <fmt/format.h>

#include <memory>
#include <nlohmann/json.hpp>

#include "octree/error.h"
#include "stream/formats/meshes/mesh_io.h"
#include "stream/runtime/memory_budget.h"
#include "stream/runtime/stop.h"
#include "stream/stages/decimate/decimate_job.h"
#include "tools/cli.h"
#include "tools/commands.h"

namespace tessera {
namespace {

struct Arguments {
  std::string input;
  SimplifyOptions options;
  JobState state;
};

void run(Arguments arguments) {
  if (arguments.input.empty()) throw UsageError("no input given: name the mesh to decimate");
  cli::require_output(arguments.state.output);
  require_mesh_extension(arguments.state.output);
  arguments.options.validate();
  arguments.state.inputs = {arguments.input};
  if (arguments.options.reference != "surface")
    arguments.state.inputs.emplace_back(arguments.options.reference);
  arguments.state.settings = to_json(arguments.options).dump();
  catch_stop_signals();
  const nlohmann::json report = run_job(arguments.state, decimate_job(arguments.options), cli::stderr_sink());
  if (arguments.state.run.verbosity < 0) return;
  cli::print_repairs(arguments.input, report);
  fmt::print("{}: {} of {} faces, {:.1f} s, peak {}\n", arguments.state.output.string(),
             report.at("mesh").value("faces", std::uint64_t{0}),
             report.at("input").value("faces", std::uint64_t{0}), report.at("wall_s").get<double>(),
             format_bytes(report.at("peak_bytes").get<std::uint64_t>()));
  const nlohmann::json& certificate = report.at("certificate");
  if (certificate.at("certified_max").is_number())
    fmt::print("distance: at most {:.4g} both ways, proven; rms {:.3g} to the reference, {:.3g} back\n",
               certificate.at("certified_max").get<double>(),
               certificate.at("mesh_to_reference").at("rms").get<double>(),
               certificate.at("reference_to_mesh").at("rms").get<double>());
  if (const int again = report.at("certificate").value("rounds_again", 0); again > 0)
    fmt::print("the certificate sent parts back {} time{}: the reference is kept there\n", again,
               again == 1 ? "" : "s");
}

}  // namespace

void add_decimate(CLI::App& app) {
  auto arguments = std::make_shared<Arguments>();
  SimplifyOptions& o = arguments->options;
  CLI::App* command = cli::add_command(
      app, "decimate",
      "A mesh of any size shrinks to what its geometry needs, within a tolerance that is proven.",
      [arguments] { run(*arguments); });
  command->add_option("input", arguments->input, "the mesh: PLY, OBJ, STL, OFF or GLB");
  cli::add_output(*command, arguments->state.output, "the mesh to write: .ply, .obj, .stl or .glb");
  const std::string group = "What it computes";
  command
      ->add_option("--tolerance", o.tolerance,
                   "largest distance between result and reference, both ways, in the units of the mesh")
      ->group(group);
  command
      ->add_option("--target-faces", o.target_faces,
                   "stop at about so many faces; the tolerance, if any, still holds")
      ->group(group);
  command
      ->add_option(
          "--reference", o.reference,
          "surface (the input itself), or a mesh file: then the passes still stay within the tolerance of "
          "the input, only the final proof is against the file (exit code 6 where it fails)")
      ->capture_default_str()
      ->group(group);
  command
      ->add_option(
          "--max-normal-deviation", o.max_normal_deviation_deg,
          "largest angle in degrees between a new face and the faces it stands for (but not where "
          "noise turns a sliver: moving its corner by half the tolerance and a 32nd of the width of the "
          "faces around it); 0 = free")
      ->capture_default_str()
      ->check(CLI::Range(0.0, 180.0))
      ->group(group);
  command
      ->add_option("--feature-angle", o.feature_angle_deg,
                   "edges that turn by more degrees are kept as creases; 0 = none")
      ->capture_default_str()
      ->check(CLI::Range(0.0, 180.0))
      ->group(group);
  command
      ->add_option(
          "--priority", o.priority,
          "what goes first: quadric, probabilistic (quadrics of uncertain planes), samples (distance of the "
          "original vertices), normal (deviation), round (worst triangle) or length (shortest edge)")
      ->capture_default_str()
      ->check(CLI::IsMember({"quadric", "probabilistic", "samples", "normal", "round", "length"}))
      ->group(group);
  command
      ->add_option("--placement", o.placement,
                   "endpoint: vertices stay where vertices were; optimal: they may move within the tolerance")
      ->capture_default_str()
      ->check(CLI::IsMember({"endpoint", "optimal"}))
      ->group(group);
  command
      ->add_option("--min-roundness", o.min_roundness,
                   "smallest roundness of a new face: 1 is equilateral, 0 flat")
      ->capture_default_str()
      ->check(CLI::Range(0.0, 1.0))
      ->group(group);
  command
      ->add_option(
          "--colour-weight", o.colour_weight,
          "length that the full range of a colour is worth, in the units of the mesh; 0 = colours follow")
      ->capture_default_str()
      ->check(CLI::NonNegativeNumber)
      ->group(group);
  command->add_option("--passes", o.passes, "passes over shifted blocks")
      ->capture_default_str()
      ->check(CLI::Range(1, 8))
      ->group(group);
  command->add_option("--block-faces", o.block_faces, "most faces of a block")
      ->capture_default_str()
      ->group(group);
  // For tests of the rounds: makes the passes bolder than the certificate allows.
  command->add_option("--loop-share", o.loop_share, "share of the tolerance that the passes may use")
      ->group("");
  cli::add_run_options(*command, arguments->state.run);
}

}  // namespace tessera
