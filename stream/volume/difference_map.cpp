#include "stream/volume/difference_map.h"

#include <algorithm>
#include <array>
#include <span>

#include <fmt/format.h>

#include "kernels/survey/plan_raster.h"
#include "octree/error.h"
#include "stream/raster/mesh_frame.h"
#include "stream/raster/raster_output.h"
#include "stream/runtime/disk_space.h"
#include "stream/runtime/stop.h"

namespace tessera {
namespace {

constexpr std::int64_t kMinSide = 64, kMaxSide = 1024;

/// Samples windows of both surfaces and writes what lies between.
class DifferenceSampler {
 public:
  DifferenceSampler(const MeshStore& mesh, const DifferenceMap& map, const MeshFrame& frame,
                    RasterFiles& files)
      : mesh_(mesh), map_(map), frame_(frame), files_(files) {}

  std::uint64_t bytes(const RasterWindow& window) const {
    return 2 * window.size() * sizeof(RasterCell) + (std::uint64_t{1} << 20) +
           2 * mesh_.largest_patch_bytes() +
           (map_.surface != nullptr ? map_.surface->window_bytes(frame_.column(window)) : 0);
  }

  void sample(const RasterWindow& window) {
    PlanRaster top(window, frame_.cell), base(window, frame_.cell);
    for (const std::size_t patch : mesh_.select(frame_.column(window))) {
      throw_if_stopped();
      add(triangles_of(mesh_.load(std::array{patch}), map_.origin), top);
    }
    if (map_.surface != nullptr)
      map_.surface->for_triangles(frame_.column(window),
                                  [&](std::span<const SpaceTriangle> triangles) { add(triangles, base); });
    const MeshBox around = frame_.column(window);
    PlanBox box;
    for (const Double3& corner : {around.low - map_.origin, around.high - map_.origin})
      box.add({corner[0], corner[1]});
    for (const ToeSurface& toe : *map_.toes)
      if (toe.faces.box().meets(box)) add(toe.triangles, base);
    write(window, top.cells(), base.cells());
  }

 private:
  void add(std::span<const SpaceTriangle> triangles, PlanRaster& to) const {
    const Double3 move = map_.origin - Double3{frame_.west, frame_.north, 0.0};
    for (const SpaceTriangle& t : triangles) to.add({t[0] + move, t[1] + move, t[2] + move}, nullptr);
  }

  bool is_wanted(std::int64_t column, std::int64_t row) const {
    const Double2 at = frame_.centre(column, row);
    return map_.areas->empty() ||
           std::any_of(map_.areas->begin(), map_.areas->end(),
                       [&](const VolumeArea& a) { return a.polygon->holds(at[0], at[1]); });
  }

  void write(const RasterWindow& window, const std::vector<RasterCell>& top,
             const std::vector<RasterCell>& base) {
    const bool level = map_.surface == nullptr && map_.toes->empty();
    RasterRows rows(files_);
    const auto width = static_cast<std::size_t>(window.columns);
    std::vector<RasterCell> both(width);
    std::vector<std::uint8_t> inside(width, 1);
    for (std::int64_t r = 0; r < window.rows; ++r) {
      for (std::size_t c = 0; c < width; ++c) {
        const std::size_t k = static_cast<std::size_t>(r) * width + c;
        both[c] = {};
        if (!top[k].covered() || !(level || base[k].covered()) ||
            !is_wanted(window.column + static_cast<std::int64_t>(c), window.row + r))
          continue;
        both[c].top = top[k].top, both[c].ground = level ? map_.level : base[k].top;
      }
      rows.put<RasterCell>(window.column, window.row + r, both, inside);
    }
    rows.finish();
  }

  const MeshStore& mesh_;
  const DifferenceMap& map_;
  const MeshFrame& frame_;
  RasterFiles& files_;
};

}  // namespace

std::string write_difference(const MeshStore& mesh, const DifferenceMap& map,
                             const std::filesystem::path& scratch, WorkerPool& pool, MemoryBudget& budget,
                             const std::filesystem::path& output) {
  const MeshFrame frame(mesh.box(), map.cell);
  const std::vector<RasterOutput> outputs = {{RasterLayer::kHeight, output, "difference"}};
  require_disk(
      std::array{DiskNeed{scratch, 2 * RasterFiles::raw_bytes(frame.cells(), outputs), "the raw map"}},
      kLargerDisk);
  LayerSettings settings;
  settings.low = std::min(mesh.box().low[2], map.low);
  settings.high = std::max(mesh.box().high[2], map.high);
  RasterFiles files(frame, settings, outputs, scratch);
  DifferenceSampler sampler(mesh, map, frame, files);
  const std::uint64_t share = budget.capacity() / static_cast<std::uint64_t>(pool.threads());
  std::int64_t side = kMinSide;
  while (side < kMaxSide && side < std::max(frame.columns, frame.rows) &&
         sampler.bytes({0, 0, 2 * side, 2 * side}) <= share)
    side *= 2;
  const std::int64_t across = (frame.columns + side - 1) / side, down = (frame.rows + side - 1) / side;
  const auto window = [&](std::size_t k) {
    RasterWindow w;
    w.column = static_cast<std::int64_t>(k) % across * side,
    w.row = static_cast<std::int64_t>(k) / across * side;
    w.columns = std::min(side, frame.columns - w.column), w.rows = std::min(side, frame.rows - w.row);
    return w;
  };
  pool.run_tasks(
      static_cast<std::size_t>(across * down), [&](std::size_t k) { return sampler.bytes(window(k)); },
      budget, [&](std::size_t k) { sampler.sample(window(k)); });
  trim_allocator();
  RasterOptions options;
  options.crs = map.crs, options.memory_bytes = map.memory_bytes;
  return files.finish("--map " + output.string(), options).warnings;
}

}  // namespace tessera
