#include "stream/change/change_raster.h"

#include <algorithm>
#include <array>

#include "stream/runtime/disk_space.h"

namespace tessera {
namespace {

LayerSettings change_settings(double max_distance) {
  LayerSettings settings;
  settings.low = -max_distance, settings.high = max_distance;
  return settings;
}

/// Of one axis of cells that are numbered from zero.
CellRange range_of(std::int64_t low, std::int64_t high, double size) {
  return {static_cast<double>(low) * size, static_cast<double>(high + 1) * size, size};
}

}  // namespace

ChangeRaster::ChangeRaster(const ChangeCells& cells, double max_distance,
                           const std::filesystem::path& scratch, const std::filesystem::path& output)
    : outputs_({{RasterLayer::kTop, output, "M3C2 distance"}}),
      grid_(range_of(cells.low()[0], cells.high()[0], cells.size()),
            range_of(cells.low()[1], cells.high()[1], cells.size()), cells.size()),
      files_(grid_, change_settings(max_distance), outputs_, scratch),
      rows_(files_),
      first_column_(cells.low()[0]),
      last_row_(cells.high()[1]),
      cells_(static_cast<std::size_t>(grid_.columns)),
      inside_(cells_.size(), 1) {
  require_disk(
      std::array{DiskNeed{scratch, 2 * RasterFiles::raw_bytes(grid_.cells(), outputs_), "the raw raster"}},
      kLargerDisk);
}

void ChangeRaster::next_row() {
  rows_.put<RasterCell>(0, row_++, cells_, inside_);
  std::fill(cells_.begin(), cells_.end(), RasterCell{});
}

void ChangeRaster::add(const ChangeCell& cell) {
  while (row_ < last_row_ - cell.y) next_row();
  cells_[static_cast<std::size_t>(cell.x - first_column_)].top = cell.mean;
}

std::string ChangeRaster::finish(const std::string& crs, std::uint64_t memory_bytes) {
  while (row_ < grid_.rows) next_row();
  rows_.finish();
  RasterOptions options;
  options.crs = crs, options.memory_bytes = memory_bytes;
  return files_.finish("--raster", options).warnings;
}

}  // namespace tessera
