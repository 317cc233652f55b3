#include "stream/survey/mesh_section.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <optional>
#include <utility>
#include <vector>

#include <fmt/format.h>

#include "kernels/survey/line_clip.h"
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
#include "stream/survey/mesh_contours.h"
#include "stream/survey/raw_lines.h"
#include "stream/survey/section_axis.h"
#include "stream/survey/section_files.h"

namespace tessera {
namespace {

constexpr double kMaxSections = 1e6;
/// Of the spacing: how far off a sum of lengths may be. A station at a corner is of the piece that begins there, one at the
/// end of the axis is on it.
constexpr double kStationSlack = 1e-9;

/// Sections of one frame: those of a straight piece of the axis, or all horizontal ones.
struct SectionPart {
  SectionFrame frame;
  std::int64_t first = 0, end = 0;  ///< levels
  std::int64_t shift = 0;           ///< from levels to numbers of sections
  /// Lines are cut off here.
  double min = -std::numeric_limits<double>::infinity(), max = std::numeric_limits<double>::infinity();
  double station = 0.0;  ///< of its start
};

/// All sections; parts ascend by the numbers of theirs.
struct SectionPlan {
  SectionKind kind = SectionKind::kAcross;
  ContourLevels levels;
  std::vector<SectionPart> parts;

  const SectionPart& part_of(std::int64_t section) const {
    return *std::partition_point(parts.begin(), parts.end(),
                                 [&](const SectionPart& p) { return p.end + p.shift <= section; });
  }
  double level(std::int64_t section) const { return levels.height(section - part_of(section).shift); }
  double value(std::int64_t section) const {
    return kind == SectionKind::kAlong ? part_of(section).station : level(section);
  }
};

void require_few(double count, const SectionOptions& options) {
  if (!(count <= kMaxSections))
    throw UsageError(fmt::format("--spacing {:g}: makes {:.3g} sections, at most {:.3g} are possible",
                                 options.spacing, count, kMaxSections));
}

/// Bound of the coordinates of the box in all frames.
double reach_of(const MeshBox& box, const std::vector<AxisPiece>& pieces) {
  double reach = std::max(std::abs(box.low[2]), std::abs(box.high[2]));
  for (const AxisPiece& p : pieces) {
    double far = p.station + p.length;
    for (std::size_t a = 0; a < 2; ++a)
      far += std::max(std::abs(box.low[a] - p.start[a]), std::abs(box.high[a] - p.start[a]));
    reach = std::max(reach, far);
  }
  return reach;
}

SectionPlan plan_horizontal(const SectionOptions& options, const MeshBox& box) {
  SectionPlan plan;
  plan.kind = SectionKind::kHorizontal;
  const double low = box.low[2], high = box.high[2];
  const double reach = std::max({std::abs(low - options.from), std::abs(high - options.from), 1.0});
  plan.levels = {options.from, options.spacing > 0.0 ? options.spacing : reach};
  plan.parts.emplace_back();
  plan.parts.back().end = 1;
  if (options.spacing > 0.0 && high >= options.from) {
    // Those below the mesh count too: they have numbers.
    require_few((high - options.from) / options.spacing, options);
    plan.parts.back().end = plan.levels.above(high);
  }
  if (!(reach / plan.levels.interval < 0x1p52)) require_few(reach / plan.levels.interval, options);
  return plan;
}

SectionPlan plan_upright(const SectionOptions& options, const MeshBox& box,
                         const std::vector<AxisPiece>& pieces) {
  SectionPlan plan;
  plan.kind = options.kind;
  const double reach = reach_of(box, pieces), length = pieces.back().station + pieces.back().length;
  if (!std::isfinite(reach)) throw InputError(options.axis.string() + ": its line lies too far off the mesh");
  const bool along = options.kind == SectionKind::kAlong;
  plan.levels = {0.0, along ? std::max(reach, 1.0) : options.spacing};
  if (!along) {
    require_few(length / options.spacing, options);
    if (!(reach / options.spacing < 0x1p52)) require_few(reach / options.spacing, options);
  }
  std::int64_t next = 0;
  for (const AxisPiece& p : pieces) {
    SectionPart part;
    part.frame = SectionFrame(options.kind, p);
    part.station = p.station;
    if (along) {
      part.end = 1, part.shift = next++;
      part.min = p.station, part.max = p.station + p.length;
    } else {
      part.first = next;
      const bool last = &p == &pieces.back();
      part.end = next = last ? plan.levels.above(length + kStationSlack * options.spacing)
                             : std::max(next, static_cast<std::int64_t>(std::ceil(
                                                  (p.station + p.length) / options.spacing - kStationSlack)));
      if (options.width > 0.0) part.min = -0.5 * options.width, part.max = 0.5 * options.width;
    }
    if (part.first < part.end) plan.parts.push_back(part);
  }
  return plan;
}

/// What of a part a patch may have: levels, none where it lies beside.
std::pair<std::int64_t, std::int64_t> levels_met(const MeshBox& box, const SectionPart& part,
                                                 const ContourLevels& levels) {
  constexpr double kRounding =
      1e-12;  // of the largest coordinate: the errors of turning are a few times 2^-53 of it
  constexpr double kInfinite = std::numeric_limits<double>::infinity();
  Double3 low = {kInfinite, kInfinite, kInfinite}, high = {-kInfinite, -kInfinite, -kInfinite};
  double largest = part.station;
  for (unsigned corner = 0; corner < 8; ++corner) {
    const Double3 at =
        part.frame.turned({corner & 1 ? box.high[0] : box.low[0], corner & 2 ? box.high[1] : box.low[1],
                           corner & 4 ? box.high[2] : box.low[2]});
    for (std::size_t a = 0; a < 3; ++a) {
      low[a] = std::min(low[a], at[a]), high[a] = std::max(high[a], at[a]);
      largest = std::max(largest, std::abs(at[a]));
    }
  }
  const double margin = kRounding * largest;
  if (high[0] + margin < part.min || low[0] - margin > part.max) return {0, 0};
  return {std::max(part.first, levels.above(low[2] - margin)),
          std::min(part.end, levels.above(high[2] + margin))};
}

/// What turning adds to chain_bytes(): the positions as they were.
std::uint64_t section_bytes(const MeshPatchEntry& entry) {
  return chain_bytes(entry) + sizeof(Double3) * entry.vertices;
}

void section_patch(const MeshStore& store, std::size_t patch, const SectionPlan& plan, ChainFile& file) {
  const MeshPatchEntry& entry = store.patches()[patch];
  MeshBlock block;
  std::vector<Double3> places;
  for (const SectionPart& part : plan.parts) {
    const auto [first, end] = levels_met(entry.box, part, plan.levels);
    if (first >= end) continue;
    throw_if_stopped();
    if (places.empty()) {
      block = store.load(std::array{patch});
      places = block.position;
    }
    std::transform(places.begin(), places.end(), block.position.begin(),
                   [&](const Double3& p) { return part.frame.turned(p); });
    chain_levels(block, plan.levels, first, end, part.shift, file);
  }
}

/// Calls use(line, frame) for every line, cut off where its part says.
template <class Use>
void for_each_section_line(const SectionPlan& plan, const ChainGraph& graph, const Use& use) {
  constexpr std::uint64_t kLineCopies = 5;  // as it is read, cut and written
  for (const ChainedLine& chained : graph.lines()) {
    throw_if_stopped();
    const std::vector<Double2> points = graph.points(chained, kLineCopies);
    const SectionPart& part = plan.part_of(chained.level);
    for (ClippedLine& piece : clip_line(points, chained.closed, part.min, part.max))
      use(SectionLine{chained.level, plan.value(chained.level), plan.level(chained.level), piece.closed,
                      std::move(piece.points)},
          part.frame);
  }
}

struct SectionSurvey {
  SectionReport report;
  std::vector<SectionExtent> extents;  ///< ascending
  void add(const SectionLine& line) {
    if (extents.empty() || extents.back().section != line.section)
      extents.push_back({line.section, line.value, line.points.front(), line.points.front()});
    SectionExtent& e = extents.back();
    for (const Double2& p : line.points)
      for (std::size_t a = 0; a < 2; ++a)
        e.min[a] = std::min(e.min[a], p[a]), e.max[a] = std::max(e.max[a], p[a]);
    ++report.lines, report.closed += line.closed ? 1 : 0, report.points += line.points.size();
  }
  void finish(SectionKind kind) {
    const bool along = kind == SectionKind::kAlong;
    report.sections = extents.size();
    report.first = along ? extents.front().min[0] : extents.front().value;
    report.last = along ? extents.back().max[0] : extents.back().value;
  }
};

void write_raw(DirectFile& lines, const SectionLine& line, const SectionFrame& frame) {
  const RawLine header{line.value, static_cast<std::uint32_t>(line.section), line.closed ? 1u : 0u,
                       line.points.size()};
  lines.write(&header, sizeof header);
  for (const Double2& p : line.points) {
    const Double3 place = frame.place({p[0], p[1], line.level});
    lines.write(&place, sizeof place);
  }
}

std::string none_met(const SectionPlan& plan, const SectionOptions& options, const MeshBox& box) {
  if (plan.kind == SectionKind::kAlong) return "no part of the axis lies over or under a face";
  if (plan.kind == SectionKind::kAcross) return "no section across the axis meets a face";
  return fmt::format("no section from {:.6g} on meets a face: its heights are {:.6g} to {:.6g}", options.from,
                     box.low[2], box.high[2]);
}

}  // namespace

std::string section_format(const std::filesystem::path& output) {
  const std::string extension = lower_extension(output);
  if (extension == ".csv") return "CSV";
  if (extension == ".svg") return "SVG";
  try {
    return line_format(output);
  } catch (const UsageError&) {
    throw UsageError(output.string() + ": sections are written as .csv, .svg, .dxf, .gpkg or .geojson");
  }
}

SectionReport write_sections(const std::filesystem::path& mesh, const SectionOptions& options,
                             const std::filesystem::path& output, SectionView* view) {
  const std::string format = output.empty() ? "" : section_format(output);
  const bool by_gdal = !format.empty() && format != "CSV" && format != "SVG";
  if (by_gdal) gdal_program();  // before the work
  const std::vector<AxisPiece> pieces = options.kind == SectionKind::kHorizontal
                                            ? std::vector<AxisPiece>{}
                                            : axis_pieces(read_axis(options.axis));
  const ScratchFolder scratch(options.temp, "section");
  RunOptions run;
  run.memory_bytes = options.memory_bytes;
  run.threads = options.threads > 0 ? options.threads : core_count();
  const MeshStore store = import_mesh(mesh, scratch.path(), "mesh", run, throw_if_stopped);
  const SectionPlan plan = options.kind == SectionKind::kHorizontal
                               ? plan_horizontal(options, store.box())
                               : plan_upright(options, store.box(), pieces);

  WorkerPool pool(run.threads);
  MemoryBudget budget(options.memory_bytes, resident_bytes() + (view != nullptr ? view->bytes() : 0));
  ChainFile file(scratch.path());
  chain_patches(store, pool, budget, section_bytes,
                [&](std::size_t p) { section_patch(store, p, plan, file); });
  const ChainGraph graph(file, budget, "section");
  SectionSurvey survey;
  const auto each = [&](const auto& use) { for_each_section_line(plan, graph, use); };
  each([&](const SectionLine& line, const SectionFrame&) { survey.add(line); });
  if (survey.report.lines == 0) throw EmptyError(mesh.string() + ": " + none_met(plan, options, store.box()));
  survey.finish(options.kind);
  if (view != nullptr) {
    view->begin(survey.extents, pieces);
    each([&](const SectionLine& line, const SectionFrame& frame) { view->add(line, frame); });
  }
  if (format == "CSV") {
    SectionCsv csv(output, options.kind);
    each([&](const SectionLine& line, const SectionFrame& frame) { csv.add(line, frame); });
    csv.finish();
  } else if (format == "SVG") {
    SectionSvg svg(output, options.kind, std::move(survey.extents));
    each([&](const SectionLine& line, const SectionFrame&) { svg.add(line); });
    svg.finish();
  } else if (by_gdal) {
    const std::filesystem::path raw = scratch.path() / "lines.raw";
    DirectFile lines(raw);
    each([&](const SectionLine& line, const SectionFrame& frame) { write_raw(lines, line, frame); });
    lines.finish();
    survey.report.warnings =
        write_by_gdal(scratch.path(), "lines",
                      {{"raw", json_text(raw)},
                       {"format", format},
                       {"crs", options.crs},
                       {"layer", "sections"},
                       {"value", options.kind == SectionKind::kHorizontal ? "height" : "station"},
                       {"index", "section"}},
                      options.memory_bytes, output);
  }
  return survey.report;
}

}  // namespace tessera
