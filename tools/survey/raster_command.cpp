#include <algorithm>
#include <cmath>
#include <filesystem>
#include <memory>
#include <string>
#include <vector>

#include <fmt/format.h>

#include "octree/error.h"
#include "stream/files/file_extension.h"
#include "stream/raster/mesh_raster.h"
#include "stream/runtime/memory_budget.h"
#include "stream/survey/gdal_program.h"
#include "tools/commands.h"
#include "tools/frame/cli.h"

namespace tessera {
namespace {

struct RasterCommand {
  std::filesystem::path mesh, output;
  std::vector<std::string> layers;
  RasterOptions options;
  bool force = false;
};

/// "dtm.tif" for one layer; "dtm.slope.tif" and so on for several.
std::filesystem::path layer_path(const RasterCommand& command, const std::string& layer) {
  if (command.layers.size() == 1) return command.output;
  std::filesystem::path path = command.output;
  return path.replace_extension("." + layer + command.output.extension().string());
}

std::vector<RasterOutput> raster_outputs(const RasterCommand& command) {
  std::vector<RasterOutput> outputs;
  const auto& names = raster_layer_names();
  for (const std::string& name : command.layers) {
    if (std::find(names.begin(), names.end(), name) == names.end())
      throw UsageError("--layer " + name + ": is none; there are " +
                       fmt::format("{}", fmt::join(names, ", ")));
    outputs.push_back({raster_layer(name), layer_path(command, name)});
  }
  return outputs;
}

void run_raster(const RasterCommand& given) {
  RasterCommand command = given;
  if (command.mesh.empty())
    throw UsageError("no mesh given; name one: tessera raster mesh.ply -o dtm.tif --cell 0.5");
  cli::require_output(command.output);
  const std::string extension = lower_extension(command.output);
  if (extension != ".tif" && extension != ".tiff")
    throw UsageError(command.output.string() + ": rasters are written as GeoTIFF, .tif");
  if (command.layers.empty()) command.layers = {"top"};
  RasterOptions& options = command.options;
  if (!(options.cell > 0.0)) throw UsageError("--cell is missing: the edge of a cell, in units of the mesh");
  if (!(std::abs(options.nodata) <= 3e38)) throw UsageError("--nodata: is no number that 32 bit floats hold");
  const std::vector<RasterOutput> outputs = raster_outputs(command);
  std::vector<PlannedWrite> writes;
  for (const RasterOutput& output : outputs)
    writes.push_back({output.path, "-o", existing_by(command.force)});
  cli::check_line_writes({command.mesh, options.crs}, writes);
  options.crs = surveyed_crs(command.mesh, options.crs);
  if (options.temp.empty()) options.temp = std::filesystem::temp_directory_path();
  if (options.memory_bytes == 0) options.memory_bytes = detect_memory_cap().bytes;
  const RasterReport report = write_rasters(command.mesh, options, outputs);
  if (!report.warnings.empty()) fmt::print(stderr, "{}", report.warnings);
  for (std::size_t k = 0; k < outputs.size(); ++k)
    fmt::print("{}: {}, {} x {} cells from {:.10g}, {:.10g} (upper left), {:.1f} % with a value\n",
               outputs[k].path.string(), name_of(outputs[k].layer), report.columns, report.rows, report.west,
               report.north,
               100.0 * static_cast<double>(report.values[k]) /
                   (static_cast<double>(report.columns) * static_cast<double>(report.rows)));
}

}  // namespace

cli::Command raster_command() {
  auto shared = std::make_shared<RasterCommand>();
  RasterCommand& c = *shared;
  OptionTable t;
  t.add("mesh", &c.mesh, "PLY, OBJ, STL, OFF or GLB").positional();
  cli::add_output(t, c.output,
                  "GeoTIFF to write, .tif; with several layers one file each, dtm.slope.tif for dtm.tif");
  t.add("cell", &c.options.cell,
        "edge of a cell, units of the mesh; edges of cells lie at whole multiples of it, so that rasters of "
        "one cell fit onto each other")
      .at_least(0);
  t.add("layer", &c.layers,
        "top: height of the highest face under the centre of a cell; ground: of the lowest; height: top less "
        "ground; slope: of the highest face, degrees; hillshade: light on it, 8 bits; ortho: its colour, "
        "holes transparent; missing: 1 where the mesh has a hole; default: top (repeatable)")
      .split()
      .shown_as("top|ground|height|slope|hillshade|ortho|missing");
  t.add("azimuth", &c.options.azimuth, "hillshade: where the sun stands, degrees clockwise from north")
      .within(-360, 360);
  t.add("altitude", &c.options.altitude, "hillshade: how high it stands, degrees").within(0, 90);
  t.add("nodata", &c.options.nodata, "value of cells without surface in layers of heights and slopes");
  t.add(
       "crs", &c.options.crs,
       "coordinate system of the mesh, EPSG:n, WKT or a file with it; default: what the .prj beside the mesh "
       "says")
      .shown_as("EPSG:n|FILE");
  cli::add_force(t, c.force);
  cli::add_threads(t, c.options.threads, "threads; never changes the result");
  t.add("tile", &c.options.tile,
        "edge of what is sampled at a time, cells; never changes the result; 0 = by the cap")
      .within(0, 8192);
  t.add("memory", &c.options.memory_bytes, "cap on memory; larger meshes go through --temp").bytes();
  t.add("temp", &c.options.temp, "folder for scratch files; default: the system's");
  return {
      "raster",
      "Heights, slopes, shading, orthophoto or holes of a mesh seen from above, as Cloud Optimised GeoTIFF. "
      "Examples: tessera raster site.ply -o dtm.tif --cell 0.5; tessera raster site.ply -o site.tif --cell "
      "0.1 "
      "--layer ground --layer hillshade --layer ortho",
      t, [shared] { run_raster(*shared); }};
}

}  // namespace tessera
