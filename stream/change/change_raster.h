/// \file change_raster.h
/// Mean distances by cell, seen from above, as Cloud Optimised GeoTIFF, written by `tessera-gdal` beside this program.
#pragma once
#include <cstdint>
#include <filesystem>
#include <memory>
#include <string>
#include <vector>

#include "stream/change/change_cells.h"
#include "stream/files/direct_file.h"
#include "stream/survey/raster_layer.h"

namespace tessera {

class ChangeRaster {
 public:
  /// \param cells  of which all were added; they come by add() in their order  \param max_distance  no mean is larger
  /// \throws UsageError for too many cells; ResourceError where the disk cannot hold them
  ChangeRaster(const ChangeCells& cells, double max_distance, const std::filesystem::path& scratch);
  void add(const ChangeCell& cell);
  /// \param crs  WKT, or EPSG:n; empty = none is known  \returns what it warns of, lines; may be empty
  /// \throws as write_by_gdal()
  std::string finish(const std::string& crs, std::uint64_t memory_bytes, const std::filesystem::path& output);

  std::int64_t columns() const { return columns_; }
  std::int64_t rows() const { return rows_; }

 private:
  void skip_to(std::uint64_t place);
  void put(double mean);
  void flush();

  std::filesystem::path scratch_, raw_;
  double size_, west_, north_;
  std::int64_t first_column_, last_row_, columns_, rows_;
  std::uint64_t next_ = 0;  ///< cells so far, row by row from north
  LayerValues values_;
  DirectFile file_;
  std::vector<RasterCell> pending_;
};

}  // namespace tessera
