#include "stream/stages/plan/planned_patches.h"

#include <algorithm>

namespace tessera {
namespace {

constexpr double kSeamShare = 1.0 / 12.0;  // foreign vertices, and exported ones, of all
constexpr double kFacesPerComponent = 2000.0;
constexpr double kMaxFaces = 1.5;  // of a block in some patch, against the mean of all

}  // namespace

PlannedPatches plan_patches(std::span<const BrickEntry> bricks, const std::vector<TileGroup>& groups,
                            std::uint64_t faces) {
  double blocks = 0.0;
  for (const BrickEntry& brick : bricks) blocks += static_cast<double>(brick.blocks);
  const double per_block = kMaxFaces * static_cast<double>(faces) / std::max(1.0, blocks);
  PlannedPatches patches;
  for (const TileGroup& group : groups) {
    patches.first.push_back(patches.entries.size());
    for (const Tile& tile : group) {
      const std::uint64_t first = brick_key(tile.brick);
      const std::uint64_t end = first + static_cast<std::uint64_t>(tile.bricks * tile.bricks * tile.bricks);
      auto brick = std::lower_bound(bricks.begin(), bricks.end(), first,
                                    [](const BrickEntry& e, std::uint64_t key) { return e.key < key; });
      for (; brick != bricks.end() && brick->key < end; ++brick) {
        PatchEntry e;
        e.key = brick->key;
        const double count = per_block * static_cast<double>(brick->blocks);
        e.faces = static_cast<std::uint32_t>(count);
        e.vertices = static_cast<std::uint32_t>(count * kVerticesPerFace);
        e.foreign = e.exported = static_cast<std::uint32_t>(e.vertices * kSeamShare);
        e.components = 1 + static_cast<std::uint32_t>(count / kFacesPerComponent);
        patches.entries.push_back(e);
      }
    }
  }
  patches.first.push_back(patches.entries.size());
  return patches;
}

}  // namespace tessera
