#include <cstdio>
#include <cstdlib>
#include <iostream>
#include <memory>

#include <fmt/format.h>

#include "octree/error.h"
#include "stream/points/reconstruct_options.h"
#include "stream/render/render.h"
#include "stream/runtime/memory_budget.h"
#include "tools/commands.h"
#include "tools/frame/cli.h"
#include "tools/frame/pipes.h"

namespace tessera {
namespace {

struct RenderCommand {
  RenderOptions options;
  std::string input_format;  ///< of a pipe
  int threads = 0;
  bool quiet = false;
  bool force = false;
  bool sheet = false;  ///< what no --view means anyway; scripts may say it
};

void parse_size(const std::string& text, RenderOptions& options) {
  int used = 0;
  if (std::sscanf(text.c_str(), "%6dx%6d%n", &options.width, &options.height, &used) != 2 ||
      static_cast<std::size_t>(used) != text.size()) {
    throw UsageError("--size " + text + ": expected WIDTHxHEIGHT in pixels, e.g. 1600x1200");
  }
}

Double3 parse_up(const std::string& text) {
  if (text == "x") return {1, 0, 0};
  if (text == "y") return {0, 1, 0};
  if (text == "z") return {0, 0, 1};
  const std::vector<double> v = numbers_of(text, 3);
  if (v.empty()) throw UsageError("--up " + text + ": is not x, y, z or three numbers x,y,z");
  return {v[0], v[1], v[2]};
}

std::vector<double> parse_focus(const std::string& text) {
  std::vector<double> v = numbers_of(text, 4);
  if (v.empty()) throw UsageError("--focus " + text + ": expected four numbers with commas between");
  return v;
}

void run_render(RenderCommand& command) {
  cli::require_inputs(command.options.inputs);
  cli::require_output(command.options.output);
  if (command.sheet && !command.options.views.empty())
    throw UsageError("--sheet excludes --view: it is four views of its own");
  if (command.options.eye.has_value() != command.options.target.has_value())
    throw UsageError("--eye needs --target, and --target needs --eye");
  const cli::PipedInput piped(command.options.inputs, command.input_format);
  const RenderOptions& requested = command.options;
  std::vector<std::filesystem::path> reads = cli::also_read(requested.inputs);
  for (const std::vector<std::string>& names : {requested.inputs, requested.compare})
    for (const std::filesystem::path& file : expand_inputs(names)) reads.push_back(file);
  reads.push_back(requested.deviation);
  reads.push_back(requested.uncertain);
  reads.push_back(requested.missing);
  cli::require_new_output(requested.output, command.force, reads);
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
  if (command.options.crossings) fmt::print(", {} faces cross or touch others", report.crossing_faces);
  if (report.pages > 0) fmt::print(", {} pages of textures", report.pages);
  if (report.points > 0) fmt::print(", {} points", report.points);
  if (report.measured_points > 0) {
    fmt::print(
        ", {:.2f} % of {} points of {} farther than {:.4g} from the mesh",
        100.0 * static_cast<double>(report.missing_points) / static_cast<double>(report.measured_points),
        report.measured_points, command.options.missing.filename().string(), report.missing_distance);
  }
  if (report.temp_bytes > 0) fmt::print(", {} temporary bytes", report.temp_bytes);
  fmt::print(" ({})\n", report.renderer);
}

}  // namespace

cli::Command render_command() {
  auto shared = std::make_shared<RenderCommand>();
  RenderOptions& o = shared->options;
  OptionTable t;
  cli::add_inputs(t, o.inputs);
  cli::add_output(t, o.output, "picture to write, .png");
  cli::add_input_format(t, shared->input_format);
  t.add("view", &o.views,
        "front, back, left, right, top, bottom, iso, iso2, turn:DEGREES or custom (--eye); several make a "
        "sheet; default: iso,iso2,front,top")
      .split();
  t.add("sheet", &shared->sheet, "four views in one picture: iso, iso2, front, top; the default");
  t.add("size", OptionSetter([&o](const std::string& text) { parse_size(text, o); }),
        fmt::format("pixels of the whole picture; default: {}x{}", o.width, o.height))
      .shown_as("WxH");
  t.add("samples", &o.samples, "samples per pixel and axis, 1 to 4");
  t.add("up", OptionSetter([&o](const std::string& text) { o.up = parse_up(text); }),
        "which way is up: x, y, z or a vector x,y,z; default: z")
      .shown_as("AXIS");
  t.add("focus", OptionSetter([&o](const std::string& text) { o.focus = parse_focus(text); }),
        "look at this ball only, scan units")
      .shown_as("X,Y,Z,RADIUS");
  t.add("zoom", &o.zoom, "enlarge after the fit");
  t.add("eye", &o.eye, "where the viewer stands (view custom), scan units");
  t.add("target", &o.target, "what the viewer at --eye looks at, scan units");
  t.add("colour,color", &o.colour,
        "texture (pages of textures of GLB, OBJ and PLY), vertex, clay, height, or auto: the first of "
        "textures, colours of vertices and clay that the mesh has");
  t.add("deviation", &o.deviation,
        "colour every mesh by its distance to this one, with a scale beside the picture");
  t.add(
      "tolerance", &o.tolerance,
      "with --deviation: end of the scale, in the unit of the mesh, beyond it magenta; 0 = 99th percentile");
  t.add("signed", &o.with_sign, "with --deviation: red in front of the reference, blue behind it");
  t.add("missing", &o.missing,
        "a scan: its points far from the mesh in magenta over it, to see what was left out; of a sample of "
        "half a "
        "million")
      .shown_as("SCAN");
  t.add("missing-distance", &o.missing_distance,
        "with --missing: how far, scan units; 0 = two spacings of the scan, estimated from what it covers");
  t.add("uncertain", &o.uncertain,
        "OUT.uncertain.ply of a reconstruction: meshes in red where the sides of its points were in doubt");
  t.add("borders", &o.borders,
        "border edges in red, non-manifold edges in magenta: on, off, or auto (off where memory is short, "
        "and red ones with "
        "--uncertain)");
  t.add("crossings", &o.crossings,
        "faces that cross, overlap or touch others beyond what they share in green, with their edges");
  t.add("backs", &o.backs,
        "faces seen from behind: show (orange), cut (left out), or auto: cut for rooms, so that the near "
        "walls do "
        "not hide what is inside");
  t.add("synthetic", &o.synthetic, "faces that close holes in blue, over colours of the file too");
  t.add("shade", &o.shade,
        "plain; gloss: as lacquer, to see what is uneven; lines: reflections of light tubes, which break at "
        "creases and "
        "waver where the surface does; best with --smooth")
      .shown_as("plain|gloss|lines");
  t.add("smooth", &o.smooth, "interpolate normals; default is one normal per face");
  t.add("wire", &o.wire, "draw the edges of all faces");
  t.add("occlusion", &o.occlusion, "strength of ambient occlusion, 0 to 2");
  t.add("splat", &o.splat, "diameter of points, scan units; 0 = from their spacing");
  t.add_flag(
      "no-captions", [&o] { o.captions = false; }, "leave out names, counts and scale bars");
  t.add("compare", &o.compare, "another file, same camera, drawn to the right; may be repeated")
      .shown_as("FILE");
  add_columns(t, o.columns);
  t.add("memory", &o.memory_bytes,
        "cap on the peak resident memory, e.g. 512M; default: the smallest limit of this machine x 0.8")
      .bytes();
  cli::add_threads(t, shared->threads, "threads of the rasterizer");
  t.add("temp", &o.temp, "folder for the temporary file of meshes over the cap; default: beside the output");
  cli::add_force(t, shared->force);
  t.add("quiet,q", &shared->quiet, "print nothing but notes and errors");
  return {"render", "Draw shaded pictures of meshes and point clouds (PNG).", t,
          [shared] { run_render(*shared); }};
}

}  // namespace tessera
