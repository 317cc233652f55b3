/// \file ground_tiles.h
/// The ground of a scan of any size: find_ground() on blocks with their halo, of which only the core is kept. Blocks
/// begin at the scan's first cell and have one size, so the result hangs on the scan and the rules alone.
#pragma once
#include <cstdint>
#include <filesystem>
#include <mutex>

#include "kernels/points/ground_filter.h"
#include "kernels/points/roof_cells.h"
#include "kernels/points/water_cells.h"
#include "stream/runtime/memory_budget.h"
#include "stream/runtime/parallel.h"
#include "stream/survey/lowest_heights.h"
#include "stream/survey/scratch_tiles.h"

namespace tessera {

class GroundTiles {
 public:
  /// \param factor  cells are so many times as wide as those of `lowest`
  /// \param roofs   in steps of heights; without a height none are looked for
  /// \param water   without a width none is looked for
  /// \param rules   its cell is set by this \pre lowest.finish(), lowest.points() > 0
  GroundTiles(const LowestHeights& lowest, std::int32_t factor, const GroundRules& rules,
              const RoofRules& roofs, const WaterRules& water, const std::filesystem::path& file);

  /// Memory of a block of a raster of such a size, cells.
  static std::uint64_t block_bytes(const GroundRules& rules, const WaterRules& water, double width,
                                   double height);
  /// Finds the ground, block by block. \throws ResourceError when the budget cannot hold a block
  void find(const LowestHeights& lowest, WorkerPool& pool, MemoryBudget& budget);

  /// So many bytes of tiles are held in memory. \pre find()
  void hold(std::uint64_t bytes);
  /// Bytes of a tile in memory.
  static std::uint64_t tile_bytes();

  const GroundRules& rules() const { return rules_; }
  const CellWindow& window() const { return window_; }
  std::uint64_t cells() const { return cells_; }  ///< of all tiles
  std::uint64_t empty() const { return empty_; }  ///< of these, without a point
  struct Place {
    TileKey tile;
    double u = 0.0, v = 0.0;  ///< in its tile, from its margin on
  };
  /// Where a point lies. \param u, v  in cells of `lowest`, with their fractions
  Place place(double u, double v) const;
  struct Below {
    GroundAt ground;
    std::uint8_t kind = kGroundMeasured;
    bool roof = false, water = false;
  };
  /// One thread; fast where places of one tile follow each other. \pre a point of the scan lies there
  Below below(const Place& place);

 private:
  struct Block {
    CellWindow core, all;  ///< relative to window_
  };
  Block block(TileKey key) const;
  void find_block(const LowestHeights& lowest, const Block& block);

  std::int32_t factor_;
  GroundRules rules_;
  RoofRules roofs_;
  WaterRules water_;
  CellWindow window_;
  ScratchTiles tiles_;
  std::uint64_t cells_ = 0, empty_ = 0;
  std::mutex mutex_;  ///< of the counts
  GroundSurface surface_;
  TileKey shown_;
  bool shows_ = false;
};

}  // namespace tessera
