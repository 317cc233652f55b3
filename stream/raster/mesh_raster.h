/// \file mesh_raster.h
/// Rasters of a mesh seen from above, as Cloud Optimised GeoTIFF: sampled window by window in bounded memory, written by
/// `tessera-gdal` beside this program.
#pragma once
#include <filesystem>
#include <vector>

#include "stream/raster/raster_output.h"

namespace tessera {

/// Their bytes hang on mesh, cell and options alone, not on memory, threads or windows.
/// \throws InputError; UsageError for a cell that makes too many cells, a mesh without colours where they are asked for, a
///   layer that points alone have, a value that is that for no data; ResourceError when cap or disk cannot suffice or
///   tessera-gdal is missing; EmptyError for a mesh that covers no cell's centre; StoppedError
RasterReport write_rasters(const std::filesystem::path& mesh, const RasterOptions& options,
                           const std::vector<RasterOutput>& outputs);

}  // namespace tessera
