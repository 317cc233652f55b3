#include <filesystem>
#include <memory>

#include <fmt/format.h>

#include "octree/error.h"
#include "stream/runtime/memory_budget.h"
#include "stream/survey/gdal_program.h"
#include "stream/survey/mesh_contours.h"
#include "tools/commands.h"
#include "tools/frame/cli.h"
#include "tools/frame/pipes.h"

namespace tessera {
namespace {

struct ContoursCommand {
  std::filesystem::path mesh, output;
  std::string input_format;  ///< of a mesh that comes through a pipe
  ContourOptions options;
  bool force = false;
};

void run_contours(ContoursCommand& command) {
  if (command.mesh.empty())
    throw UsageError("no mesh given; name one: tessera contours mesh.ply -o lines.gpkg --interval 0.5");
  cli::require_output(command.output);
  line_format(command.output);
  ContourOptions options = command.options;
  if (!(options.interval > 0.0))
    throw UsageError("--interval is missing: the height between two lines, in units of the mesh");
  const cli::PipedInput piped(command.mesh, command.input_format);
  cli::check_line_writes({command.mesh, options.crs}, {{command.output, "-o", existing_by(command.force)}});
  options.crs = surveyed_crs(command.mesh, options.crs);
  if (options.temp.empty()) options.temp = std::filesystem::temp_directory_path();
  if (options.memory_bytes == 0) options.memory_bytes = detect_memory_cap().bytes;
  const ContourReport report = write_contours(command.mesh, options, command.output);
  if (!report.warnings.empty()) fmt::print(stderr, "{}\n", report.warnings);
  fmt::print("{}: {} lines, {} of them closed, {} points, heights {:.10g} to {:.10g}\n",
             command.output.string(), report.lines, report.closed, report.points, report.lowest,
             report.highest);
  if (options.smooth > 0.0)
    fmt::print("{} lines are smooth, no point farther than {:g} from where the mesh has it\n",
               report.smoothed, options.smooth);
}

}  // namespace

cli::Command contours_command() {
  auto shared = std::make_shared<ContoursCommand>();
  ContoursCommand& c = *shared;
  OptionTable t;
  t.add("mesh", &c.mesh, "PLY, OBJ, STL, OFF or GLB").positional();
  cli::add_output(t, c.output, "lines to write: GeoPackage (.gpkg), .geojson or .dxf");
  cli::add_input_format(t, c.input_format);
  t.add("interval", &c.options.interval,
        "height between two lines, units of the mesh; lines lie at whole multiples of it")
      .at_least(0);
  t.add("index", &c.options.index, "every so many levels the line is an index line; 0 = none").at_least(0);
  t.add("smooth", &c.options.smooth,
        "how far lines may leave the mesh in plan to be smooth, units of the mesh; no line meets another one "
        "or itself by "
        "that; 0 = they lie on its faces")
      .at_least(0);
  t.add(
       "crs", &c.options.crs,
       "coordinate system of the mesh, EPSG:n, WKT or a file with it; default: what the .prj beside the mesh "
       "says")
      .shown_as("EPSG:n|FILE");
  cli::add_force(t, c.force);
  cli::add_threads(t, c.options.threads, "threads; never changes the result");
  t.add("memory", &c.options.memory_bytes, "cap on memory; larger meshes go through --temp").bytes();
  t.add("temp", &c.options.temp, "folder for scratch files; default: the system's");
  return {
      "contours",
      "Contour lines of a mesh, exact on its faces, closed or ending where the mesh does. Example: tessera "
      "contours site.ply -o lines.gpkg --interval 0.5 --smooth 0.2",
      t, [shared] { run_contours(*shared); }};
}

}  // namespace tessera
