#include <fmt/format.h>

#include "octree/error.h"
#include "stream/commands/convert_mesh.h"
#include "stream/files/json.h"
#include "stream/runtime/memory_budget.h"
#include "stream/stages/bake/texture_colours.h"
#include "stream/stages/tiles/point_site.h"
#include "tools/commands.h"
#include "tools/frame/cli.h"
#include "tools/frame/site.h"

namespace tessera {
namespace {

/// Scans: no job, so what is of jobs alone is refused rather than passed over.
void run_point_tiles(const TilesOptions& options, const JobState& state) {
  const RunOptions& run = state.run;
  if (options.has_texture())
    throw UsageError("--texture is of meshes, and " + state.inputs.front().string() + " is a scan");
  if (options.normals || options.tile_faces != TilesOptions{}.tile_faces)
    throw UsageError("--normals and --tile-faces are of meshes, and " + state.inputs.front().string() +
                     " is a scan");
  if (!run.until.empty() || run.keep || run.processes || run.tile_cells != 0 || !run.temp.empty() ||
      !run.log.empty() || !run.report.empty())
    throw UsageError(
        "scans become tiles in one go: --until, --keep, --processes, --tile-size, --temp, --log and --report "
        "are of "
        "meshes");
  const cli::Site site(state.output, "-o");
  site.check(state);
  if (std::filesystem::exists(site.tileset()) && !run.force)
    throw UsageError(site.tileset().string() + " exists; give --force to write it anew");
  PointSiteOptions wanted;
  wanted.inputs = state.inputs;
  wanted.site = site.tileset().parent_path();
  wanted.memory_bytes = run.memory_bytes > 0 ? run.memory_bytes : detect_memory_cap().bytes;
  wanted.threads = run.threads;
  const PointSiteReport report = write_point_site(wanted);
  if (run.verbosity < 0) return;
  fmt::print("{}: {} points in {} tiles of {} levels, {}, {:.2f} bytes a point\n", site.tileset().string(),
             report.points, report.tiles, report.levels, format_bytes(report.bytes),
             static_cast<double>(report.bytes) / static_cast<double>(report.points));
  if (report.not_finite > 0) fmt::print("left out: {} not finite\n", report.not_finite);
  if (!report.frame.warning.empty()) fmt::print(stderr, "note: {}\n", report.frame.warning);
  for (const std::string& note : report.notes) fmt::print(stderr, "note: {}\n", note);
}

void run_tiles(const TilesOptions& options, JobState state) {
  if (!converts_as_mesh(state.inputs.front(), "a.ply")) {
    cli::require_output(state.output);
    run_point_tiles(options, state);
    return;
  }
  const std::filesystem::path input = cli::one_input(state.inputs, "cut into tiles");
  cli::require_output(state.output);
  const cli::Site site(state.output, "-o");
  if (!options.has_texture() && has_textures(input))
    fmt::print(stderr, "tessera: warning: {}: its textures are left out; --texture auto bakes them anew\n",
               input.string());
  const Json report = site.make(options, state, false);
  if (state.run.verbosity < 0) return;
  cli::print_repairs(input.string(), report);
  cli::print_site(site, report);
}

}  // namespace

cli::Command tiles_command() {
  return cli::job_command<TilesOptions>(
      "tiles",
      "A mesh of any size becomes 3D Tiles: levels of detail that browsers stream, with proven errors; scans "
      "become tiles of points. Examples: tessera tiles mesh.ply -o site/; tessera tiles scans/*.laz -o "
      "points/",
      "the folder to write: its tileset.json is what viewers open", run_tiles);
}

}  // namespace tessera
