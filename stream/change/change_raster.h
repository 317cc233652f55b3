/// \file change_raster.h
/// Mean distances by cell, seen from above, as Cloud Optimised GeoTIFF, written by `tessera-gdal` beside this program.
#pragma once
#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include "stream/change/change_cells.h"
#include "stream/raster/raster_output.h"

namespace tessera {

class ChangeRaster {
 public:
  /// \param cells  of which all were added; they come by add() in their order  \param max_distance  no mean is larger
  /// \throws UsageError for too many cells; ResourceError where the disk cannot hold them
  ChangeRaster(const ChangeCells& cells, double max_distance, const std::filesystem::path& scratch,
               const std::filesystem::path& output);
  void add(const ChangeCell& cell);
  /// \param crs  WKT, or EPSG:n; empty = none is known
  /// \returns what GDAL warns of, lines; may be empty \throws as RasterFiles::finish()
  std::string finish(const std::string& crs, std::uint64_t memory_bytes);

  std::int64_t columns() const { return grid_.columns; }
  std::int64_t rows() const { return grid_.rows; }

 private:
  void next_row();

  std::vector<RasterOutput> outputs_;
  RasterGrid grid_;
  RasterFiles files_;
  RasterRows rows_;
  std::int64_t first_column_, last_row_;
  std::int64_t row_ = 0;  ///< being filled, from north
  std::vector<RasterCell> cells_;
  std::vector<std::uint8_t> inside_;
};

}  // namespace tessera
