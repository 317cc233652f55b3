#include "stream/stages/smooth_tiles.h"

#include <algorithm>

#include "octree/error.h"
#include "stream/direct_file.h"
#include "stream/read_file.h"

namespace tessera {
namespace {

constexpr std::uint64_t kTaskFaces = 500'000;  ///< a task is worth a file from about this many
constexpr std::uint64_t kMostTasks = 400;
constexpr int kKeyBits = 63;

class Cutter {
 public:
  Cutter(const MeshStore& store, const PatchReach& reach, const SmoothTiling& tiling)
      : store_(store), reach_(reach), tiling_(tiling) {}

  /// Patches [first, last) are all those below one octree node of 2^(bits/3) bricks an edge.
  void cut(std::size_t first, std::size_t last, int bits) {
    if (first == last) return;
    const bool small = tiling_.tile_bricks == 0 || (bits < 60 && (1 << (bits / 3)) <= tiling_.tile_bricks);
    // Larger than any tile: not worth looking around.
    std::uint64_t vertices = 0, faces = 0;
    for (std::size_t p = first; p < last; ++p) {
      vertices += store_.patches()[p].vertices;
      faces += store_.patches()[p].faces;
    }
    if (bits == 0 || (small && tiling_.bytes(vertices, faces) <= tiling_.tile_bytes)) {
      SmoothTile tile = look_around(first, last);
      if (bits == 0 || tile.bytes <= tiling_.tile_bytes) {
        tiles.push_back(std::move(tile));
        return;
      }
    }
    bits -= 3;
    while (first < last) {
      const std::uint64_t node = store_.patches()[first].key >> bits;
      std::size_t end = first;
      while (end < last && store_.patches()[end].key >> bits == node) ++end;
      cut(first, end, bits);
      first = end;
    }
  }

  std::vector<SmoothTile> tiles;

 private:
  SmoothTile look_around(std::size_t first, std::size_t last) const {
    SmoothTile tile;
    double longest = 0.0;
    for (std::size_t p = first; p < last; ++p) {
      tile.patches.push_back(p);
      longest = std::max(longest, reach_.longest_edge[p]);
    }
    const MeshBox core = store_.box_of(tile.patches);
    // A longer edge within the margin widens it; it ends at the latest when all patches are in.
    for (;;) {
      tile.margin = tiling_.rings * longest;
      std::uint64_t vertices = 0, faces = 0;
      double seen = longest;
      for (const std::size_t p : store_.select(grown(core, tile.margin))) {
        vertices += store_.patches()[p].vertices;
        faces += store_.patches()[p].faces;
        seen = std::max(seen, reach_.longest_edge[p]);
      }
      tile.bytes = tiling_.bytes(vertices, faces);
      if (seen == longest) return tile;
      longest = seen;
    }
  }

  const MeshStore& store_;
  const PatchReach& reach_;
  const SmoothTiling& tiling_;
};

}  // namespace

void PatchReach::save(const std::filesystem::path& path) const {
  DirectFile file(path);
  if (!longest_edge.empty()) file.write(longest_edge.data(), longest_edge.size() * sizeof(double));
  file.finish();
}

PatchReach PatchReach::load(const std::filesystem::path& path) {
  const ReadFile file(path);
  PatchReach reach;
  reach.longest_edge.resize(file.size() / sizeof(double));
  file.read_at(0, reach.longest_edge.data(), reach.longest_edge.size() * sizeof(double));
  return reach;
}

std::vector<SmoothTask> make_smooth_tasks(const MeshStore& store, const PatchReach& reach,
                                          const SmoothTiling& tiling) {
  if (reach.longest_edge.size() != store.patches().size())
    throw InputError("the list of longest edges belongs to another mesh; run again with --force");
  Cutter cutter(store, reach, tiling);
  cutter.cut(0, store.patches().size(), kKeyBits);
  const std::uint64_t target = std::max(kTaskFaces, store.face_count() / kMostTasks);
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
