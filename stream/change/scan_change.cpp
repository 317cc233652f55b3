#include "stream/change/scan_change.h"

#include <algorithm>
#include <cmath>
#include <optional>
#include <utility>

#include <fmt/format.h>

#include "octree/error.h"
#include "stream/change/change_distances.h"
#include "stream/change/change_raster.h"
#include "stream/change/cloud_points.h"
#include "stream/files/file_extension.h"
#include "stream/files/scratch_folder.h"
#include "stream/runtime/memory_budget.h"
#include "stream/runtime/parallel.h"
#include "stream/survey/gdal_program.h"
#include "stream/survey/measured_inputs.h"

namespace tessera {
namespace {

constexpr double kNormalSpacings = 20.0, kProjectionSpacings = 10.0;
constexpr double kDepthPerProjection = 5.0;
constexpr double kMaxScaleExtents = 1000.0;    ///< of a scale: beyond it sums of squares have no digits left
constexpr std::uint64_t kChangeWorkShare = 4;  ///< a part in so many of the memory is for points on their way
/// Of reading points, and a file being written.
constexpr std::uint64_t kChangePassBytes = std::uint64_t{24} << 20;
constexpr std::uint64_t kMinSortBytes = std::uint64_t{1} << 20;
constexpr DeviationWords kChangeWords = {"without", "significant", "without a distance", "significant"};

/// Upwards to two digits, so that a scale that was told can be given.
double two_digits(double x) {
  const double unit = std::pow(10.0, std::floor(std::log10(x)) - 1.0);
  return std::stod(fmt::format("{:.6g}", std::ceil(x / unit * (1.0 - 1e-9)) * unit));
}

/// Names as they are usual; PLY has no blanks in names.
std::vector<std::string> scalar_names(bool all, bool ply) {
  std::vector<std::string> names = {"M3C2 distance", "distance uncertainty", "significant change"};
  if (all)
    for (const char* more : {"STD_cloud1", "STD_cloud2", "Npoints_cloud1", "Npoints_cloud2"})
      names.emplace_back(more);
  if (ply)
    for (std::string& name : names) {
      std::replace(name.begin(), name.end(), ' ', '_');
      name = "scalar_" + name;
    }
  if (all)
    for (const char* more : {"X", "Y", "Z"})
      names.push_back(std::string(ply ? "scalar_" : "") + "Normal" + more);
  return names;
}

/// One call of measure_change().
class ChangeJob {
 public:
  ChangeJob(const std::vector<std::filesystem::path>& before, const std::vector<std::filesystem::path>& after,
            const ScanChangeOptions& options, const std::vector<std::filesystem::path>& outputs)
      : paths_{before, after},
        options_(options),
        outputs_(outputs),
        scratch_(options.temp, "change"),
        threads_(options.threads > 0 ? options.threads : core_count()),
        progress_(progress_mode(options.progress, options.progress_sink.terminal, 0), options.progress_sink) {
  }

  ScanChangeReport run() {
    open_inputs();
    const std::uint64_t base = resident_bytes();
    const auto share = [&](std::uint64_t cap) {
      return MemoryBudget(cap, base).capacity() / kChangeWorkShare;
    };
    const std::uint64_t work = share(options_.memory_bytes);
    const auto need = [&](std::uint64_t cap) { return kChangePassBytes + share(cap); };
    MemoryBudget(options_.memory_bytes, base)
        .require(need(options_.memory_bytes), "change",
                 MemoryBudget::smallest_fitting_cap(options_.memory_bytes, base, need));
    WorkerPool pool(threads_);
    SpillPool raw(scratch_.path(), work / 2);
    std::optional<CloudPoints> before(raw), after(raw);
    pool.run_here([&] { read(*before, *after); });
    choose_scales(*before, *after);
    ChangeDistances distances(settings_, scratch_.path(), work);
    MemoryBudget budget(options_.memory_bytes, base + work);
    progress_.begin_stage("deal", 1, 4, "points", 0, 0);
    distances.deal(*before, *after, threads_, budget);
    before.reset(), after.reset();
    progress_.end_stage();
    const double most = 2.0 * settings_.rule.max_depth;
    const std::uint64_t sorts = std::max<std::uint64_t>(work / 4, kMinSortBytes);
    ChangeCells cells(options_.cell > 0.0 ? options_.cell : settings_.rule.projection_scale, most,
                      scratch_.path(), sorts);
    progress_.begin_stage("measure", 2, 4, "core points", report_.points[0], 0);
    distances.measure(pool, budget, cells, [&](std::uint64_t points) { progress_.advance(points); });
    progress_.end_stage();
    trim_allocator();
    require_overlap(distances);
    measure_area(cells, most);
    DeviationStatistics statistics(most, -1.0, options_.areas, scratch_.path(), sorts);
    progress_.begin_stage("write", 3, 4, "points", report_.points[0], 0);
    pool.run_here([&] { write(distances, statistics); });
    report_.table = statistics.finish();
    report_.table.words = kChangeWords;
    report_.bytes = inputs_->finish();
    progress_.end_stage();
    add_notices();
    return std::move(report_);
  }

 private:
  /// What the inputs are refused for they shall be refused for before the work.
  void open_inputs() {
    if (!options_.raster.empty()) gdal_program();
    if (!options_.areas.empty()) ClipPolygon::text_of_file(options_.areas);
    for (const std::vector<std::filesystem::path>& some : paths_)
      for (const std::filesystem::path& path : some)
        if (measures_vertices(path))
          throw InputError(
              path.string() +
              ": is a mesh; change compares scans, deviate measures scans and meshes from a mesh");
    MeasuredInputOptions o;
    o.scalars =
        scalar_names(options_.all_fields, !outputs_.empty() && lower_extension(outputs_.front()) == ".ply");
    o.columns = options_.columns;
    o.recoloured = options_.colour_scale > 0.0;
    o.anew = o.recoloured || options_.core_spacing > 0.0;
    o.memory_bytes = options_.memory_bytes, o.threads = threads_, o.scratch = scratch_.path();
    inputs_.emplace(paths_[0], outputs_, o);
    after_ = open_measured_scans(paths_[1], options_.columns, inputs_->slice_window());
    const Crs &a = inputs_->points().crs, &b = after_->crs;
    if (a.known() && b.known() && !may_be_same(a, b))
      throw InputError(paths_[1].front().string() + ": is in " + b.name + ", the old scan is in " + a.name +
                       "; scans are compared in one system");
  }

  void read(CloudPoints& before, CloudPoints& after) {
    progress_.begin_stage("read", 0, 4, "points", 0, 0);
    std::uint64_t told = 0;
    const auto tell = [&] {
      constexpr std::uint64_t kEvery = 1u << 16;
      if (++told == kEvery) progress_.advance(std::exchange(told, 0));
    };
    inputs_->read([&](const Double3& p) {
      before.add(p);
      tell();
    });
    std::uint64_t all = 0;
    after_->read([&](const PointChunk& chunk) {
      all += chunk.size();
      for (std::size_t i = 0; i < chunk.size(); ++i) {
        after.add({chunk.x[i], chunk.y[i], chunk.z[i]});
        tell();
      }
    });
    progress_.advance(told);
    progress_.end_stage();
    report_.points = {before.finite(), after.finite()};
    report_.left_out = {inputs_->left_out(), after_->left_out + all - after.finite()};
    if (after.finite() == 0)
      throw EmptyError(paths_[1].front().string() + (paths_[1].size() > 1 ? " and the others" : "") +
                       ": there is no point to compare with");
    settings_.origin = before.min();
    for (std::size_t a = 0; a < 3; ++a) {
      settings_.origin[a] = std::floor(std::min(before.min()[a], after.min()[a]));
      settings_.extent =
          std::max(settings_.extent, std::max(before.max()[a], after.max()[a]) - settings_.origin[a]);
    }
  }

  /// Scales as given, or by the spacing of the sparser scan.
  void choose_scales(CloudPoints& before, CloudPoints& after) {
    report_.spacing = {before.measure_spacing(), after.measure_spacing()};
    const double spacing = std::max(report_.spacing[0], report_.spacing[1]);
    ChangeRule& rule = settings_.rule;
    const auto scale = [&](const char* option, double given, double spacings) {
      if (given == 0.0 && !(spacing > 0.0))
        throw InputError(fmt::format("{}: too few points to tell their spacing; give {}",
                                     paths_[report_.spacing[0] > 0.0 ? 1 : 0].front().string(), option));
      const double useful = spacing > 0.0 ? two_digits(spacings * spacing) : 0.0;
      if (given == 0.0) return useful;
      if (given < spacing)
        throw UsageError(fmt::format("{} {:g}: is below the spacing of the points, {:.3g}; {:g} works",
                                     option, given, spacing, useful));
      if (given > kMaxScaleExtents * std::max(settings_.extent, spacing))
        throw UsageError(fmt::format("{} {:g}: is more than {:g} times as wide as the scans", option, given,
                                     kMaxScaleExtents));
      return given;
    };
    rule.normal_scale = scale("--normal-scale", options_.normal_scale, kNormalSpacings);
    rule.projection_scale = scale("--projection-scale", options_.projection_scale, kProjectionSpacings);
    rule.max_depth = options_.max_depth > 0.0 ? options_.max_depth
                                              : two_digits(kDepthPerProjection * rule.projection_scale);
    if (rule.max_depth > kMaxScaleExtents * std::max(settings_.extent, rule.projection_scale))
      throw UsageError(fmt::format("--max-depth {:g}: is more than {:g} times as wide as the scans",
                                   rule.max_depth, kMaxScaleExtents));
    rule.registration_error = options_.registration_error;
    rule.median = options_.median;
    rule.normals = options_.normals;
    settings_.core_spacing = options_.core_spacing;
    settings_.details = options_.all_fields;
    report_.rule = rule;
  }

  void require_overlap(const ChangeDistances& distances) {
    report_.core_points = distances.core_points();
    report_.without_normal = distances.without_normal();
    report_.with_noise = distances.with_noise();
    if (distances.with_distance() > 0) return;
    if (report_.without_normal == report_.core_points)
      throw EmptyError(fmt::format("{}: no core point has a normal at --normal-scale {:g}; raise it",
                                   paths_[0].front().string(), report_.rule.normal_scale));
    throw EmptyError(fmt::format(
        "{}: no cylinder of {:g} and --max-depth {:g} around a point of {} holds a point of both; are "
        "both in one system? else raise --max-depth",
        paths_[1].front().string(), report_.rule.projection_scale, report_.rule.max_depth,
        paths_[0].front().string()));
  }

  void measure_area(ChangeCells& cells, double max_distance) {
    if (options_.raster.empty()) {
      report_.area = change_area(cells);
      return;
    }
    ChangeRaster raster(cells, max_distance, scratch_.path(), options_.raster);
    report_.area = change_area(cells, [&](const ChangeCell& c) { raster.add(c); });
    const Crs& own = inputs_->points().crs;
    const std::string crs = !own.wkt.empty()      ? own.wkt
                            : own.horizontal != 0 ? fmt::format("EPSG:{}", own.horizontal)
                                                  : std::string();
    const std::string warnings = raster.finish(crs, options_.memory_bytes / 2);
    if (!warnings.empty()) report_.notices.push_back(warnings);
  }

  /// The second pass: every core point with its change.
  void write(ChangeDistances& distances, DeviationStatistics& statistics) {
    std::uint64_t told = 0;
    inputs_->write([&](const Double3& p, MeasuredInputs::Found& found) {
      const FoundChange& c = distances.next();
      found.scalars[0] = c.distance, found.scalars[1] = c.uncertainty;
      found.scalars[2] = c.core == 0 ? ChangeDetails::kNone : c.significant;
      if (options_.all_fields) {
        const ChangeDetails& d = distances.next_details();
        found.scalars[3] = d.spread[0], found.scalars[4] = d.spread[1];
        found.scalars[5] = d.count[0], found.scalars[6] = d.count[1];
        std::copy_n(d.normal.begin(), 3, found.scalars.begin() + 7);
      }
      if (options_.colour_scale > 0.0) found.rgba = measured_colour(c.distance, options_.colour_scale);
      if (c.core != 0) statistics.add(p, {c.distance, c.significant != 0});
      constexpr std::uint64_t kEvery = 1u << 16;
      if (++told == kEvery) progress_.advance(std::exchange(told, 0));
      return c.core != 0;
    });
    progress_.advance(told);
  }

  void add_notices() {
    for (const std::string& line : inputs_->points().notices()) report_.notices.push_back(line);
    for (const std::string& line : after_->notices()) report_.notices.push_back(line);
    const double count = static_cast<double>(report_.core_points);
    constexpr double kMany = 0.5;
    if (static_cast<double>(report_.with_noise) <
        kMany * static_cast<double>(report_.table.rows.front().count))
      report_.notices.push_back(fmt::format(
          "{} of {} distances come from fewer than {} points of a scan and have no level of detection; raise "
          "--projection-scale",
          report_.table.rows.front().count - report_.with_noise, report_.table.rows.front().count,
          kMinNoisePoints));
    if (static_cast<double>(report_.table.rows.front().count) < kMany * count)
      report_.notices.push_back(fmt::format(
          "{} of {} core points have no distance: the scans overlap in part, or lie farther apart than "
          "--max-depth {:g}",
          report_.table.rows.front().far, report_.core_points, report_.rule.max_depth));
  }

  std::array<std::vector<std::filesystem::path>, 2> paths_;
  ScanChangeOptions options_;
  std::vector<std::filesystem::path> outputs_;
  ScratchFolder scratch_;
  int threads_;
  Progress progress_;
  ScanChangeReport report_;
  ChangeSettings settings_;
  std::optional<MeasuredInputs> inputs_;
  std::unique_ptr<MeasuredPoints> after_;
};

}  // namespace

ScanChangeReport measure_change(const std::vector<std::filesystem::path>& before,
                                const std::vector<std::filesystem::path>& after,
                                const ScanChangeOptions& options,
                                const std::vector<std::filesystem::path>& outputs) {
  return ChangeJob(before, after, options, outputs).run();
}

std::string describe(const ScanChangeReport& r) {
  const DeviationSummary& all = r.table.rows.front();
  std::string text = fmt::format(
      "{} points against {}, spacing {:.3g} and {:.3g}; normals at {:g}, cylinders {:g} wide, {:g} to either "
      "side\n",
      r.points[0], r.points[1], r.spacing[0], r.spacing[1], r.rule.normal_scale, r.rule.projection_scale,
      r.rule.max_depth);
  text += fmt::format("core points: {}, {} without a normal, {} with a level of detection\n", r.core_points,
                      r.without_normal, r.with_noise);
  text += describe(r.table, -1.0);
  text +=
      fmt::format("significant: {:.2f} % of the distances; area compared {:.6g}, of it significant {:.6g}\n",
                  100.0 * static_cast<double>(all.border) / static_cast<double>(all.count), r.area.compared,
                  r.area.significant);
  for (const ChangeCell& c : r.area.worst)
    text += fmt::format("{} {:.6g} around {:.10g} {:.10g}: {} of {} distances significant\n",
                        &c == &r.area.worst.front() ? "largest:" : "        ", c.mean,
                        (static_cast<double>(c.x) + 0.5) * r.area.cell,
                        (static_cast<double>(c.y) + 0.5) * r.area.cell, c.significant, c.count);
  return text;
}

Json to_json(const ScanChangeReport& r) {
  Json out = to_json(r.table, -1.0);
  const DeviationSummary& all = r.table.rows.front();
  out["points"] = r.points, out["left_out"] = r.left_out, out["spacing"] = r.spacing;
  out["normal_scale"] = r.rule.normal_scale;
  out["projection_scale"] = r.rule.projection_scale;
  out["max_depth"] = r.rule.max_depth;
  out["registration_error"] = r.rule.registration_error;
  out["core_points"] = r.core_points;
  out["without_normal"] = r.without_normal;
  out["with_level_of_detection"] = r.with_noise;
  out["share_significant"] = static_cast<double>(all.border) / static_cast<double>(all.count);
  out["area"] = {{"cell", r.area.cell}, {"compared", r.area.compared}, {"significant", r.area.significant}};
  out["largest"] = Json::array();
  for (const ChangeCell& c : r.area.worst)
    out["largest"].push_back({{"mean", c.mean},
                              {"at", Double2{(static_cast<double>(c.x) + 0.5) * r.area.cell,
                                             (static_cast<double>(c.y) + 0.5) * r.area.cell}},
                              {"distances", c.count},
                              {"significant", c.significant}});
  return out;
}

}  // namespace tessera
