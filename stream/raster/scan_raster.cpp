#include "stream/raster/scan_raster.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <memory>
#include <optional>

#include <fmt/format.h>

#include "kernels/points/height_classes.h"
#include "kernels/survey/plan_spacing.h"
#include "octree/error.h"
#include "stream/commands/convert_mesh.h"
#include "stream/files/scratch_folder.h"
#include "stream/files/spill_buckets.h"
#include "stream/formats/points/projection.h"
#include "stream/points/point_sample.h"
#include "stream/runtime/disk_space.h"
#include "stream/runtime/memory_budget.h"
#include "stream/runtime/parallel.h"
#include "stream/runtime/stop.h"
#include "stream/survey/gdal_program.h"
#include "stream/survey/measured_points.h"

namespace tessera {
namespace {

/// The surface that is seen reaches so many cells down from the highest point of a cell.
constexpr double kSeenCells = 0.5;
constexpr double kSpacings = 2.0;  ///< of a cell whose edge is chosen
constexpr std::size_t kSampledPoints = 1u << 17;
constexpr std::int64_t kMinScanWindow = 128, kMaxScanWindow = 2048;
constexpr std::uint64_t kMinChunk = 1024, kMaxChunk = 65536;
constexpr const char* kWhoRasters = "raster";

/// A point on its way to its window.
struct DealtPoint {
  static constexpr std::uint32_t kGround = 1u << 31, kIntensity = 1u << 30, kCell = kIntensity - 1;
  double z = 0.0;
  std::uint32_t rgba = 0;
  std::uint32_t cell = 0;  ///< in its window, and flags
  std::uint16_t intensity = 0;
};
static_assert(kMaxScanWindow * kMaxScanWindow <= DealtPoint::kCell);

/// What the first pass finds.
struct PointExtent {
  Double3 min{}, max{};
  std::uint64_t points = 0, ground = 0;
  void add(const Double3& p, bool is_ground) {
    for (std::size_t a = 0; a < 3; ++a) {
      min[a] = points == 0 ? p[a] : std::min(min[a], p[a]);
      max[a] = points == 0 ? p[a] : std::max(max[a], p[a]);
    }
    ++points;
    ground += is_ground ? 1 : 0;
  }
};

/// Calls use(index, position, is_ground) for the points of a chunk that take part; returns how many do not.
template <class Use>
std::uint64_t for_each_seen(const PointChunk& chunk, const Use& use) {
  std::uint64_t left_out = 0;
  for (std::size_t i = 0; i < chunk.size(); ++i) {
    const Double3 p = {chunk.x[i], chunk.y[i], chunk.z[i]};
    const int kind = chunk.echo.empty() ? 0 : chunk.echo[i].kind;
    if (kind == kClassNoise || kind == kClassHighNoise || !std::isfinite(p[0]) || !std::isfinite(p[1]) ||
        !std::isfinite(p[2]))
      ++left_out;
    else
      use(i, p, kind == kClassGround);
  }
  return left_out;
}

/// What GDAL is told; empty where it can be told nothing.
std::string text_of_crs(const Crs& crs) {
  if (!crs.wkt.empty() || crs.horizontal == 0) return crs.wkt;
  std::string text = "EPSG:" + std::to_string(crs.horizontal);
  if (crs.vertical != 0) text += "+" + std::to_string(crs.vertical);
  return text;
}

/// Columns and rows of windows.
struct WindowPlan {
  std::int64_t side = kMinScanWindow, across = 1, down = 1;
  std::size_t count() const { return static_cast<std::size_t>(across * down); }
  void cut(const RasterGrid& grid, std::int64_t edge) {
    side = edge;
    across = (grid.columns + side - 1) / side, down = (grid.rows + side - 1) / side;
  }
  RasterWindow window(std::size_t k, const RasterGrid& grid) const {
    RasterWindow w;
    w.column = static_cast<std::int64_t>(k) % across * side;
    w.row = static_cast<std::int64_t>(k) / across * side;
    w.columns = std::min(side, grid.columns - w.column), w.rows = std::min(side, grid.rows - w.row);
    return w;
  }
};

std::uint64_t scan_window_bytes(std::int64_t side, std::size_t layers) {
  const auto edge = static_cast<std::uint64_t>(side);
  return edge * edge * sizeof(ScanCell) + edge * 8 + layers * sizeof(LayerValues) + kMaxChunk +
         (std::uint64_t{1} << 20);
}

/// One call of write_scan_rasters().
class ScanRasterJob {
 public:
  ScanRasterJob(const std::vector<std::filesystem::path>& scans, const RasterOptions& options,
                const std::vector<std::string>& columns, const std::vector<RasterOutput>& outputs)
      : options_(options),
        outputs_(outputs),
        name_(scans.front().string() + (scans.size() > 1 ? " and the others" : "")),
        threads_(options.threads > 0 ? options.threads : core_count()) {
    const std::uint64_t half = MemoryBudget(options.memory_bytes, resident_bytes()).capacity() / 2;
    const auto slices = std::clamp<std::size_t>(static_cast<std::size_t>(half / kSliceMemory), 1,
                                                static_cast<std::size_t>(threads_) + 1);
    points_ = open_measured_scans(scans, columns, slices);
  }

  RasterReport run() {
    refuse_layers();
    find_crs();
    const ScratchFolder scratch(options_.temp, kWhoRasters);
    const MemoryBudget whole(options_.memory_bytes, resident_bytes());
    whole.require(2 * std::max(kSliceMemory, scan_window_bytes(kMinScanWindow, outputs_.size())),
                  kWhoRasters);
    WorkerPool pool(threads_);
    pool.run_here([&] { measure(); });
    const RasterGrid grid(range(0), range(1), options_.cell);
    plan_windows(grid, whole);
    require_disk(std::array{DiskNeed{
                     scratch.path(),
                     2 * RasterFiles::raw_bytes(grid.cells(), outputs_) + extent_.points * sizeof(DealtPoint),
                     "points and raw raster"}},
                 kLargerDisk);
    LayerSettings settings;
    settings.nodata = static_cast<float>(options_.nodata);
    settings.low = extent_.min[2], settings.high = extent_.max[2];
    settings.points = static_cast<double>(extent_.points);
    RasterFiles files(grid, settings, outputs_, scratch.path());
    {
      SpillPool spill(scratch.path(), whole.capacity() / 4);
      SpillBuckets<DealtPoint> dealt(spill, windows_.count(), chunk_bytes_);
      pool.run_here([&] { deal(grid, dealt); });
      MemoryBudget budget(options_.memory_bytes, resident_bytes());
      const std::uint64_t bytes = scan_window_bytes(windows_.side, outputs_.size());
      pool.run_tasks(
          windows_.count(), [&](std::size_t) { return bytes; }, budget,
          [&](std::size_t k) { sample(grid, dealt, k, files); });
    }
    trim_allocator();
    RasterReport report = files.finish(name_, options_);
    report.points = extent_.points, report.left_out = left_out_;
    std::string notices;
    for (const std::string& notice : points_->notices()) notices += "note: " + notice + "\n";
    report.warnings = notices + report.warnings;
    return report;
  }

 private:
  bool has_layer(RasterLayer layer) const {
    return std::any_of(outputs_.begin(), outputs_.end(),
                       [&](const RasterOutput& o) { return o.layer == layer; });
  }

  /// What no point can tell is refused before any is read.
  void refuse_layers() const {
    for (const RasterOutput& output : outputs_)
      if (!is_point_layer(output.layer))
        throw UsageError(
            "--layer " + name_of(output.layer) + ": needs faces, and " + name_ +
            " has points alone; make a mesh first: tessera reconstruct SCAN -o site.ply --surface "
            "top, or --surface ground");
    if (has_layer(RasterLayer::kOrtho) && !points_->attributes.colour)
      throw UsageError("--layer ortho: " + name_ + " has no colours");
    if (has_layer(RasterLayer::kIntensity) && !points_->attributes.intensity_16)
      throw UsageError("--layer intensity: " + name_ + " has no intensities");
    if (!points_->attributes.echo) refuse_ground();
  }
  void refuse_ground() const {
    for (const RasterLayer layer : {RasterLayer::kGround, RasterLayer::kHeight})
      if (has_layer(layer))
        throw InputError("--layer " + name_of(layer) + ": " + name_ +
                         " has no points of class 2, ground: run tessera classify first");
  }

  void find_crs() {
    if (!options_.crs.empty()) return;
    options_.crs = text_of_crs(points_->crs);
    if (options_.crs.empty()) return;
    try {
      user_crs(options_.crs, "the coordinate system of " + name_);
    } catch (const UsageError& e) {
      throw InputError(std::string(e.what()) + "; name it with --crs");
    }
  }

  void measure() {
    std::optional<PointSampler> sampler;
    if (options_.cell == 0.0) sampler.emplace(kSampledPoints);
    std::uint64_t aside = 0;
    points_->read([&](const PointChunk& chunk) {
      aside += for_each_seen(chunk, [&](std::size_t, const Double3& p, bool ground) {
        extent_.add(p, ground);
        if (sampler) sampler->add(p);
      });
    });
    left_out_ = points_->left_out + aside;
    if (extent_.points == 0)
      throw EmptyError(name_ + (left_out_ > 0 ? ": all points are withheld, noise or not finite"
                                              : ": there are no points"));
    if (extent_.ground == 0) refuse_ground();
    if (sampler) options_.cell = chosen_cell(sampler->take());
  }

  double chosen_cell(const std::vector<Double3>& points) const {
    std::vector<Double2> sample;
    for (const Double3& p : points) sample.push_back({p[0], p[1]});
    const double share = static_cast<double>(sample.size()) / static_cast<double>(extent_.points);
    const double spacing = plan_spacing(sample, share);
    if (!(spacing > 0.0))
      throw UsageError(
          "--cell auto: " + name_ +
          " has too few points apart from each other to measure their spacing; give the edge of a cell");
    return round_up_1_2_5(kSpacings * spacing);
  }

  /// Cells that hold points; a point on an edge lies in the cell above it.
  CellRange range(std::size_t axis) const {
    CellRange cells(extent_.min[axis], extent_.max[axis], options_.cell);
    cells.first = cell_index(extent_.min[axis], options_.cell);
    cells.end = cell_index(extent_.max[axis], options_.cell) + 1.0;
    return cells;
  }

  /// A quarter of the memory is for points that wait, another for those on their way there, half for windows.
  void plan_windows(const RasterGrid& grid, const MemoryBudget& whole) {
    const std::uint64_t half = whole.capacity() / 2, quarter = whole.capacity() / 4;
    const auto bytes = [&](std::int64_t side) { return scan_window_bytes(side, outputs_.size()); };
    std::int64_t side = kMinScanWindow;
    if (options_.tile > 0) {
      side = std::min<std::int64_t>(options_.tile, kMaxScanWindow);
    } else {
      const std::int64_t most = std::max(grid.columns, grid.rows);
      while (2 * side <= kMaxScanWindow && side < most &&
             bytes(2 * side) * static_cast<std::uint64_t>(threads_) <= half)
        side *= 2;
      // Rasters of very many windows: their buffers must fit, too.
      while (2 * side <= kMaxScanWindow && bytes(2 * side) <= half &&
             buckets(grid, side) * kMinChunk > quarter)
        side *= 2;
    }
    windows_.cut(grid, side);
    const std::uint64_t buffers = buckets(grid, side) * kMinChunk;
    whole.require(std::max(4 * buffers, 2 * bytes(side)),
                  fmt::format("raster of {} x {} cells of {:g}", grid.columns, grid.rows, grid.cell));
    chunk_bytes_ =
        static_cast<std::size_t>(std::clamp<std::uint64_t>(quarter / windows_.count(), kMinChunk, kMaxChunk));
  }
  static std::uint64_t buckets(const RasterGrid& grid, std::int64_t side) {
    WindowPlan plan;
    plan.cut(grid, side);
    return static_cast<std::uint64_t>(plan.across) * static_cast<std::uint64_t>(plan.down);
  }

  /// The second pass: every point goes to its window.
  void deal(const RasterGrid& grid, SpillBuckets<DealtPoint>& dealt) {
    const double west = cell_index(extent_.min[0], grid.cell), north = cell_index(extent_.max[1], grid.cell);
    std::uint64_t points = 0;
    points_->read([&](const PointChunk& chunk) {
      for_each_seen(chunk, [&](std::size_t i, const Double3& p, bool ground) {
        if (p[0] < extent_.min[0] || p[0] > extent_.max[0] || p[1] < extent_.min[1] || p[1] > extent_.max[1])
          throw_changed();
        ++points;
        const auto column = static_cast<std::int64_t>(cell_index(p[0], grid.cell) - west);
        const auto row = static_cast<std::int64_t>(north - cell_index(p[1], grid.cell));
        const std::int64_t u = column / windows_.side, v = row / windows_.side;
        DealtPoint point;
        point.z = p[2];
        point.cell = static_cast<std::uint32_t>((row - v * windows_.side) * windows_.side + column -
                                                u * windows_.side);
        if (!chunk.rgba.empty()) point.rgba = chunk.rgba[i];
        if (!chunk.intensity.empty()) {
          point.intensity = chunk.intensity[i];
          point.cell |= DealtPoint::kIntensity;
        }
        if (ground) point.cell |= DealtPoint::kGround;
        dealt.add(static_cast<std::size_t>(v * windows_.across + u), point);
      });
    });
    if (points != extent_.points) throw_changed();
  }
  [[noreturn]] static void throw_changed() {
    throw InputError("an input changed while it was read; run the command again");
  }

  void sample(const RasterGrid& grid, const SpillBuckets<DealtPoint>& dealt, std::size_t k,
              RasterFiles& files) const {
    throw_if_stopped();
    const auto side = static_cast<std::size_t>(windows_.side);
    PointRaster raster(side * side, kSeenCells * grid.cell);
    const auto each = [&](const auto& use) {
      dealt.for_each(k, [&](std::span<const DealtPoint> batch) {
        for (const DealtPoint& p : batch) use(p, p.cell & DealtPoint::kCell);
      });
    };
    each([&](const DealtPoint& p, std::size_t cell) {
      raster.add(cell, p.z, (p.cell & DealtPoint::kGround) != 0);
    });
    if (has_layer(RasterLayer::kOrtho) || has_layer(RasterLayer::kIntensity))
      each([&](const DealtPoint& p, std::size_t cell) {
        const bool measured = (p.cell & DealtPoint::kIntensity) != 0;
        raster.add_seen(cell, p.z, p.rgba, measured ? std::int32_t{p.intensity} : -1);
      });
    const RasterWindow w = windows_.window(k, grid);
    RasterRows rows(files);
    std::vector<std::uint8_t> inside(static_cast<std::size_t>(w.columns));
    for (std::int64_t r = 0; r < w.rows; ++r) {
      for (std::int64_t c = 0; c < w.columns; ++c)
        inside[static_cast<std::size_t>(c)] = grid.inside(w.column + c, w.row + r, extent_.min[0],
                                                          extent_.max[0], extent_.min[1], extent_.max[1]);
      rows.put(w.column, w.row + r,
               std::span<const ScanCell>(&raster.cells()[static_cast<std::size_t>(r) * side], inside.size()),
               inside);
    }
    rows.finish();
  }

  RasterOptions options_;
  const std::vector<RasterOutput>& outputs_;
  std::string name_;
  int threads_;
  std::unique_ptr<MeasuredPoints> points_;
  PointExtent extent_;
  std::uint64_t left_out_ = 0;
  WindowPlan windows_;
  std::size_t chunk_bytes_ = kMaxChunk;
};

}  // namespace

bool is_mesh_input(const std::filesystem::path& input) {
  return converts_as_mesh(input, "mesh.ply");
}

RasterReport write_scan_rasters(const std::vector<std::filesystem::path>& scans, const RasterOptions& options,
                                const std::vector<std::string>& columns,
                                const std::vector<RasterOutput>& outputs) {
  gdal_program();  // before the work
  return ScanRasterJob(scans, options, columns, outputs).run();
}

}  // namespace tessera
