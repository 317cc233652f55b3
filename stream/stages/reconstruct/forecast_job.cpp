#include <algorithm>
#include <array>
#include <initializer_list>
#include <map>
#include <string_view>
#include <utility>

#include "kernels/field/field.h"
#include "stream/points/top_store.h"
#include "stream/runtime/parallel.h"
#include "stream/stages/plan/forecast_rates.h"
#include "stream/stages/plan/planned_scan.h"
#include "stream/stages/reconstruct/forecast.h"
#include "stream/stages/reconstruct/reconstruct_job.h"
#include "stream/stages/scan/normals_mode.h"
#include "stream/stages/scan/order_stage.h"
#include "stream/stages/surface/closing_stages.h"
#include "stream/stages/surface/first_pass.h"
#include "stream/stages/surface/hole_limit.h"
#include "stream/stages/surface/level_surface_stage.h"
#include "stream/stages/surface/surface_stage.h"

namespace tessera {
namespace {

using namespace rates;

/// \returns nothing where no surface model can be made: the orient stage knows which kind of scene it is
std::optional<PlannedColumns> planned_columns(const PlannedScan& scan) {
  const ReconstructOptions& options = scan.options;
  const bool above = options.from == "auto" || options.from == "above";
  if (!scan.estimates_normals || !options.models_top() || (options.vegetation != "top" && !above))
    return std::nullopt;
  PlannedColumns columns;
  if (scan.bricks.empty()) return columns;
  const ViewAxes axes = ViewAxes::along(options.up.value_or(Double3{0, 0, 1}));
  const Int3 first = brick_of_key(scan.bricks.front().key);
  std::array<int, 2> low = {first[axes.u], first[axes.v]}, high = low;
  struct Extent {
    int low, high, bricks;
  };
  std::map<std::pair<int, int>, Extent> extents;
  for (const BrickEntry& b : scan.bricks) {
    const Int3 at = brick_of_key(b.key);
    const std::array<int, 2> position = {at[axes.u], at[axes.v]};
    std::uint64_t& column = columns.points[{position[0], position[1]}];
    column += b.points;
    columns.fullest = std::max(columns.fullest, column);
    Extent& extent =
        extents.try_emplace({position[0], position[1]}, Extent{at[axes.up], at[axes.up], 0}).first->second;
    extent = {std::min(extent.low, at[axes.up]), std::max(extent.high, at[axes.up]), extent.bricks + 1};
    for (std::size_t a = 0; a < 2; ++a)
      low[a] = std::min(low[a], position[a]), high[a] = std::max(high[a], position[a]);
  }
  columns.width = high[0] - low[0] + 1, columns.height = high[1] - low[1] + 1;
  const auto gapped = std::count_if(extents.begin(), extents.end(), [](const auto& entry) {
    return entry.second.high - entry.second.low >= entry.second.bricks;
  });
  columns.gapped_share = static_cast<double>(gapped) / static_cast<double>(extents.size());
  return columns;
}

PlannedScan planned_scan(const Plan& plan, const std::vector<PlanBrick>& bricks, const InputTasks& inputs,
                         const JobState& job) {
  PlannedScan scan{plan, job.run, reconstruct_options(job), inputs, bricks};
  const ReconstructOptions& options = scan.options;
  scan.bricks = planned_bricks(bricks, options.max_brick_points);
  for (const BrickEntry& b : scan.bricks) {
    scan.largest_brick = std::max(scan.largest_brick, b.points);
    scan.max_blocks = std::max(scan.max_blocks, b.blocks);
    scan.blocks += b.blocks;
  }
  const NormalsMode mode(options, job.inputs.size(), plan, agreement_where_measured(job.work));
  scan.has_overlay = mode.needed();
  scan.estimates_normals = mode.propagate();
  scan.knows_sides = mode.each_seen();
  scan.columns = planned_columns(scan);
  // Where nobody is known to have seen the points, the stage asks their columns, more closely than this.
  const bool asks = options.from == "auto" && !mode.by_sensor && !mode.completes;
  scan.oriented_in_blocks = scan.knows_sides || (options.from == "above" && !mode.by_sensor) ||
                            (asks && scan.columns && scan.columns->look_open());
  scan.closes = HolesMode(options.holes).close;
  scan.fuses_stores = options.fuses_stores(plan);
  const HoleLimit holes =
      hole_limit(options, plan, options.has_levels() ? HoleScene::kOther : HoleScene::kAbove);
  scan.max_hole_edges = holes.edges, scan.max_chained_edges = holes.chained;
  scan.filling_bytes = holes.filling_bytes();

  FieldOptions field = field_options(plan, options.feature_angle_deg);
  field.firm_boundary = scan.closes;
  scan.halo = field_halo_cells(field);
  scan.groups = make_tile_groups(scan.bricks, surface_tiling(job, field));
  scan.patches = plan_patches(scan.bricks, scan.groups, plan.faces_estimate);
  for (const PatchEntry& e : scan.patches.entries)
    if (e.faces > scan.largest_patch.faces) scan.largest_patch = e;

  scan.points = static_cast<double>(plan.points());
  scan.faces = expected_level_faces(plan, options);
  scan.run_bytes = bytes_of(scan.points, kRunBytes);
  scan.store_bytes = bytes_of(scan.points, kStoreBytes);
  scan.overlay_bytes = scan.has_overlay ? bytes_of(scan.points, kOverlayBytes) : 0;
  scan.surface_bytes = bytes_of(scan.faces, scan.fuses_stores ? kFirstPassBytes : kPatchBytes);
  scan.smoothed_bytes = options.smooths() ? bytes_of(scan.faces, 2 * kPatchBytes) : 0;
  scan.output_bytes = bytes_of(scan.faces, kOutputBytes);
  return scan;
}

/// Largest sum of what lies in the work directory at one time.
std::uint64_t peak_disk(const PlannedScan& scan, const std::vector<StageForecast>& stages) {
  const auto disk = [&](std::initializer_list<std::string_view> names) {
    std::uint64_t bytes = 0;
    for (const StageForecast& f : stages)
      if (std::find(names.begin(), names.end(), f.stage) != names.end()) bytes += f.disk_bytes;
    return bytes;
  };
  const std::uint64_t closing = disk({"multipole", "rims"}), top = disk({"ground-cells", "ground", "top"});
  const std::uint64_t points = scan.store_bytes + scan.overlay_bytes + closing;
  // What the first pass of decimation leaves is written, at most, or a surface with levels once more with its ends.
  const std::uint64_t output =
      std::max(scan.fuses_stores ? std::min(scan.surface_bytes, scan.output_bytes) : scan.output_bytes,
               disk({"ends"}));
  std::uint64_t peak =
      std::max({scan.inputs.unpacked_bytes + scan.run_bytes, scan.run_bytes + scan.store_bytes,
                top > 0 ? 2 * scan.store_bytes + scan.overlay_bytes + top : 0,
                points + scan.surface_bytes + scan.smoothed_bytes + output});
  // The raw mesh, its vertices and faces dealt out, its store.
  if (scan.options.decimates() && !scan.fuses_stores)
    peak = std::max(peak, scan.store_bytes + scan.overlay_bytes + scan.output_bytes +
                              disk({"mesh-read", "mesh-vertices", "mesh-corners"}) + scan.smoothed_bytes);
  return peak;
}

}  // namespace

Forecast forecast_job(const Plan& plan, const std::vector<PlanBrick>& bricks, const InputTasks& inputs,
                      const JobState& job) {
  const PlannedScan scan = planned_scan(plan, bricks, inputs, job);
  std::vector<StageEntry> entries = reconstruct_stages(scan.options);
  const auto self = std::find_if(entries.begin(), entries.end(),
                                 [](const StageEntry& entry) { return entry.name == "forecast"; });
  entries.erase(entries.begin(), self == entries.end() ? self : self + 1);
  Forecast forecast;
  forecast.stages.resize(entries.size());
  parallel_for(entries.size(), [&](std::size_t k) {
    StageForecast& told = forecast.stages[k];
    told = entries[k].forecast ? entries[k].forecast(scan) : idle_forecast();
    told.stage = entries[k].name;
    const double threads = std::max(1.0, 1.0 * scan.run.threads);
    const double width = std::clamp(static_cast<double>(told.tasks), 1.0, threads);
    told.seconds = told.processor_us * 1e-6 / width + told.moved_bytes / kDiskBytesPerSecond;
  });
  forecast.output_bytes = scan.output_bytes;
  forecast.peak_disk_bytes = peak_disk(scan, forecast.stages);
  return forecast;
}

}  // namespace tessera
