#include "stream/raster/mesh_raster.h"

#include <algorithm>
#include <array>

#include "kernels/survey/plan_raster.h"
#include "kernels/survey/relief.h"
#include "octree/error.h"
#include "stream/files/scratch_folder.h"
#include "stream/import/import_mesh.h"
#include "stream/meshes/mesh_store.h"
#include "stream/raster/mesh_frame.h"
#include "stream/runtime/disk_space.h"
#include "stream/runtime/memory_budget.h"
#include "stream/runtime/parallel.h"
#include "stream/runtime/stop.h"
#include "stream/survey/gdal_program.h"

namespace tessera {
namespace {

constexpr std::int64_t kMinWindow = 64, kMaxWindow = 2048;

void add_patch(const MeshBlock& block, const MeshFrame& frame, PlanRaster& raster) {
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
std::int64_t window_side(const MeshFrame& frame, const MeshStore& store, const MemoryBudget& budget,
                         int threads, std::size_t layers) {
  const std::uint64_t share = budget.capacity() / static_cast<std::uint64_t>(threads);
  std::int64_t side = kMinWindow;
  while (side < kMaxWindow && side < std::max(frame.columns, frame.rows) &&
         window_bytes(2 * side, layers) + store.largest_patch_bytes() <= share)
    side *= 2;
  return side;
}

void sample_window(const MeshStore& store, const MeshFrame& frame, const RasterWindow& window,
                   RasterFiles& files) {
  PlanRaster raster(window, frame.cell);
  for (const std::size_t patch : store.select(frame.column(window))) {
    throw_if_stopped();
    add_patch(store.load(std::array{patch}), frame, raster);
  }
  RasterRows rows(files);
  const auto width = static_cast<std::size_t>(window.columns);
  std::vector<std::uint8_t> inside(width);
  for (std::int64_t r = 0; r < window.rows; ++r) {
    for (std::size_t c = 0; c < width; ++c)
      inside[c] = frame.holds_centre(window.column + static_cast<std::int64_t>(c), window.row + r);
    rows.put(window.column, window.row + r,
             std::span<const RasterCell>(&raster.cells()[static_cast<std::size_t>(r) * width], width),
             inside);
  }
  rows.finish();
}

LayerSettings layer_settings(const RasterOptions& options, const MeshBox& box) {
  LayerSettings settings;
  settings.sun = sun_direction(options.azimuth, options.altitude);
  settings.nodata = static_cast<float>(options.nodata);
  settings.low = box.low[2], settings.high = box.high[2];
  return settings;
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
  const MeshFrame frame(store.box(), options.cell);
  require_disk(std::array{DiskNeed{scratch.path(), 2 * RasterFiles::raw_bytes(frame.cells(), outputs),
                                   "the raw raster"}},
               kLargerDisk);

  WorkerPool pool(run.threads);
  MemoryBudget budget(options.memory_bytes, resident_bytes());
  const std::int64_t side =
      options.tile > 0 ? options.tile : window_side(frame, store, budget, run.threads, outputs.size());
  const std::int64_t across = (frame.columns + side - 1) / side, down = (frame.rows + side - 1) / side;
  RasterFiles files(frame, layer_settings(options, store.box()), outputs, scratch.path());
  pool.run_tasks(
      static_cast<std::size_t>(across * down),
      [&](std::size_t) { return window_bytes(side, outputs.size()) + store.largest_patch_bytes(); }, budget,
      [&](std::size_t k) {
        throw_if_stopped();
        RasterWindow w;
        w.column = static_cast<std::int64_t>(k) % across * side,
        w.row = static_cast<std::int64_t>(k) / across * side;
        w.columns = std::min(side, frame.columns - w.column), w.rows = std::min(side, frame.rows - w.row);
        sample_window(store, frame, w, files);
      });
  trim_allocator();
  return files.finish(mesh.string(), options);
}

}  // namespace tessera
