#include <array>
#include <cmath>
#include <memory>
#include <optional>

#include <fmt/format.h>

#include "octree/error.h"
#include "stream/commands/convert_mesh.h"
#include "stream/commands/convert_points.h"
#include "stream/files/file_extension.h"
#include "stream/files/planned_writes.h"
#include "stream/files/scratch_folder.h"
#include "stream/formats/meshes/mesh_precision.h"
#include "stream/formats/points/projection.h"
#include "stream/points/reconstruct_options.h"
#include "stream/runtime/memory_budget.h"
#include "stream/runtime/numbers.h"
#include "stream/runtime/parallel.h"
#include "stream/runtime/stage_runner.h"
#include "stream/runtime/stop.h"
#include "stream/stages/scan/thin_stage.h"
#include "stream/stages/scan/unpack_stage.h"
#include "stream/survey/gdal_program.h"
#include "tools/commands.h"
#include "tools/frame/cli.h"
#include "tools/frame/pipes.h"

namespace tessera {
namespace {

struct ConvertCommand {
  std::vector<std::string> inputs;
  std::filesystem::path output;
  ConvertOptions options;
  bool floats = false;
  bool force = false;
  ConvertTinOptions tin;
  std::string crs, unit = "auto", overhangs = "refuse", groups = "none";
  std::string input_format, output_format;  ///< of pipes
  bool piped = false;                       ///< results go to standard output

  std::FILE* say() const { return piped ? stderr : stdout; }
  std::string shown_output() const { return piped ? "standard output" : output.string(); }
};

/// From here on many CAD programs become slow or take no more.
constexpr std::uint64_t kManyCadFaces = 4'000'000;

/// Metres of a unit of length to what LandXML calls it.
TinUnit tin_unit(const ConvertCommand& command, const Crs& crs) {
  if (command.unit == "metre") return TinUnit::kMetre;
  if (command.unit == "foot") return TinUnit::kFoot;
  if (command.unit == "us-foot") return TinUnit::kSurveyFoot;
  if (crs.geographic)
    throw UsageError(
        command.output.string() +
        ": the mesh is in degrees, and a TIN wants a plane; reconstruct it with --project, or name "
        "the unit with --unit");
  const double metres = plane_unit(crs);
  if (metres == 0.0 || metres == 1.0) return TinUnit::kMetre;
  if (std::abs(metres - 0.3048) < 1e-9) return TinUnit::kFoot;
  if (std::abs(metres - 1200.0 / 3937.0) < 1e-9) return TinUnit::kSurveyFoot;
  throw UsageError(fmt::format(
      "{}: the unit of its coordinate system is {:.10g} m, for which LandXML has no word; name one "
      "that coordinates shall count as with --unit",
      command.output.string(), metres));
}

/// Metres of the unit that 3MF shall tell: --unit, else that of the coordinate system beside the mesh; 0 = neither is known.
double threemf_unit(const ConvertCommand& command, const std::filesystem::path& mesh) {
  if (command.unit == "metre") return 1.0;
  if (command.unit == "millimetre") return 1e-3;
  if (command.unit == "centimetre") return 1e-2;
  if (command.unit == "inch") return 0.0254;
  if (command.unit == "foot") return 0.3048;
  if (command.unit == "us-foot") return 1200.0 / 3937.0;
  const std::string text = surveyed_crs(mesh, command.crs);
  if (text.empty()) return 0.0;
  const Crs crs = user_crs(text, "the coordinate system of " + mesh.string());
  if (crs.geographic)
    throw UsageError(
        command.output.string() +
        ": the mesh is in degrees, and 3MF wants lengths; reconstruct it with --project, or name "
        "the unit with --unit");
  return plane_unit(crs);
}

/// What an output for CAD programs is told; options of these are refused for other outputs.
ConvertTinOptions tin_options(const ConvertCommand& command, const std::filesystem::path& mesh) {
  ConvertTinOptions tin = command.tin;
  if (!is_tin_file(command.output)) {
    const bool threemf = lower_extension(command.output) == ".3mf";
    if (tin.breaklines > 0.0 || tin.max_faces > 0 || command.overhangs != "refuse" ||
        (!threemf && (!command.crs.empty() || command.unit != "auto")))
      throw UsageError(
          "--breaklines, --max-faces, --overhangs, --unit and --crs are of outputs for CAD programs, .xml "
          "and .dxf, --unit and --crs of .3mf too");
    return tin;
  }
  if (command.unit == "millimetre" || command.unit == "centimetre" || command.unit == "inch")
    throw UsageError("--unit " + command.unit + " is of .3mf; a TIN takes metre, foot or us-foot");
  const std::string text = surveyed_crs(mesh, command.crs);
  if (!text.empty()) tin.crs = user_crs(text, "the coordinate system of " + mesh.string());
  tin.unit = tin_unit(command, tin.crs);
  tin.overhangs = command.overhangs == "drop"   ? TinOverhangs::kDrop
                  : command.overhangs == "keep" ? TinOverhangs::kKeep
                                                : TinOverhangs::kRefuse;
  return tin;
}

void tell_of_tin(const ConvertCommand& command, const ConvertMeshReport& report, const Crs& crs) {
  if (!is_tin_file(command.output)) return;
  if (command.tin.breaklines > 0.0)
    fmt::print(command.say(), "breaklines: {}, of {} edges\n", report.breaklines, report.break_edges);
  const std::uint64_t overhangs = report.tin.downward + report.tin.upright;
  if (overhangs > 0)
    fmt::print(stderr,
               "note: {} faces show down and {} stand upright: they are {} the TIN, which has one height "
               "everywhere\n",
               report.tin.downward, report.tin.upright, command.overhangs == "drop" ? "not in" : "kept in");
  if (!crs.known() && command.unit == "auto" && command.output.extension() != ".dxf")
    fmt::print(
        stderr,
        "note: no coordinate system is known (--crs), so lengths count as metres; --unit says otherwise\n");
  if (report.faces > kManyCadFaces)
    fmt::print(
        stderr,
        "note: {} faces are more than many CAD programs take, some {} million; tessera decimate makes fewer "
        "of them, --max-faces refuses more\n",
        report.faces, kManyCadFaces / 1'000'000);
}

void run_convert_mesh(const std::vector<std::filesystem::path>& inputs, const ConvertCommand& command) {
  ConvertMeshOptions options;
  options.floats = command.floats;
  options.check_stop = throw_if_stopped;
  const std::filesystem::path mesh = cli::one_input(inputs, "converted");
  options.tin = tin_options(command, mesh);
  options.groups = command.groups == "components";
  if (options.groups && lower_extension(command.output) != ".obj")
    throw UsageError("--groups is of outputs that have groups: .obj");
  if (lower_extension(command.output) == ".3mf") options.unit = threemf_unit(command, mesh);
  // What other programs are told of the coordinates of an STL.
  const PlannedWrite shift{stl_shift_path(command.output), "the origin beside -o",
                           existing_by(command.force)};
  check_writes(inputs, std::array{shift});
  const ConvertMeshReport report = convert_mesh(mesh, command.output, options);
  fmt::print(command.say(), "{}: {} vertices, {} faces, {} bytes{}\n", command.shown_output(),
             report.vertices, report.faces, report.bytes,
             report.welded ? " (vertices merged by position)" : "");
  if (options.groups) fmt::print(command.say(), "groups: {} components\n", report.groups);
  for (const std::string& note : report.notes) fmt::print(command.say(), "note: {}\n", note);
  if (report.rounding.largest > 0.0)
    fmt::print(command.say(), "positions: written as floats of 32 bits, which moves them by at most {}\n",
               bound_text(report.rounding.largest));
  const bool shifted = !shift.path.empty() && report.origin != Double3{0, 0, 0};
  if (shifted && command.piped)
    throw UsageError(
        "-o -: the STL needs an origin, which stands in a file beside it: name a file, or another format");
  if (shifted) fmt::print(stderr, "note: {}\n", stl_shift_notice(command.output, report.origin));
  for (const std::string& notice : threemf_notices(command.output, report.origin, report.unit))
    fmt::print(stderr, "note: {}\n", notice);
  for (const std::string& notice : rounding_notices(report.rounding))
    fmt::print(stderr, "note: {}\n", notice);
  tell_of_tin(command, report, options.tin.crs);
}

/// Runs the passes that deal points to cubes and keep one of each.
void thin(const std::vector<std::filesystem::path>& inputs, const ConvertOptions& options,
          const std::filesystem::path& work) {
  ReconstructOptions wanted = wanted_points(options.wanted);
  wanted.columns = options.columns;
  wanted.colour = "intensity";  // with colours, all that the points say
  wanted.normals = "estimate";  // none are made of rows and columns
  JobState state;
  state.work = work;
  state.inputs = inputs;
  state.settings = to_settings(wanted);
  state.run.memory_bytes = detect_memory_cap().bytes;
  state.run.threads = options.threads > 0 ? options.threads : core_count();
  run_stages(state,
             {{"unpack", [](const JobState& s) { return make_unpack_stage(s); }},
              {"thin", [](const JobState& s) { return make_thin_stage(s); }}},
             throw_if_stopped);
}

void convert(ConvertCommand& command) {
  const std::vector<std::filesystem::path> inputs = cli::expand_and_tell(command.inputs);
  std::vector<std::filesystem::path> reads = cli::also_read(command.inputs);
  reads.insert(reads.end(), inputs.begin(), inputs.end());
  cli::require_new_output(command.output, command.force, reads);
  if (converts_as_mesh(inputs.front(), command.output)) {
    const ReconstructOptions& w = command.options.wanted;
    if (!w.classes.empty() || w.returns != "all" || !w.bounds.empty() || !w.clip.empty() || w.thin > 0.0 ||
        w.resolution_limit > 0.0)
      throw UsageError(
          "--classes, --returns, --bounds, --clip, --thin and --resolution-limit choose points of scans, and "
          "this is a mesh");
    run_convert_mesh(inputs, command);
    return;
  }
  ConvertOptions& options = command.options;
  options.wanted.validate();
  std::optional<ScratchFolder> scratch;
  if (options.wanted.thin > 0.0) {
    scratch.emplace(std::filesystem::absolute(command.output).parent_path(), "thin");
    options.thinned = scratch->path();
    thin(inputs, options, options.thinned);
  }
  const ConvertReport report = convert_points(inputs, command.output, options);
  fmt::print(command.say(), "{}: {} points, {} bytes\n", command.shown_output(), report.points, report.bytes);
  if (report.unwanted > 0) fmt::print(command.say(), "not wanted: {} points\n", report.unwanted);
  const std::uint64_t dropped = report.not_finite + report.withheld + report.empty + report.missing;
  if (dropped > 0) {
    fmt::print(command.say(), "left out: {} not finite, {} withheld, {} empty, {} missing\n",
               report.not_finite, report.withheld, report.empty, report.missing);
  }
  for (const std::string& note : report.notes) fmt::print(command.say(), "note: {}\n", note);
}

void run_convert(ConvertCommand& command) {
  cli::require_inputs(command.inputs);
  const cli::Pipes pipes(command.inputs, command.input_format, command.output, command.output_format);
  command.piped = pipes.writes();
  convert(command);
  pipes.finish();
}

}  // namespace

cli::Command convert_command() {
  auto shared = std::make_shared<ConvertCommand>();
  ConvertCommand& c = *shared;
  OptionTable t;
  cli::add_inputs(t, c.inputs);
  cli::add_output(t, c.output,
                  "file to write: scans .ply (binary), .las (1.4), .laz, .copc.laz (COPC), .xyz; meshes "
                  ".ply, .obj, .stl, "
                  ".glb, for printing .3mf, for solvers .vtu (VTK) and .msh (Gmsh 4.1), and for CAD "
                  "programs .xml (LandXML 1.2) and .dxf (R12)");
  cli::add_input_format(t, c.input_format);
  t.add("output-format", &c.output_format,
        "format of an output that is a pipe (-o -), as an extension, e.g. ply");
  add_columns(t, c.options.columns);
  ReconstructOptions& w = c.options.wanted;
  t.add("classes", &w.classes, "scans: classes of points to keep, e.g. 2,6 (LAS, LAZ); default: all").split();
  t.add("returns", &w.returns, "scans: which returns of a pulse to keep (LAS, LAZ)")
      .one_of({"all", "first", "last"});
  t.add("bounds", &w.bounds, "scans: box of points to keep, X0,Y0,Z0,X1,Y1,Z1; of COPC the rest is not read")
      .split()
      .shown_as("BOX");
  t.add("clip", &w.clip,
        "scans: GeoJSON file of polygons in the coordinates of the scan: points outside them, as seen from "
        "above, are left out")
      .shown_as("FILE");
  t.add("resolution-limit", &w.resolution_limit,
        "COPC: read the levels of its octree up to the first whose points lie so close, scan units; 0 = all")
      .at_least(0);
  t.add("thin", &w.thin,
        "scans: one point is kept of every cube of this edge, the one nearest to its middle, scan units; in "
        "the "
        "order of cubes; 0 = all")
      .at_least(0);
  t.add("double", &c.options.force_double, "PLY: double coordinates even where floats are exact");
  t.add("las-scale", &c.options.las_scale,
        "step of LAS and LAZ coordinates, units of the scan; 0 = the finest power of ten that fits")
      .at_least(0);
  t.add("float", &c.floats,
        "PLY, OBJ of meshes: positions as floats even where the source has doubles; what that moves is told, "
        "and refused (6) where it breaks faces");
  t.add("breaklines", &c.tin.breaklines,
        "CAD: edges at which two faces turn by more than this angle become breaklines, degrees, e.g. 30; 0 = "
        "none")
      .within(0, 180);
  t.add("overhangs", &c.overhangs,
        "LandXML: faces that show down or stand upright, which a TIN of one height everywhere cannot have: "
        "refuse "
        "the mesh (6), drop them, or keep them for programs that take them")
      .one_of({"refuse", "drop", "keep"});
  t.add("max-faces", &c.tin.max_faces,
        "CAD: refuse (6) a mesh with more faces; 0 = any, and many are told of");
  t.add("unit", &c.unit,
        "LandXML, 3MF: unit of length; auto: that of the coordinate system or of the input, else metres of "
        "LandXML and millimetres of 3MF")
      .one_of({"auto", "metre", "foot", "us-foot", "millimetre", "centimetre", "inch"});
  t.add("groups", &c.groups,
        "OBJ: components: the faces of each piece of the mesh behind a group of its own (g component_1, "
        "...), in the "
        "order of their first vertices")
      .one_of({"none", "components"});
  t.add("crs", &c.crs,
        "CAD, 3MF: coordinate system of the mesh, EPSG:n, WKT or a file with it; default: what the .prj "
        "beside "
        "the mesh "
        "says")
      .shown_as("EPSG:n|FILE");
  cli::add_threads(t, c.options.threads, "threads; never changes the result");
  cli::add_force(t, c.force);
  return {"convert",
          "Write scans, or one mesh, into one file of another format. Examples: tessera convert mesh.ply -o "
          "mesh.glb; "
          "tessera convert site.ply -o site.xml --breaklines 30; zcat scan.xyz.gz | tessera convert - "
          "--input-format "
          "xyz -o - --output-format laz > scan.laz",
          t, [shared] { run_convert(*shared); }};
}

}  // namespace tessera
