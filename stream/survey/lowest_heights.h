/// \file lowest_heights.h
/// The lowest height of every cell of a scan of any size and the number of its points, as a sparse raster of integers. Cells
/// lie at whole multiples of their edge, so files that border on each other share them, and no order of points or files matters.
#pragma once
#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <span>
#include <vector>

#include "stream/formats/points/las_records.h"
#include "stream/survey/scratch_tiles.h"

namespace tessera {

/// Cells and steps of height, scan units.
struct ScanCells {
  /// Of heights, to the edge of a cell.
  static constexpr std::int32_t kSteps = 1000;
  double cell = 1.0;

  double step() const { return cell / kSteps; }
  /// Column or row, with its fraction. \throws InputError naming the file where cells are too many to be numbered
  double place(double coordinate, const LasHeader& header) const;
  /// Height in steps, kNoGround for what is too high or low for any scene.
  std::int32_t height(double z) const;
};

/// Cells [low, low + size) along columns and rows.
struct CellWindow {
  std::int32_t u = 0, v = 0;
  std::int32_t width = 0, height = 0;
};

/// Whether a record is marked withheld or synthetic, or as noise (class 7, in formats 6 to 10 also 18).
bool is_set_aside(const char* record, bool wide);
/// Scan units.
Double3 record_position(const LasRecords& scan, const char* record);

/// Calls use(index, position) for the records of a batch that take part. \param all  those set aside too
template <class Use>
void for_each_taken(const LasRecords& scan, const LasBatch& batch, bool all, const Use& use) {
  for (std::size_t i = 0; i < batch.count; ++i) {
    const char* record = batch.records.data() + i * scan.record_bytes();
    if (all || !is_set_aside(record, scan.wide())) use(i, record_position(scan, record));
  }
}

/// Those of one tile together, but for a few runs: in a file points of one place mostly follow each other as they are.
template <class Placed>
void gather_by_tile(std::vector<Placed>& placed) {
  constexpr std::size_t kMaxRuns = 8;
  std::size_t runs = 0;
  for (std::size_t i = 0; i < placed.size(); ++i) runs += i == 0 || !(placed[i].tile == placed[i - 1].tile);
  if (runs > kMaxRuns)
    std::sort(placed.begin(), placed.end(), [](const Placed& a, const Placed& b) { return a.tile < b.tile; });
}

class LowestHeights {
 public:
  static constexpr std::int32_t kTile = 256;  ///< cells on a side
  static constexpr std::size_t kTileBytes = (sizeof(std::int32_t) + sizeof(std::uint16_t)) * kTile * kTile;
  struct Sample {
    TileKey tile;
    std::uint32_t cell = 0;
    std::int32_t height = 0;
  };

  LowestHeights(const ScanCells& cells, const std::filesystem::path& file)
      : cells_(cells), tiles_(file, kTileBytes) {}

  /// So many bytes of tiles are held in memory.
  void hold(std::uint64_t bytes);
  /// Samples of a batch, those of one tile together; any thread. \param all  those set aside too
  void place(const LasRecords& scan, const LasBatch& batch, bool all, std::vector<Sample>& out) const;
  void add(std::span<const Sample> samples);
  /// After the last sample: nothing is held any more.
  void finish();

  std::uint64_t points() const { return points_; }
  /// Of all cells that have a point. \pre finish(), points() > 0
  const CellWindow& window() const { return window_; }
  /// Points to a cell where there are any, by groups of 8 x 8 cells. \pre as window()
  double density() const;
  std::vector<TileKey> tiles() const { return tiles_.keys(); }
  /// Lowest heights of cells `factor` times as wide, kNoGround without; any thread. \pre finish()
  std::vector<std::int32_t> read(const CellWindow& window, std::int32_t factor) const;
  /// Points of such cells, of each of those that they are made of 65,535 at most; any thread. \pre finish()
  std::vector<std::uint32_t> read_counts(const CellWindow& window, std::int32_t factor) const;
  /// Points of the middle one of all cells of that width that have any. \pre as window()
  std::uint32_t median_count(std::int32_t factor) const;
  static constexpr std::int32_t kRelief = 12;
  static constexpr std::array<std::int32_t, 5> kReliefFactors = {1, 2, 3, 4, 6};  ///< divide it
  /// For each of these factors: of the cells of that width that have a point, the share whose lowest point lies more than `rise`
  /// steps above the lowest one of the block of kRelief x kRelief cells that they are in: roofs and steep ground, and
  /// vegetation through which none of their points has reached the ground. \pre finish() \cost reads every tile once
  std::array<double, kReliefFactors.size()> high_shares(std::int32_t rise) const;

 private:
  struct Tile;
  template <class Use>
  void for_each_cell(const CellWindow& window, std::int32_t factor, const Use& use) const;

  ScanCells cells_;
  ScratchTiles tiles_;
  std::uint64_t points_ = 0, groups_ = 0;
  CellWindow window_;
};

/// Rounded down, below zero too.
inline std::int32_t floor_ratio(std::int32_t a, std::int32_t b) {
  return a >= 0 ? a / b : -((b - 1 - a) / b);
}

}  // namespace tessera
