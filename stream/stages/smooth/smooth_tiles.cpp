#include "stream/stages/smooth/smooth_tiles.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>
#include <span>
#include <utility>

#include "octree/error.h"

namespace tessera {
namespace {

constexpr std::uint64_t kTaskFaces = 500'000;  ///< a task is worth a file from about this many
constexpr std::uint64_t kMaxTasks = 400;
/// Of the vertices that rings hold on a regular mesh: margins with so many times as many are no bargain.
constexpr double kWasteful = 4.0;

struct TileAround {
  SmoothTile tile;
  std::uint64_t vertices = 0;  ///< of all patches within the margin
};

/// \param patches  indices
TileAround look_around(const MeshStore& store, const PatchRange& range, const SmoothTiling& tiling,
                       std::span<const std::size_t> patches) {
  TileAround found;
  SmoothTile& tile = found.tile;
  tile.patches.assign(patches.begin(), patches.end());
  std::sort(tile.patches.begin(), tile.patches.end());
  const MeshBox core = store.box_of(tile.patches);
  double longest = 0.0;
  for (const std::size_t p : patches) longest = std::max(longest, range.longest_edge[p]);
  // A longer edge within the margin widens it; it ends at the latest when all patches are in.
  for (double seen = 0.0;; longest = seen) {
    tile.margin = tiling.rings * longest + tiling.range;
    std::uint64_t faces = 0;
    found.vertices = 0;
    seen = longest;
    for (const std::size_t p : store.select(grown(core, tile.margin))) {
      found.vertices += store.patches()[p].vertices;
      faces += store.patches()[p].faces;
      seen = std::max(seen, range.longest_edge[p]);
    }
    tile.bytes = tiling.bytes(found.vertices, faces);
    if (seen == longest) return found;
  }
}

/// Vertices of a regular mesh within so many rings around so many.
double around_rings(std::uint64_t vertices, int rings) {
  const double across = std::sqrt(static_cast<double>(vertices)) + 2.0 * rings;
  return across * across;
}

class Cutter {
 public:
  Cutter(const MeshStore& store, const PatchRange& range, const SmoothTiling& tiling)
      : store_(store), range_(range), tiling_(tiling) {}

  /// Halves along the longest extent, by faces, until a part and its surroundings fit.
  void cut(std::span<std::size_t> patches) {
    if (patches.empty()) return;
    std::array<std::int32_t, 3> low, high;
    low.fill(std::numeric_limits<std::int32_t>::max());
    high.fill(std::numeric_limits<std::int32_t>::min());
    std::uint64_t vertices = 0, faces = 0;
    for (const std::size_t p : patches) {
      const Int3 brick = brick_of_key(store_.patches()[p].key);
      for (std::size_t a = 0; a < 3; ++a) {
        low[a] = std::min(low[a], brick[a]);
        high[a] = std::max(high[a], brick[a]);
      }
      vertices += store_.patches()[p].vertices;
      faces += store_.patches()[p].faces;
    }
    std::size_t axis = 0;
    for (std::size_t a = 1; a < 3; ++a)
      if (high[a] - low[a] > high[axis] - low[axis]) axis = a;
    const bool small = tiling_.tile_bricks == 0 || high[axis] - low[axis] < tiling_.tile_bricks;
    // What is too large by itself is not worth looking around.
    if (patches.size() == 1 || (small && tiling_.bytes(vertices, faces) <= tiling_.tile_bytes)) {
      SmoothTile tile = tiling_.few_rings > 0 ? ring_tile(patches, vertices) : margin_tile(patches, vertices);
      if (patches.size() == 1 || tile.bytes <= tiling_.tile_bytes) {
        if (tile.by_rings) tile.bytes = tiling_.ring_bytes;
        tiles.push_back(std::move(tile));
        return;
      }
    }
    std::sort(patches.begin(), patches.end(), [&](std::size_t p, std::size_t q) {
      const std::int32_t x = brick_of_key(store_.patches()[p].key)[axis],
                         y = brick_of_key(store_.patches()[q].key)[axis];
      return x != y ? x < y : p < q;
    });
    std::uint64_t before = 0;
    std::size_t half = 0;
    while (half + 1 < patches.size() && 2 * before < faces) before += store_.patches()[patches[half++]].faces;
    cut(patches.first(half));
    cut(patches.subspan(half));
  }

  std::vector<SmoothTile> tiles;

 private:
  SmoothTile ring_tile(std::span<const std::size_t> patches, std::uint64_t vertices) const {
    SmoothTile tile;
    tile.patches.assign(patches.begin(), patches.end());
    std::sort(tile.patches.begin(), tile.patches.end());
    tile.by_rings = true;
    const auto around = static_cast<std::uint64_t>(around_rings(vertices, tiling_.few_rings));
    tile.bytes = tiling_.bytes(around, 2 * around);
    return tile;
  }

  SmoothTile margin_tile(std::span<const std::size_t> patches, std::uint64_t vertices) const {
    auto [tile, around] = look_around(store_, range_, tiling_, patches);
    tile.by_rings = tiling_.ring_bytes > 0 && patches.size() == 1 &&
                    (tile.bytes > tiling_.tile_bytes ||
                     static_cast<double>(around) > kWasteful * around_rings(vertices, tiling_.rings));
    return tile;
  }

  const MeshStore& store_;
  const PatchRange& range_;
  const SmoothTiling& tiling_;
};

}  // namespace

std::uint64_t task_bytes(const SmoothTask& task) {
  std::uint64_t bytes = 0;
  for (const SmoothTile& tile : task) bytes = std::max(bytes, tile.bytes);
  return bytes;
}

std::vector<SmoothTask> make_smooth_tasks(const MeshStore& store, const PatchRange& range,
                                          const SmoothTiling& tiling) {
  std::vector<std::size_t> all(store.patches().size());
  std::iota(all.begin(), all.end(), std::size_t{0});
  return make_smooth_tasks(store, range, tiling, std::move(all));
}

std::vector<SmoothTask> make_smooth_tasks(const MeshStore& store, const PatchRange& range,
                                          const SmoothTiling& tiling, std::vector<std::size_t> patches) {
  if (range.longest_edge.size() != store.patches().size())
    throw InputError("the list of longest edges belongs to another mesh; run again with --force");
  Cutter cutter(store, range, tiling);
  cutter.cut(patches);
  const std::uint64_t target = std::max(kTaskFaces, store.face_count() / kMaxTasks);
  std::vector<SmoothTask> tasks;
  SmoothTask task;
  std::uint64_t faces = 0;
  for (SmoothTile& tile : cutter.tiles) {
    for (const std::size_t p : tile.patches) faces += store.patches()[p].faces;
    task.push_back(std::move(tile));
    if (faces < target) continue;
    tasks.push_back(std::move(task));
    task.clear();
    faces = 0;
  }
  if (!task.empty()) tasks.push_back(std::move(task));
  return tasks;
}

}  // namespace tessera
