/// \file tile.h
/// Cubes of bricks that are computed at once, and those of one task.
#pragma once
#include <vector>

#include "octree/vector.h"
#include "stream/points/point_store.h"

namespace tessera {

/// A cube of bricks that is computed at once. Carries no meaning: any tiling gives the same patches.
struct Tile {
  Int3 brick = {0, 0, 0};
  int bricks = 1;  ///< edge in bricks, a power of two; the min corner is a multiple of it

  Int3 corner() const { return {brick[0] * kBrickCells, brick[1] * kBrickCells, brick[2] * kBrickCells}; }
  Int3 edges() const { return {bricks * kBrickCells, bricks * kBrickCells, bricks * kBrickCells}; }
};

/// Tiles of one task, in Morton order.
using TileGroup = std::vector<Tile>;

}  // namespace tessera
