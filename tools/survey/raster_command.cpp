#include <algorithm>
#include <cmath>
#include <filesystem>
#include <memory>
#include <string>
#include <vector>

#include <fmt/format.h>

#include "octree/error.h"
#include "stream/files/file_extension.h"
#include "stream/formats/points/projection.h"
#include "stream/points/reconstruct_options.h"
#include "stream/raster/mesh_raster.h"
#include "stream/raster/scan_raster.h"
#include "stream/runtime/memory_budget.h"
#include "stream/survey/gdal_program.h"
#include "tools/commands.h"
#include "tools/frame/cli.h"
#include "tools/frame/pipes.h"

namespace tessera {
namespace {

constexpr double kAutoCell = 0.0;

struct RasterCommand {
  std::vector<std::string> inputs, layers, columns;
  std::string input_format;  ///< of a pipe
  std::filesystem::path output;
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

RasterReport mesh_rasters(const std::filesystem::path& mesh, RasterOptions options,
                          const std::vector<RasterOutput>& outputs) {
  if (options.cell == kAutoCell)
    throw UsageError("--cell is missing: the edge of a cell, in units of the mesh");
  for (const RasterOutput& output : outputs)
    if (!is_mesh_layer(output.layer))
      throw UsageError("--layer " + name_of(output.layer) + ": scans alone have it, and " + mesh.string() +
                       " is a mesh");
  options.crs = surveyed_crs(mesh, options.crs);
  return write_rasters(mesh, options, outputs);
}

RasterReport rasters_of(const std::vector<std::filesystem::path>& inputs, const RasterCommand& command,
                        const std::vector<RasterOutput>& outputs) {
  RasterOptions options = command.options;
  if (options.temp.empty()) options.temp = std::filesystem::temp_directory_path();
  if (options.memory_bytes == 0) options.memory_bytes = detect_memory_cap().bytes;
  const auto mesh = std::find_if(inputs.begin(), inputs.end(), is_mesh_input);
  if (mesh == inputs.end()) {
    if (!options.crs.empty()) options.crs = crs_text(options.crs, "--crs");
    return write_scan_rasters(inputs, options, command.columns, outputs);
  }
  if (inputs.size() > 1)
    throw UsageError(mesh->string() + " is a mesh: meshes are sampled one at a time; scans can be many");
  return mesh_rasters(*mesh, options, outputs);
}

void run_raster(const RasterCommand& given) {
  RasterCommand command = given;
  if (command.inputs.empty())
    throw UsageError(
        "no mesh or scan given; name one: tessera raster mesh.ply -o dtm.tif --cell 0.5, or tessera raster "
        "scan.laz -o top.tif");
  cli::require_output(command.output);
  const std::string extension = lower_extension(command.output);
  if (extension != ".tif" && extension != ".tiff")
    throw UsageError(command.output.string() + ": rasters are written as GeoTIFF, .tif");
  if (command.layers.empty()) command.layers = {"top"};
  if (!(std::abs(command.options.nodata) <= 3e38))
    throw UsageError("--nodata: is no number that 32 bit floats hold");
  const std::vector<RasterOutput> outputs = raster_outputs(command);
  const cli::PipedInput piped(command.inputs, command.input_format);
  const std::vector<std::filesystem::path> inputs = cli::expand_and_tell(command.inputs);
  std::vector<PlannedWrite> writes;
  for (const RasterOutput& output : outputs)
    writes.push_back({output.path, "-o", existing_by(command.force)});
  std::vector<std::filesystem::path> reads = cli::also_read(command.inputs);
  reads.insert(reads.end(), inputs.begin(), inputs.end());
  reads.push_back(command.options.crs);
  cli::check_line_writes(reads, writes);
  const RasterReport report = rasters_of(inputs, command, outputs);
  if (!report.warnings.empty()) fmt::print(stderr, "{}", report.warnings);
  for (std::size_t k = 0; k < outputs.size(); ++k)
    fmt::print("{}: {}, {} x {} cells from {:.10g}, {:.10g} (upper left), {:.1f} % with a value\n",
               outputs[k].path.string(), name_of(outputs[k].layer), report.columns, report.rows, report.west,
               report.north,
               100.0 * static_cast<double>(report.values[k]) /
                   (static_cast<double>(report.columns) * static_cast<double>(report.rows)));
  if (report.points > 0)
    fmt::print("{} points in cells of {:.10g}; left out: {}\n", report.points, report.cell, report.left_out);
}

}  // namespace

cli::Command raster_command() {
  auto shared = std::make_shared<RasterCommand>();
  RasterCommand& c = *shared;
  OptionTable t;
  t.add(
       "inputs", &c.inputs,
       "a mesh (PLY, OBJ, STL, OFF, GLB), or scans as one (LAS, LAZ, PLY without faces, E57, PCD, XYZ, PTX): "
       "files, folders, globs or @list")
      .positional();
  cli::add_output(t, c.output,
                  "GeoTIFF to write, .tif; with several layers one file each, dtm.slope.tif for dtm.tif");
  cli::add_input_format(t, c.input_format);
  t.add("cell", &c.options.cell,
        "edge of a cell, units of the input; edges of cells lie at whole multiples of it, so that rasters of "
        "one cell fit onto each other; auto: of scans two spacings, rounded up to 1, 2 or 5 times a power of "
        "ten; meshes need a number")
      .at_least(0)
      .or_word("auto", kAutoCell);
  t.add(
       "layer", &c.layers,
       "top: height of the highest face under the centre of a cell, of scans of the highest point in it; "
       "ground: of the lowest face, of scans of the lowest point of class 2; height: top less "
       "ground; slope: of the highest face, degrees; hillshade: light on it, 8 bits; ortho: its colour, "
       "of scans that of the points up to half a cell below the highest, holes transparent; missing: 1 where "
       "the mesh or the scan has a hole; count: points in the cell; intensity: mean of those that ortho "
       "takes; "
       "default: top (repeatable)")
      .split()
      .shown_as("top|ground|height|slope|hillshade|ortho|missing|count|intensity");
  t.add("azimuth", &c.options.azimuth, "hillshade: where the sun stands, degrees clockwise from north")
      .within(-360, 360);
  t.add("altitude", &c.options.altitude, "hillshade: how high it stands, degrees").within(0, 90);
  t.add("nodata", &c.options.nodata, "value of cells without one in layers of floats");
  t.add("crs", &c.options.crs,
        "coordinate system of the input, EPSG:n, WKT or a file with it; default: what the .prj beside the "
        "mesh "
        "or the scan says")
      .shown_as("EPSG:n|FILE");
  add_columns(t, c.columns);
  cli::add_force(t, c.force);
  cli::add_threads(t, c.options.threads, "threads; never changes the result");
  t.add("tile", &c.options.tile,
        "edge of what is sampled at a time, cells; never changes the result; 0 = by the cap")
      .within(0, 8192);
  t.add("memory", &c.options.memory_bytes, "cap on memory; larger meshes and scans go through --temp")
      .bytes();
  t.add("temp", &c.options.temp, "folder for scratch files; default: the system's");
  return {
      "raster",
      "Heights, slopes, shading, orthophoto or holes of a mesh, or heights, colours, intensities and numbers "
      "of points of scans, seen from above, as Cloud Optimised GeoTIFF. "
      "Examples: tessera raster site.ply -o dtm.tif --cell 0.5; tessera raster site.ply -o site.tif --cell "
      "0.1 --layer ground --layer hillshade --layer ortho; tessera raster flight/*.laz -o flight.tif --layer "
      "count,top,ortho",
      t, [shared] { run_raster(*shared); }};
}

}  // namespace tessera
