#include <cmath>
#include <filesystem>
#include <iostream>
#include <memory>
#include <string>

#include "octree/error.h"
#include "stream/files/file_extension.h"
#include "stream/files/json.h"
#include "stream/files/path_text.h"
#include "stream/files/planned_writes.h"
#include "stream/runtime/memory_budget.h"
#include "stream/survey/gdal_program.h"
#include "stream/survey/pages/volume_page.h"
#include "stream/volume/mesh_volume.h"
#include "tools/commands.h"
#include "tools/frame/cli.h"
#include "tools/survey/scan_outputs.h"

namespace tessera {
namespace {

struct VolumeCommand {
  std::filesystem::path mesh;
  std::string base;
  VolumeOptions options;
  double tolerance = -1.0, base_tolerance = -1.0;
  std::filesystem::path csv, json, page;
  bool force = false;
};

constexpr const char* kPlane = "plane:";
constexpr double kMaxLevel = 1e12;  ///< beyond any survey; what lies so far off has no volume in doubles

double level_of(const std::string& base) {
  const std::string number = base.substr(std::string(kPlane).size());
  std::size_t used = 0;
  double level = 0.0;
  try {
    level = std::stod(number, &used);
  } catch (const std::exception&) {
    used = 0;
  }
  if (used == 0 || used != number.size() || !(std::abs(level) <= kMaxLevel))
    throw UsageError("--base " + base + ": give plane:Z with a number, as plane:251.5, or a mesh");
  return level;
}

/// Reads --base: a level, a toe, a raster or a mesh.
void read_base(const std::string& base, VolumeOptions& options) {
  const std::string extension = lower_extension(base);
  if (base.rfind(kPlane, 0) == 0) {
    options.kind = VolumeBase::kLevel, options.level = level_of(base);
  } else if (base == "toe" || base == "toe-plane") {
    options.kind = base == "toe" ? VolumeBase::kToe : VolumeBase::kToePlane;
    if (options.areas.empty())
      throw UsageError("--base " + base +
                       ": is spanned by the outlines of polygons; name them with --within");
  } else {
    options.base = base;
    options.kind = extension == ".tif" || extension == ".tiff" ? VolumeBase::kRaster : VolumeBase::kMesh;
  }
}

void check_noise(const VolumeOptions& options) {
  const auto check = [](const HeightNoise& noise, const std::string& name, const std::string& prefix) {
    if (noise.known() && !(noise.range() > 0.0))
      throw UsageError(
          name + ": says nothing of a volume without the distance over which errors average out: give " +
          prefix + "spacing, of points with independent errors, or " + prefix + "noise-length");
    if (!noise.known() && noise.range() > 0.0)
      throw UsageError(name + " is missing: the standard deviation of heights");
  };
  check(options.noise, "--noise", "--");
  check(options.base_noise, "--base-noise", "--base-");
  if (options.base_noise.known() && options.base.empty())
    throw UsageError("--base-noise: only a mesh or a raster as --base has noise of its own");
}

void check_map(const VolumeOptions& options) {
  if (options.map.empty() && options.cell == 0.0) return;
  if (options.map.empty()) throw UsageError("--cell: is of the raster that --map names");
  const std::string extension = lower_extension(options.map);
  if (extension != ".tif" && extension != ".tiff")
    throw UsageError("--map " + options.map.string() + ": rasters are written as GeoTIFF, .tif");
  if (!(options.cell > 0.0))
    throw UsageError("--cell is missing: the edge of a cell of --map, in units of the mesh");
}

void run_volume(const VolumeCommand& command) {
  if (command.mesh.empty())
    throw UsageError("no mesh given; name one: tessera volume new.ply --base old.ply");
  if (command.base.empty())
    throw UsageError("--base is missing: an earlier mesh, a raster, toe, or plane:Z for a level");
  VolumeOptions options = command.options;
  read_base(command.base, options);
  check_noise(options);
  check_map(options);
  cli::check_line_writes({command.mesh, options.base, options.areas, options.crs},
                         {{command.csv, "--csv", existing_by(command.force)},
                          {command.json, "--json", existing_by(command.force)},
                          {command.page, "--page", existing_by(command.force)},
                          {options.map, "--map", existing_by(command.force)}});
  require_page_name(command.page);
  const bool uses_gdal = options.kind == VolumeBase::kRaster || !options.map.empty();
  if (uses_gdal) {
    gdal_program();  // before the work
    options.crs = surveyed_crs(command.mesh, options.crs);
  }
  options.tolerance =
      command.tolerance >= 0.0 ? command.tolerance : proven_tolerance(command.mesh).value_or(-1.0);
  if (!options.base.empty())
    options.base_tolerance = command.base_tolerance >= 0.0 ? command.base_tolerance
                                                           : proven_tolerance(options.base).value_or(-1.0);
  if (options.temp.empty()) options.temp = std::filesystem::temp_directory_path();
  if (options.memory_bytes == 0) options.memory_bytes = detect_memory_cap().bytes;
  const MeshVolumes volumes = measure_volumes(command.mesh, options);
  std::cerr << volumes.warnings << std::flush;
  std::cout << describe(volumes) << std::flush;
  if (!volumes.areas.front().bound)
    std::cout
        << "how far the volumes may be off is unknown: no report beside the meshes proves a distance; give "
           "--tolerance (and --base-tolerance)\n"
        << std::flush;
  write_text_output(command.csv, to_csv(volumes));
  if (!command.page.empty())
    write_text_output(command.page,
                      survey_page_text(volume_page(volumes, command.mesh, command.base, options)));
  if (command.json.empty()) return;
  Json report = to_json(volumes);
  report["mesh"] = json_text(command.mesh);
  report["base"] = options.kind == VolumeBase::kLevel ? Json(options.level) : Json(json_text(command.base));
  if (options.tolerance >= 0.0) report["tolerance"] = options.tolerance;
  if (!options.base.empty() && options.base_tolerance >= 0.0)
    report["base_tolerance"] = options.base_tolerance;
  const auto noise_json = [](const HeightNoise& noise) {
    return Json{{"deviation", noise.deviation}, {"spacing", noise.spacing}, {"length", noise.length}};
  };
  if (options.noise.known()) report["noise"] = noise_json(options.noise);
  if (options.base_noise.known()) report["base_noise"] = noise_json(options.base_noise);
  if (!options.map.empty()) report["map"] = json_text(options.map);
  write_text_output(command.json, dump_json(report, 2) + "\n");
}

void add_noise_options(OptionTable& t, VolumeOptions& o) {
  t.add("noise", &o.noise.deviation,
        "standard deviation of the heights of the points that the mesh was made of: gives a statistical "
        "bound (95 %) "
        "beside the proven one; 0 = unknown")
      .at_least(0);
  t.add("spacing", &o.noise.spacing,
        "for --noise: spacing of those points, where their errors are independent")
      .at_least(0);
  t.add("noise-length", &o.noise.length,
        "for --noise: length over which errors hang together, as those of dense matching or of a moving "
        "scanner do")
      .at_least(0);
  t.add("base-noise", &o.base_noise.deviation, "the same of the base, a mesh or a raster").at_least(0);
  t.add("base-spacing", &o.base_noise.spacing, "for --base-noise; of a raster at least its cell").at_least(0);
  t.add("base-noise-length", &o.base_noise.length, "for --base-noise").at_least(0);
}

}  // namespace

cli::Command volume_command() {
  auto shared = std::make_shared<VolumeCommand>();
  VolumeCommand& c = *shared;
  OptionTable t;
  t.add("mesh", &c.mesh, "PLY, OBJ, STL, OFF or GLB").positional();
  t.add("base", &c.base,
        "what volumes are counted from: plane:Z, a level; toe, what the outline of each polygon spans, "
        "triangulated; "
        "toe-plane, the plane that fits that outline best; a raster of heights (GeoTIFF, one band); or an "
        "earlier "
        "mesh, open and seen from above")
      .shown_as("plane:Z|toe|toe-plane|FILE");
  t.add("within", &c.options.areas,
        "polygons (GeoJSON, in the coordinates of the mesh), a row of figures each; default: wherever both "
        "are");
  t.add(
       "toe-gap", &c.options.toe_gap,
       "longest piece of an outline without mesh that a toe line runs straight over; a longer one is refused")
      .at_least(0);
  t.add("tolerance", &c.tolerance,
        "distance that the mesh keeps from its surface, which bounds what the volumes may be off; default: "
        "what its report "
        "proves; -1 = unknown")
      .at_least(-1);
  t.add("base-tolerance", &c.base_tolerance, "the same of the base").at_least(-1);
  add_noise_options(t, c.options);
  t.add("map", &c.options.map,
        "also write a raster of heights of the mesh less those of the base (GeoTIFF), within the polygons");
  t.add("cell", &c.options.cell, "edge of a cell of --map, units of the mesh").at_least(0);
  t.add("crs", &c.options.crs,
        "coordinate system of the mesh, for --map and rasters: EPSG:n, WKT or a file with it; default: what "
        "the .prj "
        "beside the mesh says")
      .shown_as("EPSG:n|FILE");
  t.add("csv", &c.csv, "also write the rows to this file");
  t.add("page", &c.page,
        "also write a page to read and to print: figures, and the polygons from above (.html)")
      .shown_as("FILE.html");
  t.add("json,report", &c.json, "also write the result to this file");
  cli::add_force(t, c.force);
  cli::add_threads(t, c.options.threads, "threads; never changes the result");
  t.add("memory", &c.options.memory_bytes, "cap on memory; larger meshes go through --temp").bytes();
  t.add("temp", &c.options.temp, "folder for scratch files; default: the system's");
  return {"volume",
          "Cut, fill and net volume against a level, a toe line, a raster or an earlier mesh. Examples: "
          "tessera volume "
          "new.ply --base old.ply --within areas.geojson; tessera volume heaps.ply --base toe --within "
          "heaps.geojson "
          "--map height.tif --cell 0.25",
          t, [shared] { run_volume(*shared); }};
}

}  // namespace tessera
