#include "stream/survey/mesh_contours.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <optional>
#include <vector>

#include <fmt/format.h>

#include "kernels/survey/contour_chains.h"
#include "kernels/survey/line_smoothing.h"
#include "octree/error.h"
#include "stream/files/direct_file.h"
#include "stream/files/file_extension.h"
#include "stream/files/json.h"
#include "stream/files/path_text.h"
#include "stream/files/read_file.h"
#include "stream/files/scratch_folder.h"
#include "stream/import/import_mesh.h"
#include "stream/meshes/mesh_store.h"
#include "stream/runtime/memory_budget.h"
#include "stream/runtime/parallel.h"
#include "stream/runtime/stop.h"
#include "stream/survey/gdal_program.h"
#include "stream/survey/line_chains.h"
#include "stream/survey/line_clearance.h"
#include "stream/survey/raw_lines.h"

namespace tessera {
namespace {

constexpr double kMaxLevels = 1e6;

void chain_patch(const MeshStore& store, std::size_t patch, const ContourLevels& levels, ChainFile& file) {
  const MeshPatchEntry& entry = store.patches()[patch];
  const std::int64_t end = levels.above(entry.box.high[2]), first = levels.above(entry.box.low[2]);
  if (first < end) chain_levels(store.load(std::array{patch}), levels, first, end, 0, file);
}

void write_line(DirectFile& file, RawLine header, const std::vector<Double2>& points) {
  header.count = points.size();
  file.write(&header, sizeof header);
  for (const Double2& p : points) {
    const Double3 place = {p[0], p[1], header.value};
    file.write(&place, sizeof place);
  }
}

std::size_t segment_count(const RawLine& line) {
  return line.count < 2 ? 0 : line.count - (line.closed != 0 ? 0 : 1);
}

/// Smooths the lines of a raw file into another one. \returns how many changed
std::uint64_t smooth_lines(const std::filesystem::path& raw, const std::filesystem::path& smooth,
                           LineClearance& clearance, double tolerance, ContourReport& report) {
  // Two lines that each move by less than half of what is between them do not meet.
  constexpr double kShare = 0.499;
  clearance.measure(throw_if_stopped);
  const ReadFile from(raw);
  DirectFile to(smooth);
  std::vector<Double3> places;
  std::uint64_t changed = 0;
  report.points = 0;
  for (std::uint64_t at = 0; at < from.size();) {
    throw_if_stopped();
    RawLine header;
    from.read_at(at, &header, sizeof header);
    at += sizeof header;
    places.resize(header.count);
    from.read_at(at, places.data(), header.count * sizeof places[0]);
    at += header.count * sizeof places[0];
    std::vector<Double2> points;
    for (const Double3& p : places) points.push_back({p[0], p[1]});
    std::vector<double> limit = clearance.next(segment_count(header));
    for (double& l : limit) l = std::min(tolerance, kShare * l);
    const std::vector<Double2> line = smooth_line(points, header.closed != 0, limit, tolerance);
    changed += line != points ? 1 : 0;
    report.points += line.size();
    write_line(to, header, line);
  }
  to.finish();
  return changed;
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
  const std::filesystem::path smooth = scratch.path() / "smooth.raw";
  DirectFile lines(raw);
  std::optional<LineClearance> clearance;
  if (options.smooth > 0.0)
    clearance.emplace(2.0 * options.smooth / 0.99,
                      store.diagonal() / std::sqrt(static_cast<double>(store.face_count()) + 1.0),
                      scratch.path(), std::max(std::uint64_t{16} << 20, budget.capacity() / 4));
  for (const ChainedLine& line : graph.lines()) {
    throw_if_stopped();
    const std::vector<Double2> points = graph.points(line);
    if (points.empty()) continue;
    RawLine header;
    header.value = levels.height(line.level);
    header.index = options.index > 0 && line.level % options.index == 0 ? 1 : 0;
    header.closed = line.closed ? 1 : 0;
    write_line(lines, header, points);
    if (clearance) clearance->add(points, header.closed != 0);
    if (report.lines == 0) report.lowest = header.value;
    report.highest = header.value;
    ++report.lines, report.closed += header.closed, report.points += points.size();
  }
  lines.finish();
  if (report.lines == 0)
    throw EmptyError(fmt::format("{}: no multiple of {:g} lies between its heights, {:.6g} to {:.6g}",
                                 mesh.string(), options.interval, low, high));
  if (clearance) report.smoothed = smooth_lines(raw, smooth, *clearance, options.smooth, report);
  report.warnings = write_by_gdal(scratch.path(), "lines",
                                  {{"raw", json_text(clearance ? smooth : raw)},
                                   {"format", line_format(output)},
                                   {"crs", options.crs},
                                   {"layer", "contours"},
                                   {"value", "elevation"},
                                   {"index", "index_line"}},
                                  options.memory_bytes, output);
  return report;
}

}  // namespace tessera
