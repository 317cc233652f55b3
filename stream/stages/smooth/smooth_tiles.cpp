#include "stream/stages/smooth/smooth_tiles.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>
#include <span>

#include "octree/error.h"
#include "stream/runtime/memory_budget.h"

namespace tessera {
namespace {

constexpr std::uint64_t kTaskFaces = 500'000;  ///< a task is worth a file from about this many
constexpr std::uint64_t kMaxTasks = 400;
/// How far edges in line reach beyond the mean one: the diagonals of a regular grid 1.22 times, and some more.
constexpr double kInLine = 1.25;

constexpr double kWider = 1.5;

/// \param patches  indices   \param margin  of a tile that need not be sure; 0 = what is mostly enough
SmoothTile look_around(const MeshStore& store, const PatchRange& range, const SmoothTiling& tiling,
                       std::span<const std::size_t> patches, bool sure, double margin = 0.0) {
  SmoothTile tile;
  tile.patches.assign(patches.begin(), patches.end());
  std::sort(tile.patches.begin(), tile.patches.end());
  tile.sure = sure;
  const MeshBox core = store.box_of(tile.patches);
  const auto load = [&](double around) {
    tile.margin = around;
    std::uint64_t vertices = 0, faces = 0;
    double seen = 0.0;
    for (const std::size_t p : store.select(grown(core, around))) {
      vertices += store.patches()[p].vertices;
      faces += store.patches()[p].faces;
      seen = std::max(seen, range.longest_edge[p]);
    }
    tile.bytes = tiling.bytes(vertices, faces);
    return seen;
  };
  double longest = 0.0, edge = 0.0;
  for (const std::size_t p : patches) {
    longest = std::max(longest, range.longest_edge[p]);
    const auto edges = 3.0 * static_cast<double>(store.patches()[p].faces);
    edge = std::max(edge, edges > 0.0 ? range.edge_squares[p] / edges : 0.0);
  }
  if (!sure) {
    load(margin > 0.0 ? margin : kInLine * tiling.mostly_edges * std::sqrt(edge) + tiling.range);
    return tile;
  }
  // A longer edge within the margin widens it; it ends at the latest when all patches are in.
  for (double seen = 0.0;; longest = seen) {
    seen = std::max(longest, load(tiling.rings * longest + tiling.range));
    if (seen == longest) return tile;
  }
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
      SmoothTile tile = look_around(store_, range_, tiling_, patches, !(tiling_.mostly_edges > 0.0));
      if (!tile.sure)
        for (const std::size_t p : patches) tile.bytes = std::max(tile.bytes, surely(p));
      if (patches.size() == 1 || tile.bytes <= tiling_.tile_bytes) {
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
  /// Bytes of the sure tile of a patch.
  std::uint64_t surely(std::size_t p) {
    if (sure_bytes_.empty()) sure_bytes_.resize(store_.patches().size(), 0);
    if (sure_bytes_[p] == 0) {
      sure_bytes_[p] = look_around(store_, range_, tiling_, {&p, 1}, true).bytes;
      if (tiling_.largest_bytes > 0) sure_bytes_[p] = std::min(sure_bytes_[p], tiling_.largest_bytes);
    }
    return sure_bytes_[p];
  }

  const MeshStore& store_;
  const PatchRange& range_;
  const SmoothTiling& tiling_;
  std::vector<std::uint64_t> sure_bytes_;  ///< of each patch, 0: not known yet
};

}  // namespace

std::uint64_t task_bytes(const SmoothTask& task) {
  std::uint64_t bytes = 0;
  for (const SmoothTile& tile : task) bytes = std::max(bytes, tile.bytes);
  return bytes;
}

SmoothTile wider_tile(const MeshStore& store, const PatchRange& range, const SmoothTiling& tiling,
                      std::size_t patch, double margin_before, std::uint64_t bytes) {
  SmoothTile sure = look_around(store, range, tiling, {&patch, 1}, true);
  if (sure.bytes <= bytes) return sure;
  // What all rings can reach is never passed, and a margin of nothing grows too.
  const double margin = std::clamp(kWider * margin_before, sure.margin / 64.0, sure.margin);
  SmoothTile wider = look_around(store, range, tiling, {&patch, 1}, false, margin);
  if (wider.bytes > bytes)
    throw ResourceError("the surroundings that smoothing needs of a patch of " +
                        std::to_string(store.patches()[patch].faces) + " faces take " +
                        format_bytes(wider.bytes) + "; raise --memory to " +
                        std::to_string(cap_mib_for_guess(wider.bytes)) + "M");
  return wider;
}

std::vector<SmoothTask> make_smooth_tasks(const MeshStore& store, const PatchRange& range,
                                          const SmoothTiling& tiling) {
  if (range.longest_edge.size() != store.patches().size())
    throw InputError("the list of longest edges belongs to another mesh; run again with --force");
  Cutter cutter(store, range, tiling);
  std::vector<std::size_t> all(store.patches().size());
  std::iota(all.begin(), all.end(), std::size_t{0});
  cutter.cut(all);
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
