#include <cstdio>
#include <cstdlib>
#include <iostream>
#include <memory>
#include <sstream>

#include <fmt/format.h>

#include "octree/error.h"
#include "stream/render/render.h"
#include "stream/runtime/memory_budget.h"
#include "stream/runtime/stop.h"
#include "tools/cli.h"
#include "tools/commands.h"

namespace tessera {
namespace {

struct RenderCommand {
  RenderOptions options;
  int threads = 0;
  bool quiet = false;
  bool sheet = false;  ///< what no --view means anyway; scripts may say it
};

void parse_size(const std::string& text, RenderOptions& options) {
  int used = 0;
  if (std::sscanf(text.c_str(), "%6dx%6d%n", &options.width, &options.height, &used) != 2 ||
      static_cast<std::size_t>(used) != text.size()) {
    throw UsageError("--size " + text + ": expected WIDTHxHEIGHT in pixels, e.g. 1600x1200");
  }
}

std::vector<double> parse_numbers(const std::string& option, const std::string& text, std::size_t count) {
  std::vector<double> values;
  std::stringstream parts(text);
  std::string part;
  while (std::getline(parts, part, ',')) {
    char* end = nullptr;
    values.push_back(std::strtod(part.c_str(), &end));
    if (part.empty() || *end != '\0')
      throw UsageError(option + " " + text + ": '" + part + "' is not a number");
  }
  if (values.size() != count) {
    throw UsageError(option + " " + text + ": expected " + std::to_string(count) +
                     " numbers with commas between");
  }
  return values;
}

Double3 parse_up(const std::string& text) {
  if (text == "x") return {1, 0, 0};
  if (text == "y") return {0, 1, 0};
  if (text == "z") return {0, 0, 1};
  return cli::parse_vector(text);
}

void run_render(const RenderCommand& command) {
  cli::require_inputs(command.options.inputs);
  cli::require_output(command.options.output);
  catch_stop_signals();
  // llvmpipe takes the number of its threads from the environment alone, when its library is loaded.
  if (command.threads > 0) ::setenv("LP_NUM_THREADS", std::to_string(command.threads).c_str(), 1);
  RenderOptions options = command.options;
  if (options.memory_bytes == 0) options.memory_bytes = detect_memory_cap().bytes;
  const RenderReport report = render(options);
  for (const std::string& notice : report.notices) std::cerr << "tessera: note: " << notice << "\n";
  if (command.quiet) return;
  fmt::print("{}: {}x{}", command.options.output.string(), command.options.width, command.options.height);
  if (report.faces > 0) {
    fmt::print(", {} vertices, {} faces, {} border edges, {} non-manifold edges", report.vertices,
               report.faces, report.border_edges, report.non_manifold_edges);
  }
  if (report.points > 0) fmt::print(", {} points", report.points);
  if (report.temp_bytes > 0) fmt::print(", {} temporary bytes", report.temp_bytes);
  fmt::print(" ({})\n", report.renderer);
}

}  // namespace

void add_render(CLI::App& app) {
  auto shared = std::make_shared<RenderCommand>();
  RenderOptions& o = shared->options;
  CLI::App* command =
      cli::add_command(app, "render", "Draw shaded pictures of meshes and point clouds (PNG).",
                       [shared] { run_render(*shared); });
  cli::add_inputs(*command, o.inputs);
  cli::add_output(*command, o.output, "picture to write, .png");
  CLI::Option* view = command
                          ->add_option("--view", o.views,
                                       "front, back, left, right, top, bottom, iso, iso2, turn:DEGREES or "
                                       "custom; several make a sheet "
                                       "(default: iso,iso2,front,top)")
                          ->delimiter(',');
  command->add_flag("--sheet", shared->sheet, "four views in one picture: iso, iso2, front, top; the default")
      ->excludes(view);
  command
      ->add_option_function<std::string>(
          "--size", [&o](const std::string& text) { parse_size(text, o); }, "pixels of the whole picture")
      ->type_name("WxH")
      ->default_str(fmt::format("{}x{}", o.width, o.height));
  command->add_option("--samples", o.samples, "samples per pixel and axis, 1 to 4")->capture_default_str();
  command
      ->add_option_function<std::string>(
          "--up", [&o](const std::string& text) { o.up = parse_up(text); },
          "which way is up: x, y, z or a vector x,y,z")
      ->type_name("AXIS")
      ->default_str("z");
  command
      ->add_option_function<std::string>(
          "--focus", [&o](const std::string& text) { o.focus = parse_numbers("--focus", text, 4); },
          "look at this ball only, scan units")
      ->type_name("X,Y,Z,RADIUS");
  command->add_option("--zoom", o.zoom, "enlarge after the fit")->capture_default_str();
  CLI::Option* eye =
      command
          ->add_option_function<std::string>(
              "--eye", [&o](const std::string& text) { o.eye = cli::parse_vector(text), o.has_eye = true; },
              "where the viewer stands (view custom), scan units")
          ->type_name("X,Y,Z");
  CLI::Option* target =
      cli::add_vector(*command, "--target", o.target, "what the viewer at --eye looks at, scan units");
  eye->needs(target);
  target->needs(eye);
  command->add_option("--colour,--color", o.colour, "auto, vertex, clay or height")->capture_default_str();
  command
      ->add_option("--deviation", o.deviation,
                   "colour every mesh by its distance to this one, with a scale beside the picture")
      ->type_name("FILE");
  command->add_option("--tolerance", o.tolerance,
                      "with --deviation: end of the scale, in the unit of the mesh; beyond it magenta [99th "
                      "percentile]");
  command->add_flag("--signed", o.with_sign,
                    "with --deviation: red in front of the reference, blue behind it");
  command
      ->add_option(
          "--borders", o.borders,
          "border edges in red, non-manifold edges in magenta: on, off, or auto (off where memory is short)")
      ->capture_default_str();
  command->add_flag("--smooth", o.smooth, "interpolate normals; default is one normal per face");
  command->add_flag("--wire", o.wire, "draw the edges of all faces");
  command->add_option("--occlusion", o.occlusion, "strength of ambient occlusion, 0 to 2")
      ->capture_default_str();
  command->add_option("--splat", o.splat, "diameter of points, scan units; 0 = from their spacing")
      ->capture_default_str();
  command->add_flag("!--no-captions", o.captions, "leave out names, counts and scale bars");
  command->add_option("--compare", o.compare,
                      "another file, same camera, drawn to the right; may be repeated");
  cli::add_columns(*command, o.columns);
  cli::add_bytes(
      *command, "--memory", o.memory_bytes,
      "cap on the peak resident memory, e.g. 512M; default: the smallest limit of this machine x 0.8");
  command->add_option("-t,--threads", shared->threads, "threads of the rasterizer; 0 = all cores")
      ->check(CLI::Range(0, 1024))
      ->capture_default_str();
  command->add_option("--temp", o.temp,
                      "folder for the temporary file of meshes over the cap; default: beside the output");
  command->add_flag("-q,--quiet", shared->quiet, "print nothing but notes and errors");
}

}  // namespace tessera
