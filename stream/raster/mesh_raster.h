/// \file mesh_raster.h
/// Rasters of a mesh seen from above, as Cloud Optimised GeoTIFF: sampled window by window in bounded memory, written by
/// `tessera-gdal` beside this program.
#pragma once
#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include "stream/raster/raster_layer.h"

namespace tessera {

struct RasterOptions {
  double cell = 0.0;  ///< edge, units of the mesh; edges of cells lie at whole multiples of it
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
};

struct RasterReport {
  std::int64_t columns = 0, rows = 0;
  double west = 0.0, north = 0.0;     ///< of the upper left corner
  std::vector<std::uint64_t> values;  ///< cells with one, by output
  std::string warnings;               ///< lines for the user
};

/// Their bytes hang on mesh, cell and options alone, not on memory, threads or windows.
/// \throws InputError; UsageError for a cell that makes too many cells, a mesh without colours where they are asked for, a
///   value that is that for no data; ResourceError when cap or disk cannot suffice or tessera-gdal is missing; EmptyError for
///   a mesh that covers no cell's centre; StoppedError
RasterReport write_rasters(const std::filesystem::path& mesh, const RasterOptions& options,
                           const std::vector<RasterOutput>& outputs);

}  // namespace tessera
