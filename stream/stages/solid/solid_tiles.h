/// \file solid_tiles.h
/// How the surface of solids is cut into tiles. Tiles carry no meaning: any cut gives the same patches.
#pragma once
#include <cstdint>
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
  /// \param bricks_low, bricks_high  bricks that the solids may touch: looked through where a mesh is open
  SolidTiling(const std::vector<MeshSolid>& solids, const Int3& bricks_low, const Int3& bricks_high);

  SolidLoad load(const SolidBlock& block) const;
  /// Upper bound of what the field of a tile and its patches take.
  std::uint64_t tile_bytes(const Tile& tile) const;
  /// Tasks in Morton order; they depend on the solids alone.
  /// \param most_bricks  edge of a tile  \param most_bytes  tiles over it are split down to one brick
  std::vector<TileGroup> groups(int most_bricks, std::uint64_t most_bytes) const;

 private:
  void split(const Tile& tile, int most_bricks, std::uint64_t most_bytes, TileGroup& out) const;
  const std::vector<MeshSolid>* solids_;
  Int3 low_, high_;
  bool open_ = false;
  std::uint64_t leaves_ = 0;
};

inline SolidBlock solid_block(const Tile& tile) {
  return {tile.corner(), tile.edges()};
}

}  // namespace tessera
