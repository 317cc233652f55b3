/// \file raster_output.h
/// What rasters of meshes and of scans have in common: the grid of cells, the raw files that layers are written into window by
/// window, and the Cloud Optimised GeoTIFF that `tessera-gdal` makes of them.
#pragma once
#include <cstdint>
#include <filesystem>
#include <memory>
#include <mutex>
#include <span>
#include <string>
#include <vector>

#include "octree/vector.h"
#include "stream/raster/raster_layer.h"

namespace tessera {

struct RasterOptions {
  double cell = 0.0;  ///< edge, units of the input; edges of cells lie at whole multiples of it
  double azimuth = 315.0,
         altitude = 45.0;   ///< of the sun: degrees clockwise from north, and above the horizon
  double nodata = -9999.0;  ///< of layers of floats
  std::string crs;          ///< WKT, or EPSG:n; empty = none is known
  std::uint64_t memory_bytes = 0;
  int threads = 0;
  int tile = 0;                ///< edge of a window, cells; 0 = by the cap
  std::filesystem::path temp;  ///< folder for scratch files
};

struct RasterOutput {
  RasterLayer layer = RasterLayer::kTop;
  std::filesystem::path path;
  std::string name = {};  ///< of the layer in the file; empty = that of its kind
};

struct RasterReport {
  double cell = 0.0;
  std::int64_t columns = 0, rows = 0;
  double west = 0.0, north = 0.0;          ///< of the upper left corner
  std::vector<std::uint64_t> values;       ///< cells with one, by output
  std::string warnings;                    ///< lines for the user
  std::uint64_t points = 0, left_out = 0;  ///< of scans
};

/// Cells of one axis that hold [low, high]: whole multiples `first` to `end` of the cell.
struct CellRange {
  double first = 0.0, end = 0.0;
  /// What meets a border from inside alone makes no cell more.
  /// \throws UsageError where a cell has no edges of its own in doubles
  CellRange(double low, double high, double cell);
};

/// The whole raster; rows count southwards.
struct RasterGrid {
  double cell, west, north;
  std::int64_t columns, rows;

  /// \throws UsageError for more cells on a side than GDAL can count
  RasterGrid(const CellRange& x, const CellRange& y, double edge);
  std::uint64_t cells() const {
    return static_cast<std::uint64_t>(columns) * static_cast<std::uint64_t>(rows);
  }
  Double2 centre(std::int64_t column, std::int64_t row) const {
    return {west + (static_cast<double>(column) + 0.5) * cell,
            north - (static_cast<double>(row) + 0.5) * cell};
  }
  /// Whether the centre of a cell lies in a box.
  bool inside(std::int64_t column, std::int64_t row, double min_x, double max_x, double min_y,
              double max_y) const;
};

/// The raw files of all layers, and their statistics.
class RasterFiles {
 public:
  /// \throws ResourceError when they cannot be made
  RasterFiles(const RasterGrid& grid, const LayerSettings& settings, const std::vector<RasterOutput>& outputs,
              const std::filesystem::path& scratch);
  ~RasterFiles();
  static std::uint64_t raw_bytes(std::uint64_t cells, const std::vector<RasterOutput>& outputs);

  /// Makes the final files of the raw ones, after the last window. \param name  of the input
  /// \throws EmptyError for a layer without any value; as write_by_gdal()
  RasterReport finish(const std::string& name, const RasterOptions& options);

 private:
  friend class RasterRows;
  class RawFile;

  RasterGrid grid_;
  LayerSettings settings_;
  const std::vector<RasterOutput>& outputs_;
  std::filesystem::path scratch_;
  std::vector<std::unique_ptr<RawFile>> files_;
  std::vector<LayerValues> totals_;
  std::mutex mutex_;  ///< of totals_
};

/// Writes rows of one window; windows may be written by several threads.
class RasterRows {
 public:
  explicit RasterRows(RasterFiles& files);
  /// Cells of a row from a column on. \param inside  as LayerValues::put()
  /// \throws UsageError as LayerValues::put(); ResourceError
  template <class Cell>
  void put(std::int64_t column, std::int64_t row, std::span<const Cell> cells,
           std::span<const std::uint8_t> inside) {
    bytes_.resize(4 * cells.size());
    for (std::size_t k = 0; k < values_.size(); ++k) {
      values_[k].put(cells, inside, bytes_.data());
      write(k, column, row, cells.size());
    }
  }
  /// Adds the statistics of the window to those of all.
  void finish();

 private:
  void write(std::size_t output, std::int64_t column, std::int64_t row, std::size_t cells);

  RasterFiles& files_;
  std::vector<LayerValues> values_;
  std::vector<char> bytes_;
};

}  // namespace tessera
