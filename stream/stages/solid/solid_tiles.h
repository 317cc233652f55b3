/// \file solid_tiles.h
/// How the surface of solids is cut into tiles. Tiles carry no meaning: any cut gives the same patches.
#pragma once
#include <algorithm>
#include <cstdint>
#include <functional>
#include <span>
#include <vector>

#include "kernels/solid/mesh_solid.h"
#include "stream/stages/surface/surface_stage.h"

namespace tessera {

/// What faces put into a block.
struct SolidLoad {
  std::uint64_t leaves = 0;  ///< with a crossing, of every operand for itself
  std::uint64_t crossings = 0;
};

/// The leaves of all operands, as their tables have them.
class SolidTiling {
 public:
  /// \param tables  per operand: the leaves at its surface; they stay where they are
  /// \param bricks_low, bricks_high  bricks that the solids may touch  \param open  membranes may pass any of them
  /// \param more  bytes that a block takes beside its field
  SolidTiling(std::vector<const LineWindings*> tables, const Int3& bricks_low, const Int3& bricks_high,
              bool open, std::function<std::uint64_t(const SolidBlock&)> more = {});

  /// Calls for the leaves of a table that a block holds, in the order of the table.
  template <class Visit>
  static void for_each_leaf(const SolidBlock& block, const LineWindings& table, const Visit& visit) {
    Int3 low, high;
    for (std::size_t a = 0; a < 3; ++a) {
      low[a] = std::max(0, block.origin[a] / kLeafCells - 1);
      high[a] = (block.origin[a] + block.cells[a]) / kLeafCells;
    }
    const auto& leaves = table.leaves();
    for (int z = low[2]; z <= high[2]; ++z)
      for (int y = low[1]; y <= high[1]; ++y) {
        auto at = std::lower_bound(leaves.begin(), leaves.end(), leaf_row_key({low[0], y, z}),
                                   [](const LeafWindings& l, std::uint64_t k) { return l.key < k; });
        const std::uint64_t last = leaf_row_key({high[0], y, z});
        for (; at != leaves.end() && at->key <= last; ++at) visit(*at);
      }
  }

  SolidLoad load(const SolidBlock& block) const;
  /// Upper bound of what the field of a tile and its patches take.
  std::uint64_t tile_bytes(const Tile& tile) const;
  /// The same of a brick with so many leaves at one closed surface: the least that a tile can be.
  static std::uint64_t brick_bytes(std::uint64_t leaves, std::size_t operands);
  /// Tasks in Morton order; they depend on the solids alone.
  /// \param max_bricks  edge of a tile  \param max_bytes  tiles over it are split down to one brick
  std::vector<TileGroup> groups(int max_bricks, std::uint64_t max_bytes) const;

 private:
  void split(const Tile& tile, int max_bricks, std::uint64_t max_bytes, TileGroup& out) const;
  std::vector<const LineWindings*> tables_;
  Int3 low_, high_;
  bool open_;
  std::function<std::uint64_t(const SolidBlock&)> more_;
  std::uint64_t leaves_ = 0;
};

inline SolidBlock solid_block(const Tile& tile) {
  return {tile.corner(), tile.edges()};
}

}  // namespace tessera
