#include "stream/survey/mesh_contours.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <vector>

#include <fmt/format.h>

#include "kernels/survey/contour_chains.h"
#include "octree/error.h"
#include "stream/files/direct_file.h"
#include "stream/files/file_extension.h"
#include "stream/files/json.h"
#include "stream/files/path_text.h"
#include "stream/files/scratch_folder.h"
#include "stream/import/import_mesh.h"
#include "stream/meshes/mesh_store.h"
#include "stream/runtime/memory_budget.h"
#include "stream/runtime/parallel.h"
#include "stream/runtime/stop.h"
#include "stream/survey/gdal_program.h"
#include "stream/survey/line_chains.h"
#include "stream/survey/raw_lines.h"

namespace tessera {
namespace {

constexpr double kMaxLevels = 1e6;

void chain_patch(const MeshStore& store, std::size_t patch, const ContourLevels& levels, ChainFile& file) {
  const MeshPatchEntry& entry = store.patches()[patch];
  const std::int64_t end = levels.above(entry.box.high[2]), first = levels.above(entry.box.low[2]);
  if (first < end) chain_levels(store.load(std::array{patch}), levels, first, end, 0, file);
}

}  // namespace

std::string line_format(const std::filesystem::path& output) {
  const std::string extension = lower_extension(output);
  if (extension == ".gpkg") return "GPKG";
  if (extension == ".geojson" || extension == ".json") return "GeoJSON";
  if (extension == ".dxf") return "DXF";
  throw UsageError(output.string() + ": lines are written as .gpkg, .geojson or .dxf");
}

ContourReport write_contours(const std::filesystem::path& mesh, const ContourOptions& options,
                             const std::filesystem::path& output) {
  gdal_program();  // before the work
  const ScratchFolder scratch(options.temp, "contours");
  RunOptions run;
  run.memory_bytes = options.memory_bytes;
  run.threads = options.threads > 0 ? options.threads : core_count();
  const MeshStore store = import_mesh(mesh, scratch.path(), "mesh", run, throw_if_stopped);
  const ContourLevels levels{0.0, options.interval};
  const double low = store.box().low[2], high = store.box().high[2];
  if (!((high - low) / options.interval <= kMaxLevels &&
        std::max(std::abs(low), std::abs(high)) / options.interval < 0x1p52))
    throw UsageError(
        fmt::format("--interval {:g}: makes {:.3g} levels of {:.6g} to {:.6g}, at most {:.3g} are possible",
                    options.interval, (high - low) / options.interval, low, high, kMaxLevels));

  WorkerPool pool(run.threads);
  MemoryBudget budget(options.memory_bytes, resident_bytes());
  ChainFile file(scratch.path());
  chain_patches(store, pool, budget, chain_bytes,
                [&](std::size_t p) { chain_patch(store, p, levels, file); });
  const ChainGraph graph(file, budget, "contours");
  ContourReport report;
  const std::filesystem::path raw = scratch.path() / "lines.raw";
  DirectFile lines(raw);
  for (const ChainedLine& line : graph.lines()) {
    throw_if_stopped();
    const std::vector<Double2> points = graph.points(line);
    if (points.empty()) continue;
    RawLine header;
    header.value = levels.height(line.level);
    header.index = options.index > 0 && line.level % options.index == 0 ? 1 : 0;
    header.closed = line.closed ? 1 : 0;
    header.count = points.size();
    lines.write(&header, sizeof header);
    for (const Double2& p : points) {
      const Double3 place = {p[0], p[1], header.value};
      lines.write(&place, sizeof place);
    }
    if (report.lines == 0) report.lowest = header.value;
    report.highest = header.value;
    ++report.lines, report.closed += header.closed, report.points += points.size();
  }
  lines.finish();
  if (report.lines == 0)
    throw EmptyError(fmt::format("{}: no multiple of {:g} lies between its heights, {:.6g} to {:.6g}",
                                 mesh.string(), options.interval, low, high));
  report.warnings = write_by_gdal(scratch.path(), "lines",
                                  {{"raw", json_text(raw)},
                                   {"format", line_format(output)},
                                   {"crs", options.crs},
                                   {"layer", "contours"},
                                   {"value", "elevation"},
                                   {"index", "index_line"}},
                                  options.memory_bytes, output);
  return report;
}

}  // namespace tessera
