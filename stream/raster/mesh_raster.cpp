#include "stream/raster/mesh_raster.h"

#include <fcntl.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cmath>
#include <memory>
#include <mutex>

#include <fmt/format.h>

#include "kernels/survey/relief.h"
#include "octree/error.h"
#include "stream/files/durable_file.h"
#include "stream/files/fault.h"
#include "stream/files/json.h"
#include "stream/files/path_text.h"
#include "stream/files/scratch_folder.h"
#include "stream/import/import_mesh.h"
#include "stream/meshes/mesh_column.h"
#include "stream/meshes/mesh_store.h"
#include "stream/runtime/disk_space.h"
#include "stream/runtime/memory_budget.h"
#include "stream/runtime/parallel.h"
#include "stream/runtime/stop.h"
#include "stream/survey/gdal_program.h"

namespace tessera {
namespace {

/// What GDAL can count.
constexpr double kMaxSide = 2147483647.0;
/// Whole numbers of doubles: beyond them cells have no edges of their own.
constexpr double kMaxIndex = 0x1p52;
constexpr std::int64_t kMinWindow = 64, kMaxWindow = 2048;

/// A raw file that windows are written into, row by row of the whole raster.
class RawRaster {
 public:
  explicit RawRaster(std::filesystem::path path)
      : path_(std::move(path)),
        fd_(::open(path_.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_NOFOLLOW | O_CLOEXEC, 0666)) {
    if (fd_ < 0) throw_write_error(path_, errno);
  }
  ~RawRaster() { ::close(fd_); }
  RawRaster(const RawRaster&) = delete;
  RawRaster& operator=(const RawRaster&) = delete;
  const std::filesystem::path& path() const { return path_; }
  void write_at(std::uint64_t offset, const char* from, std::uint64_t bytes) {
    fault_point(FaultPoint::kWrite);
    if (const int error = write_all_at(fd_, from, bytes, offset)) throw_write_error(path_, error);
  }

 private:
  std::filesystem::path path_;
  int fd_;
};

/// Cells of one axis that hold [low, high]: whole multiples `first` to `end` of the cell.
struct CellRange {
  double first = 0.0, end = 0.0;
  CellRange(double low, double high, double cell) {
    if (!(std::max(std::abs(low), std::abs(high)) / cell < kMaxIndex))
      throw UsageError(fmt::format("--cell {:g}: is too small for coordinates like {:.17g}", cell, high));
    first = std::floor(low / cell), end = std::ceil(high / cell);
    // A quotient may round across a whole number.
    while (first * cell > low) --first;
    while ((first + 1.0) * cell <= low) ++first;
    while (end * cell < high) ++end;
    while ((end - 1.0) * cell >= high) --end;
    end = std::max(end, first + 1.0);
  }
};

/// The whole raster.
struct RasterFrame {
  double cell, west, north;
  std::int64_t columns, rows;
  MeshBox box;  ///< of the mesh

  RasterFrame(const MeshBox& mesh, double edge) : cell(edge), box(mesh) {
    const CellRange x(box.low[0], box.high[0], cell), y(box.low[1], box.high[1], cell);
    if (!(x.end - x.first <= kMaxSide && y.end - y.first <= kMaxSide))
      throw UsageError(
          fmt::format("--cell {:g}: makes {:.3g} x {:.3g} cells, at most {:.3g} a side are possible", cell,
                      x.end - x.first, y.end - y.first, kMaxSide));
    west = x.first * cell, north = y.end * cell;
    columns = static_cast<std::int64_t>(x.end - x.first), rows = static_cast<std::int64_t>(y.end - y.first);
  }
  std::uint64_t cells() const {
    return static_cast<std::uint64_t>(columns) * static_cast<std::uint64_t>(rows);
  }
  /// All that may have a centre of the window below or above it.
  MeshBox column(const RasterWindow& w) const {
    const auto at = [&](std::int64_t k) { return static_cast<double>(k) * cell; };
    return column_of({{west + at(w.column), north - at(w.row + w.rows), box.low[2]},
                      {west + at(w.column + w.columns), north - at(w.row), box.high[2]}},
                     box);
  }
  bool inside(std::int64_t column, std::int64_t row) const {
    const double x = west + (static_cast<double>(column) + 0.5) * cell;
    const double y = north - (static_cast<double>(row) + 0.5) * cell;
    return x >= box.low[0] && x <= box.high[0] && y >= box.low[1] && y <= box.high[1];
  }
};

void add_patch(const MeshBlock& block, const RasterFrame& frame, PlanRaster& raster) {
  const Double3 corner = {frame.west, frame.north, 0.0};
  for (const auto& f : block.faces) {
    std::array<std::uint32_t, 3> rgba{};
    for (std::size_t k = 0; k < 3 && !block.rgba.empty(); ++k) rgba[k] = block.rgba[f[k]];
    raster.add({block.position[f[0]] - corner, block.position[f[1]] - corner, block.position[f[2]] - corner},
               block.rgba.empty() ? nullptr : &rgba);
  }
}

/// Bytes of a window while it is sampled, without the patch at hand.
std::uint64_t window_bytes(std::int64_t side, std::size_t layers) {
  const auto edge = static_cast<std::uint64_t>(side);
  return edge * edge * sizeof(RasterCell) + edge * 8 + layers * sizeof(LayerValues) +
         (std::uint64_t{1} << 20);
}

/// The largest window of which every thread can hold one.
std::int64_t window_side(const RasterFrame& frame, const MeshStore& store, const MemoryBudget& budget,
                         int threads, std::size_t layers) {
  const std::uint64_t share = budget.capacity() / static_cast<std::uint64_t>(threads);
  std::int64_t side = kMinWindow;
  while (side < kMaxWindow && side < std::max(frame.columns, frame.rows) &&
         window_bytes(2 * side, layers) + store.largest_patch_bytes() <= share)
    side *= 2;
  return side;
}

/// Samples windows and writes their values into raw files.
class RasterSampler {
 public:
  RasterSampler(const MeshStore& store, const RasterFrame& frame, const LayerSettings& settings,
                const std::vector<RasterOutput>& outputs, const std::filesystem::path& scratch)
      : store_(store), frame_(frame), settings_(settings), outputs_(outputs) {
    for (std::size_t k = 0; k < outputs.size(); ++k) {
      files_.push_back(std::make_unique<RawRaster>(scratch / fmt::format("layer{}.raw", k)));
      totals_.emplace_back(outputs[k].layer, settings);
    }
  }

  void sample(const RasterWindow& window) {
    PlanRaster raster(window, frame_.cell);
    for (const std::size_t patch : store_.select(frame_.column(window))) {
      throw_if_stopped();
      add_patch(store_.load(std::array{patch}), frame_, raster);
    }
    std::vector<LayerValues> values;
    for (const RasterOutput& output : outputs_) values.emplace_back(output.layer, settings_);
    const auto width = static_cast<std::size_t>(window.columns);
    std::vector<std::uint8_t> inside(width);
    std::vector<char> row(4 * width);
    for (std::int64_t r = 0; r < window.rows; ++r) {
      for (std::size_t c = 0; c < width; ++c)
        inside[c] = frame_.inside(window.column + static_cast<std::int64_t>(c), window.row + r);
      const std::span<const RasterCell> cells(&raster.cells()[static_cast<std::size_t>(r) * width], width);
      const auto first = static_cast<std::uint64_t>((window.row + r) * frame_.columns + window.column);
      for (std::size_t k = 0; k < values.size(); ++k) {
        values[k].put(cells, inside, row.data());
        const std::uint64_t bytes = values[k].bytes_per_cell();
        files_[k]->write_at(first * bytes, row.data(), width * bytes);
      }
    }
    const std::lock_guard lock(mutex_);
    for (std::size_t k = 0; k < values.size(); ++k) totals_[k].merge(values[k]);
  }

  const LayerValues& values(std::size_t output) const { return totals_[output]; }
  const std::filesystem::path& raw(std::size_t output) const { return files_[output]->path(); }

 private:
  const MeshStore& store_;
  const RasterFrame& frame_;
  LayerSettings settings_;
  const std::vector<RasterOutput>& outputs_;
  std::vector<std::unique_ptr<RawRaster>> files_;
  std::vector<LayerValues> totals_;
  std::mutex mutex_;
};

LayerSettings layer_settings(const RasterOptions& options, const MeshBox& box) {
  LayerSettings settings;
  settings.sun = sun_direction(options.azimuth, options.altitude);
  settings.nodata = static_cast<float>(options.nodata);
  settings.low = box.low[2], settings.high = box.high[2];
  return settings;
}

std::uint64_t raw_bytes(const RasterFrame& frame, const std::vector<RasterOutput>& outputs) {
  std::uint64_t bytes = 0;
  for (const RasterOutput& output : outputs)
    bytes += frame.cells() * LayerValues(output.layer, {}).bytes_per_cell();
  return bytes;
}

}  // namespace

RasterReport write_rasters(const std::filesystem::path& mesh, const RasterOptions& options,
                           const std::vector<RasterOutput>& outputs) {
  gdal_program();  // before the work
  const ScratchFolder scratch(options.temp, "raster");
  RunOptions run;
  run.memory_bytes = options.memory_bytes;
  run.threads = options.threads > 0 ? options.threads : core_count();
  const MeshStore store = import_mesh(mesh, scratch.path(), "mesh", run, throw_if_stopped);
  for (const RasterOutput& output : outputs)
    if (output.layer == RasterLayer::kOrtho && !store.info().colour)
      throw UsageError("--layer ortho: " + mesh.string() + " has no colours");
  const RasterFrame frame(store.box(), options.cell);
  require_disk(std::array{DiskNeed{scratch.path(), 2 * raw_bytes(frame, outputs), "the raw raster"}},
               kLargerDisk);

  WorkerPool pool(run.threads);
  MemoryBudget budget(options.memory_bytes, resident_bytes());
  const std::int64_t side =
      options.tile > 0 ? options.tile : window_side(frame, store, budget, run.threads, outputs.size());
  const std::int64_t across = (frame.columns + side - 1) / side, down = (frame.rows + side - 1) / side;
  RasterSampler sampler(store, frame, layer_settings(options, store.box()), outputs, scratch.path());
  pool.run_tasks(
      static_cast<std::size_t>(across * down),
      [&](std::size_t) { return window_bytes(side, outputs.size()) + store.largest_patch_bytes(); }, budget,
      [&](std::size_t k) {
        throw_if_stopped();
        RasterWindow w;
        w.column = static_cast<std::int64_t>(k) % across * side,
        w.row = static_cast<std::int64_t>(k) / across * side;
        w.columns = std::min(side, frame.columns - w.column), w.rows = std::min(side, frame.rows - w.row);
        sampler.sample(w);
      });
  trim_allocator();

  RasterReport report{frame.columns, frame.rows, frame.west, frame.north, {}, {}};
  for (std::size_t k = 0; k < outputs.size(); ++k) {
    report.values.push_back(sampler.values(k).count());
    if (report.values[k] == 0)
      throw EmptyError(fmt::format("{}: no cell of {:g} has a value of layer {}", mesh.string(), options.cell,
                                   name_of(outputs[k].layer)));
  }
  for (std::size_t k = 0; k < outputs.size(); ++k) {
    Json request = sampler.values(k).description();
    request["raw"] = json_text(sampler.raw(k));
    request["columns"] = frame.columns, request["rows"] = frame.rows;
    request["west"] = frame.west, request["north"] = frame.north, request["cell"] = frame.cell;
    request["valid_percent"] =
        100.0 * static_cast<double>(report.values[k]) / static_cast<double>(frame.cells());
    request["crs"] = options.crs;
    const std::string warnings =
        write_by_gdal(scratch.path(), "raster", request, options.memory_bytes, outputs[k].path);
    if (!warnings.empty()) report.warnings += warnings + "\n";
    std::filesystem::remove(sampler.raw(k));
  }
  return report;
}

}  // namespace tessera
