/// \file tile_cut.h
/// Which tiles a level has: cells of the octree of bricks. A cell of one level is made of whole cells of the level below.
#pragma once
#include <cstdint>
#include <span>
#include <vector>

namespace tessera {

/// A node of the octree over the bricks, and the bricks of level 0 in it.
struct TileCell {
  std::uint64_t code = 0;             ///< Morton code of the node: key of a brick >> 3 depth
  std::uint32_t depth = 0;            ///< 0 = a brick
  std::uint64_t first = 0, last = 0;  ///< patches [first, last) of level 0
  bool operator==(const TileCell&) const = default;
};

/// Bricks of a level, ascending, and how many faces each has.
struct BrickFaces {
  std::vector<std::uint64_t> key;
  std::vector<std::uint64_t> faces;
};

/// The largest cells with at most `tile_faces` faces of the level, in ascending order; a cell of the level below with
/// more is a cell too. Together they hold every brick of level 0 once.
/// \param level0  keys of the patches of level 0, ascending
/// \param below   cells of the level below; empty for level 0: then single bricks stand for it
std::vector<TileCell> cut_level(std::span<const std::uint64_t> level0, const BrickFaces& level,
                                std::span<const TileCell> below, std::uint64_t tile_faces);

}  // namespace tessera
