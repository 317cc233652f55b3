#include <fmt/format.h>

#include <memory>
#include <nlohmann/json.hpp>

#include "octree/error.h"
#include "stream/formats/meshes/mesh_io.h"
#include "stream/formats/points/point_source.h"
#include "stream/runtime/memory_budget.h"
#include "stream/runtime/stop.h"
#include "stream/stages/smooth/smooth_stage.h"
#include "tools/cli.h"
#include "tools/commands.h"

namespace tessera {
namespace {

struct Arguments {
  std::vector<std::string> inputs;
  JobState state;
  SmoothOptions options;
};

void run(Arguments arguments) {
  cli::require_inputs(arguments.inputs);
  cli::require_output(arguments.state.output);
  require_mesh_extension(arguments.state.output);
  arguments.state.inputs = expand_inputs(arguments.inputs);
  if (arguments.state.inputs.size() > 1)
    throw UsageError("meshes are smoothed one at a time: give one input");
  arguments.state.settings = smooth_settings(arguments.options);
  catch_stop_signals();
  const nlohmann::json report = run_job(arguments.state, smooth_job(arguments.options), cli::stderr_sink());
  if (arguments.state.run.verbosity < 0) return;
  cli::print_repairs(arguments.state.inputs.front().string(), report);
  const nlohmann::json mesh = report.value("mesh", nlohmann::json::object());
  fmt::print("{}: {} vertices, {} faces, moved {:.6g} at most, {:.6g} rms, {:.1f} s, peak {}\n",
             arguments.state.output.string(), mesh.value("vertices", std::uint64_t{0}),
             mesh.value("faces", std::uint64_t{0}), mesh.value("largest_move", 0.0),
             mesh.value("rms_move", 0.0), report.at("wall_s").get<double>(),
             format_bytes(report.at("peak_bytes").get<std::uint64_t>()));
}

}  // namespace

void add_smooth(CLI::App& app) {
  auto arguments = std::make_shared<Arguments>();
  CLI::App* command = cli::add_command(
      app, "smooth", "Smooth a mesh of any size; creases, corners and borders keep their shape. Resumable.",
      [arguments] { run(*arguments); });
  cli::add_inputs(*command, arguments->inputs);
  cli::add_output(*command, arguments->state.output, "the mesh to write: .ply, .obj, .stl or .glb");
  SmoothOptions& o = arguments->options;
  command
      ->add_option(
          "--method", o.method,
          "implicit: solves (1 + lambda L^order) x = b; laplacian, bilaplacian: explicit steps; taubin: "
          "does not shrink; bilateral: filters normals, moves vertices after them; denoise: fits a quadric "
          "to every "
          "smooth side of a vertex, creases and corners come out sharp, then implicit; "
          "curvature-flow: implicit steps with fresh geometry, any lambda, the whole mesh in memory")
      ->capture_default_str()
      ->check(CLI::IsMember(
          {"implicit", "laplacian", "bilaplacian", "taubin", "bilateral", "denoise", "curvature-flow"}));
  command->add_option("--weights", o.weights, "cotangent: vertices stay in place along the surface; uniform")
      ->capture_default_str()
      ->check(CLI::IsMember({"cotangent", "uniform"}));
  command->add_option("--steps", o.steps, "how often; explicit methods want 10 to 100, others 1 to 3")
      ->capture_default_str();
  command
      ->add_option(
          "--lambda", o.lambda,
          "strength of a step, no unit: waves shorter than about 3 lambda^(1/2) edges (order 2: 3 "
          "lambda^(1/4)) lose "
          "more than half; implicit and denoise: up to 1e9, long waves by a coarse level (order 1 from 140, "
          "order 2 "
          "from 2300 on); curvature-flow: any; laplacian, taubin: up to 1, bilaplacian: up to 0.5; 0 = 10 "
          "for implicit, 1 for denoise, 0.5 for laplacian and taubin, 0.25 for bilaplacian, 1 for "
          "curvature-flow")
      ->capture_default_str();
  command
      ->add_option("--order", o.order,
                   "implicit, denoise, curvature-flow: 1 = membrane, 2 = thin plate (keeps more shape); 0 = "
                   "2 for denoise, "
                   "else 1")
      ->capture_default_str();
  command
      ->add_option("--degree", o.degree,
                   "implicit, denoise: Chebyshev steps, a ring each, without a coarse level; 0 = enough for "
                   "an error of "
                   "0.001")
      ->capture_default_str();
  command
      ->add_option("--tolerance", o.tolerance,
                   "no vertex moves farther than this, units of the mesh; 0 = no limit")
      ->capture_default_str();
  command
      ->add_option(
          "--feature-angle", o.feature_angle_deg,
          "edges whose faces open more, in degrees, are creases, smoothed along themselves only; 0 = none")
      ->capture_default_str();
  command->add_option("--normal-rounds", o.normal_rounds, "bilateral, denoise: rounds on normals")
      ->capture_default_str();
  command->add_option("--vertex-rounds", o.vertex_rounds, "bilateral: rounds on vertices")
      ->capture_default_str();
  command
      ->add_option(
          "--noise", o.noise,
          "denoise: standard deviation of the noise along the normal, units of the mesh; 0 = measured "
          "everywhere in the mesh itself")
      ->capture_default_str();
  cli::add_run_options(*command, arguments->state.run);
}

}  // namespace tessera
