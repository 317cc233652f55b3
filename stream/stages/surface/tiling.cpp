#include <algorithm>
#include <bit>

#include "stream/stages/surface/first_pass.h"
#include "stream/stages/surface/surface_stage.h"

namespace tessera {
namespace {

// A supercube is the unit of grouping: Morton-aligned, at least as large as any tile.
constexpr int kMaxSuperBricks = 8;
/// A task is worth a file from about so many points; where they are for sixty-odd tasks, larger ones need fewer syncs.
constexpr std::uint64_t kMinGroupPoints = 60'000, kMaxGroupPoints = 500'000, kEnoughGroups = 64;
constexpr std::uint64_t kMaxGroups = 400;

// Per point: record read, structure of arrays, gathered copy. Per occupied 8^3 block: about three band leaves with
// values, sums and roots, and the patch they become. Held by tests/stream/surface_test.
constexpr std::uint64_t kBytesPerPoint = 24 + 28 + 32;
constexpr std::uint64_t kBytesPerDipole = 28;
constexpr std::uint64_t kBytesPerBlock = 32'000;
constexpr std::uint64_t kFacesPerBlock = 256;    ///< twice what a plane has
constexpr std::uint64_t kBytesPerLeafSlot = 32;  ///< dense tables of point ranges, marks and leaves

/// \post  a multiple of kFirstPassEdge: a task has whole blocks of the first pass
int super_bricks(std::uint64_t points) {
  return points < 20'000'000 ? kFirstPassEdge : kMaxSuperBricks;
}

struct HaloCounts {
  std::uint64_t points = 0;
  std::uint64_t blocks = 0;
};

/// Points and occupied blocks of all bricks that the tile's halo touches.
HaloCounts halo_counts(std::span<const BrickEntry> bricks, const BrickSectionStore* closing, const Tile& tile,
                       int halo_cells) {
  const int margin = (halo_cells + kBrickCells - 1) / kBrickCells;
  HaloCounts counts;
  for (int z = tile.brick[2] - margin; z < tile.brick[2] + tile.bricks + margin; ++z)
    for (int y = tile.brick[1] - margin; y < tile.brick[1] + tile.bricks + margin; ++y)
      for (int x = tile.brick[0] - margin; x < tile.brick[0] + tile.bricks + margin; ++x) {
        if (x < 0 || y < 0 || z < 0) continue;
        const BrickSection* closed = closing ? closing->find({x, y, z}) : nullptr;
        if (closed) counts.blocks += closed->count;
        const BrickEntry* brick = find_brick(bricks, brick_key({x, y, z}));
        if (!brick) continue;
        // Only a shell of a neighbour is read, but its points may all be there.
        counts.points += brick->points;
        counts.blocks += brick->blocks;
      }
  return counts;
}

std::uint64_t band_bytes(const HaloCounts& counts, const Tile& tile) {
  const auto leaves = static_cast<std::uint64_t>(tile.bricks * kBrickCells / kLeafCells + 2);
  const std::uint64_t slots = leaves * leaves * leaves;
  return std::min(counts.blocks, slots) * kBytesPerBlock + slots * kBytesPerLeafSlot;
}

void split(std::span<const BrickEntry> bricks, const TilingOptions& options, const Tile& tile,
           TileGroup& out) {
  const HaloCounts counts = halo_counts(bricks, options.closing, tile, options.halo_cells);
  if (counts.blocks == 0) return;
  const bool fits = tile_bytes(bricks, options.closing, tile, options.halo_cells) <= options.tile_bytes_limit;
  const bool small = options.tile_bricks == 0 || tile.bricks <= options.tile_bricks;
  if (tile.bricks == 1 || (fits && small)) {
    out.push_back(tile);
    return;
  }
  const int half = tile.bricks / 2;
  for (int child = 0; child < 8; ++child)
    split(bricks, options,
          {{tile.brick[0] + (child & 1) * half, tile.brick[1] + (child >> 1 & 1) * half,
            tile.brick[2] + (child >> 2 & 1) * half},
           half},
          out);
}

}  // namespace

std::uint64_t tile_point_bytes(std::uint64_t points, const BrickSectionStore* closing) {
  return points * (kBytesPerPoint + (closing ? kBytesPerDipole : 0));
}

std::uint64_t tile_band_bytes(std::span<const BrickEntry> bricks, const BrickSectionStore* closing,
                              const Tile& tile, int halo_cells) {
  return band_bytes(halo_counts(bricks, closing, tile, halo_cells), tile);
}

std::uint64_t tile_bytes(std::span<const BrickEntry> bricks, const BrickSectionStore* closing,
                         const Tile& tile, int halo_cells) {
  const HaloCounts counts = halo_counts(bricks, closing, tile, halo_cells);
  return tile_point_bytes(counts.points, closing) + band_bytes(counts, tile);
}

std::uint64_t tile_faces(std::span<const BrickEntry> bricks, const BrickSectionStore* closing,
                         const Tile& tile, int halo_cells) {
  // Only the tile's own blocks emit faces.
  const auto own = static_cast<std::uint64_t>(tile.bricks * kBrickCells / kLeafCells);
  return std::min(halo_counts(bricks, closing, tile, halo_cells).blocks, own * own * own) * kFacesPerBlock;
}

std::vector<TileGroup> make_tile_groups(std::span<const BrickEntry> bricks, const TilingOptions& options) {
  std::uint64_t all = 0;
  for (const BrickEntry& brick : bricks) all += brick.points;
  const int super = super_bricks(all);
  const int shift = 3 * (std::bit_width(static_cast<unsigned>(super)) - 1);
  // Supercubes that a point can reach: those of every occupied brick and its 26 neighbours.
  std::vector<std::uint64_t> cubes;
  const auto unique = [&] {
    std::sort(cubes.begin(), cubes.end());
    cubes.erase(std::unique(cubes.begin(), cubes.end()), cubes.end());
  };
  std::size_t compact_at = 1 << 16;
  const auto add_around = [&](std::uint64_t key) {
    const Int3 b = brick_of_key(key);
    for (int d = 0; d < 27; ++d) {
      const Int3 n = {b[0] + d % 3 - 1, b[1] + d / 3 % 3 - 1, b[2] + d / 9 - 1};
      if (n[0] < 0 || n[1] < 0 || n[2] < 0) continue;
      cubes.push_back(brick_key(n) >> shift);
    }
    if (cubes.size() > compact_at) {
      unique();
      compact_at = 2 * cubes.size() + (1 << 16);
    }
  };
  for (const BrickEntry& brick : bricks) add_around(brick.key);
  if (options.closing)
    for (const BrickSection& brick : options.closing->bricks()) add_around(brick.key);
  unique();

  const std::uint64_t target =
      std::max(std::clamp(all / kEnoughGroups, kMinGroupPoints, kMaxGroupPoints), all / kMaxGroups);
  std::vector<TileGroup> groups;
  TileGroup group;
  std::uint64_t points = 0;
  for (const std::uint64_t cube : cubes) {
    split(bricks, options, {brick_of_key(cube << shift), super}, group);
    const std::uint64_t first = cube << shift;
    const std::uint64_t end = (cube + 1) << shift;
    auto it = std::lower_bound(bricks.begin(), bricks.end(), first,
                               [](const BrickEntry& e, std::uint64_t key) { return e.key < key; });
    for (; it != bricks.end() && it->key < end; ++it) points += it->points;
    if (points >= target) {
      if (!group.empty()) groups.push_back(std::move(group));
      group.clear();
      points = 0;
    }
  }
  if (!group.empty()) groups.push_back(std::move(group));
  return groups;
}

}  // namespace tessera
