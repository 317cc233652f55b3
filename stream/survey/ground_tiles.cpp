#include "stream/survey/ground_tiles.h"

#include <algorithm>
#include <cmath>
#include <memory>
#include <set>
#include <utility>
#include <vector>

#include "stream/runtime/stop.h"

namespace tessera {

namespace {

constexpr std::int32_t kSide = 256;  ///< of a tile, cells
constexpr std::int32_t kMargin =
    kSide + 2;  ///< with a cell around it, for what lies between the middles of cells
constexpr std::int32_t kBlockTiles = 4;
constexpr std::int32_t kCore = kSide * kBlockTiles;
/// Halos are multiples of it, so that coarse levels of the membrane lie alike in all blocks.
constexpr std::int32_t kHaloStep = 64;
constexpr std::int32_t kRoofReach = 6;  ///< of find_roofs()
/// Of find_ground(), with its input.
constexpr std::uint64_t kBytesPerCell = 28;
/// Beside those, of water, which is looked for before the ground.
constexpr std::uint64_t kWaterBytesPerCell = 6;

struct StoredGround {
  std::int32_t ground[kMargin * kMargin];
  std::uint8_t kind[kSide * kSide];  ///< GroundCell, and whether it is a roof or water
};
constexpr std::uint8_t kRoofBit = 8, kWaterBit = 16;

std::int32_t halo(const GroundRules& rules, const WaterRules& water) {
  const int reach = std::max(rules.max_window * (rules.max_window + 1) + 2 + kRoofReach + 1, water.halo());
  return (reach + kHaloStep - 1) / kHaloStep * kHaloStep;
}

CellWindow coarse_window(const CellWindow& fine, std::int32_t factor) {
  const std::int32_t u = floor_ratio(fine.u, factor), v = floor_ratio(fine.v, factor);
  return {u, v, floor_ratio(fine.u + fine.width - 1, factor) - u + 1,
          floor_ratio(fine.v + fine.height - 1, factor) - v + 1};
}

}  // namespace

GroundTiles::GroundTiles(const LowestHeights& lowest, std::int32_t factor, const GroundRules& rules,
                         const RoofRules& roofs, const WaterRules& water, const std::filesystem::path& file)
    : factor_(factor),
      rules_(rules),
      roofs_(roofs),
      water_(water),
      window_(coarse_window(lowest.window(), factor)),
      tiles_(file, sizeof(StoredGround)) {
  rules_.cell = ScanCells::kSteps * factor;
}

std::uint64_t GroundTiles::tile_bytes() {
  return sizeof(StoredGround);
}

std::uint64_t GroundTiles::block_bytes(const GroundRules& rules, const WaterRules& water, double width,
                                       double height) {
  const double side = kCore + 2.0 * halo(rules, water);
  const double cells = std::min(side, std::max(1.0, width)) * std::min(side, std::max(1.0, height));
  const std::uint64_t each = kBytesPerCell + (water.width > 0 ? kWaterBytesPerCell : 0);
  return static_cast<std::uint64_t>(cells) * each + sizeof(StoredGround) + LowestHeights::kTileBytes;
}

GroundTiles::Block GroundTiles::block(TileKey key) const {
  const auto cut = [&](std::int32_t index, std::int32_t size, std::int32_t reach) {
    const std::int32_t begin = std::max(0, index * kCore - reach);
    return std::pair{begin, std::min(size, (index + 1) * kCore + reach) - begin};
  };
  const auto window = [&](std::int32_t reach) {
    const auto [u, width] = cut(key.u, window_.width, reach);
    const auto [v, height] = cut(key.v, window_.height, reach);
    return CellWindow{u, v, width, height};
  };
  return {window(0), window(halo(rules_, water_))};
}

void GroundTiles::find(const LowestHeights& lowest, WorkerPool& pool, MemoryBudget& budget) {
  std::set<TileKey> keys;  // of blocks
  for (const TileKey tile : lowest.tiles()) {
    const auto at = [&](std::int32_t cell, std::int32_t begin) {
      return std::max(0, floor_ratio(cell, factor_) - begin) / kCore;
    };
    const std::int32_t side = LowestHeights::kTile;
    for (const std::int32_t u : {tile.u * side, tile.u * side + side - 1})
      for (const std::int32_t v : {tile.v * side, tile.v * side + side - 1})
        keys.insert({std::min(at(u, window_.u), (window_.width - 1) / kCore),
                     std::min(at(v, window_.v), (window_.height - 1) / kCore)});
  }
  std::vector<Block> blocks;
  for (const TileKey key : keys) blocks.push_back(block(key));
  pool.run_tasks(
      blocks.size(),
      [&](std::size_t k) { return block_bytes(rules_, water_, blocks[k].all.width, blocks[k].all.height); },
      budget, [&](std::size_t k) { find_block(lowest, blocks[k]); });
  trim_allocator();
}

void GroundTiles::find_block(const LowestHeights& lowest, const Block& block) {
  const CellWindow& all = block.all;
  const CellWindow cells_of_scan = {window_.u + all.u, window_.v + all.v, all.width, all.height};
  std::vector<std::int32_t> heights = lowest.read(cells_of_scan, factor_);
  std::vector<std::uint8_t> water;
  if (water_.width > 0)
    water = find_water(heights, lowest.read_counts(cells_of_scan, factor_), all.width, all.height, water_);
  const GroundSurface found = find_ground(heights, all.width, all.height, rules_);
  std::vector<std::uint8_t> roofs;
  if (roofs_.min_height > 0.0) roofs = find_roofs(heights, found, roofs_);
  heights = {};
  const auto at = [&](std::int32_t u, std::int32_t v) {
    return static_cast<std::size_t>(std::clamp(v, 0, all.height - 1)) * static_cast<std::size_t>(all.width) +
           static_cast<std::size_t>(std::clamp(u, 0, all.width - 1));
  };
  std::uint64_t cells = 0, empty = 0;
  const auto tile = std::make_unique<StoredGround>();
  for (std::int32_t tv = block.core.v / kSide; tv * kSide < block.core.v + block.core.height; ++tv)
    for (std::int32_t tu = block.core.u / kSide; tu * kSide < block.core.u + block.core.width; ++tu) {
      throw_if_stopped();
      bool measured = false;
      for (std::int32_t v = 0; v < kMargin; ++v)
        for (std::int32_t u = 0; u < kMargin; ++u) {
          const std::int32_t x = tu * kSide + u - 1, y = tv * kSide + v - 1;
          const std::size_t from = at(x - all.u, y - all.v);
          tile->ground[v * kMargin + u] = found.ground[from];
          if (u < 1 || v < 1 || u > kSide || v > kSide) continue;
          const bool roof = !roofs.empty() && roofs[from] != 0;
          const bool wet = !water.empty() && water[from] != 0;
          tile->kind[(v - 1) * kSide + u - 1] =
              static_cast<std::uint8_t>(found.kind[from] | (roof ? kRoofBit : 0) | (wet ? kWaterBit : 0));
          if (x >= window_.width || y >= window_.height) continue;
          ++cells;
          if (found.kind[from] == kGroundEmpty)
            ++empty;
          else
            measured = true;
        }
      if (measured) tiles_.put({tu, tv}, reinterpret_cast<const char*>(tile.get()));
    }
  const std::lock_guard lock(mutex_);
  cells_ += cells, empty_ += empty;
}

void GroundTiles::hold(std::uint64_t bytes) {
  tiles_.hold(static_cast<std::size_t>(std::max<std::uint64_t>(1, bytes / tile_bytes())));
  surface_.width = surface_.height = kMargin;
  surface_.ground.resize(static_cast<std::size_t>(kMargin) * kMargin);
  surface_.kind.resize(static_cast<std::size_t>(kSide) * kSide);
}

GroundTiles::Place GroundTiles::place(double u, double v) const {
  Place place;
  const auto along = [&](double x, std::int32_t first, std::int32_t& tile) {
    // The cell by whole numbers, as the heights were placed: a quotient may round across a border.
    const std::int32_t cell = floor_ratio(static_cast<std::int32_t>(std::floor(x)), factor_) - first;
    tile = cell / kSide;
    return std::clamp(x / factor_ - first, static_cast<double>(cell), cell + 1.0) - tile * kSide + 1.0;
  };
  place.u = along(u, window_.u, place.tile.u);
  place.v = along(v, window_.v, place.tile.v);
  return place;
}

GroundTiles::Below GroundTiles::below(const Place& place) {
  if (!shows_ || !(shown_ == place.tile)) {
    const char* bytes = tiles_.find(place.tile);
    const auto* tile = reinterpret_cast<const StoredGround*>(bytes);
    std::copy(std::begin(tile->ground), std::end(tile->ground), surface_.ground.begin());
    std::copy(std::begin(tile->kind), std::end(tile->kind), surface_.kind.begin());
    shown_ = place.tile, shows_ = true;
  }
  const auto cell = [](double x) { return std::clamp(static_cast<std::int32_t>(x) - 1, 0, kSide - 1); };
  const std::uint8_t kind =
      surface_
          .kind[static_cast<std::size_t>(cell(place.v)) * kSide + static_cast<std::size_t>(cell(place.u))];
  return {ground_at(surface_, rules_, place.u, place.v),
          static_cast<std::uint8_t>(kind & ~(kRoofBit | kWaterBit)), (kind & kRoofBit) != 0,
          (kind & kWaterBit) != 0};
}

}  // namespace tessera
