#include "stream/stages/solid/solid_tiles.h"

#include <algorithm>
#include <bit>

namespace tessera {
namespace {

constexpr std::uint64_t kSmallJob = 4096;  ///< leaves up to which tasks are cubes of 2^3 bricks, else of 4^3
constexpr std::uint64_t kGroupLeaves = 1000;  ///< a task is worth a file from about this many leaves
constexpr std::uint64_t kMaxGroups = 400;
/// Leaves with nodes of cells at a crossing, per leaf with one: a plane through corners of leaves has as many.
constexpr std::uint64_t kLeavesPerOccupied = 4;
/// A patch while it is extracted: 128 cells at the surface, a feature sample in each.
constexpr std::uint64_t kPatchBytesPerLeaf = 24'000;
constexpr std::uint64_t kBrickLeafCount = 512;
constexpr std::uint64_t kLeafCrossings = 128;  ///< of one with a surface across it

}  // namespace

SolidTiling::SolidTiling(std::vector<const LineWindings*> tables, const Int3& bricks_low,
                         const Int3& bricks_high, bool open,
                         std::function<std::uint64_t(const SolidBlock&)> more)
    : tables_(std::move(tables)), low_(bricks_low), high_(bricks_high), open_(open), more_(std::move(more)) {
  for (const LineWindings* t : tables_) leaves_ += t->leaves().size();
}

SolidLoad SolidTiling::load(const SolidBlock& block) const {
  SolidLoad load;
  for (const LineWindings* table : tables_)
    for_each_leaf(block, *table, [&](const LeafWindings& leaf) {
      ++load.leaves;
      load.crossings += leaf.crossings;
    });
  return load;
}

std::uint64_t SolidTiling::tile_bytes(const Tile& tile) const {
  const SolidBlock block = solid_block(tile);
  const SolidLoad load = this->load(block);
  const std::uint64_t slots = block.slots();
  const std::uint64_t leaves = open_ ? slots : std::min(slots, kLeavesPerOccupied * load.leaves);
  return solid_field_bytes(leaves, load.crossings + (open_ ? 128 * leaves : 0), slots, tables_.size()) +
         std::min(kBrickLeafCount, leaves) * kPatchBytesPerLeaf + (more_ ? more_(block) : 0);
}

std::uint64_t SolidTiling::brick_bytes(std::uint64_t leaves, std::size_t operands) {
  const SolidBlock block = solid_block({{0, 0, 0}, 1});
  const std::uint64_t near = std::min(block.slots(), kLeavesPerOccupied * leaves);
  return solid_field_bytes(near, leaves * kLeafCrossings, block.slots(), operands) +
         std::min(kBrickLeafCount, near) * kPatchBytesPerLeaf;
}

void SolidTiling::split(const Tile& tile, int max_bricks, std::uint64_t max_bytes, TileGroup& out) const {
  if (!open_ && load(solid_block(tile)).leaves == 0) return;
  if (tile.bricks == 1 || (tile.bricks <= max_bricks && tile_bytes(tile) <= max_bytes)) {
    out.push_back(tile);
    return;
  }
  const int half = tile.bricks / 2;
  for (int child = 0; child < 8; ++child)
    split({{tile.brick[0] + (child & 1) * half, tile.brick[1] + (child >> 1 & 1) * half,
            tile.brick[2] + (child >> 2 & 1) * half},
           half},
          max_bricks, max_bytes, out);
}

std::vector<TileGroup> SolidTiling::groups(int max_bricks, std::uint64_t max_bytes) const {
  const int super = leaves_ < kSmallJob ? 2 : 4;
  const int shift = 3 * (std::bit_width(static_cast<unsigned>(super)) - 1);
  std::vector<std::uint64_t> cubes;
  const auto unique = [&] {
    std::sort(cubes.begin(), cubes.end());
    cubes.erase(std::unique(cubes.begin(), cubes.end()), cubes.end());
  };
  if (open_) {
    for (int z = low_[2] - 1; z <= high_[2] + 1; ++z)
      for (int y = low_[1] - 1; y <= high_[1] + 1; ++y)
        for (int x = low_[0] - 1; x <= high_[0] + 1; ++x) cubes.push_back(brick_key({x, y, z}) >> shift);
  }
  for (const LineWindings* table : tables_)
    for (const LeafWindings& l : table->leaves()) {
      const Int3 leaf = leaf_of_row_key(l.key);
      for (int d = 0; d < 8; ++d) {
        // A leaf away on either side: its brick may hold cells of the leaf's crossings.
        const Int3 near = {leaf[0] + 2 * (d & 1) - 1, leaf[1] + 2 * (d >> 1 & 1) - 1,
                           leaf[2] + 2 * (d >> 2 & 1) - 1};
        const std::uint64_t cube = brick_key({near[0] >> 3, near[1] >> 3, near[2] >> 3}) >> shift;
        if (cubes.empty() || cubes.back() != cube) cubes.push_back(cube);
      }
      if (cubes.size() > (1u << 20)) unique();
    }
  unique();
  const std::uint64_t target = std::max(kGroupLeaves, leaves_ / kMaxGroups);
  std::vector<TileGroup> groups;
  TileGroup group;
  std::uint64_t leaves = 0;
  for (const std::uint64_t cube : cubes) {
    const Tile all{brick_of_key(cube << shift), super};
    const std::size_t before = group.size();
    split(all, max_bricks, max_bytes, group);
    if (group.size() == before) continue;
    leaves += load(solid_block(all)).leaves + (open_ ? 16 : 0);
    if (leaves < target) continue;
    groups.push_back(std::move(group));
    group.clear();
    leaves = 0;
  }
  if (!group.empty()) groups.push_back(std::move(group));
  return groups;
}

}  // namespace tessera
