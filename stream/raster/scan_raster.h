/// \file scan_raster.h
/// Rasters of scans seen from above, as Cloud Optimised GeoTIFF: points are dealt to windows of the raster, in bounded memory,
/// and `tessera-gdal` beside this program writes the files.
#pragma once
#include <filesystem>
#include <string>
#include <vector>

#include "stream/raster/raster_output.h"

namespace tessera {

/// Whether an input is a mesh, which mesh_raster.h is for: by its extension, of PLY by its faces. \throws InputError
bool is_mesh_input(const std::filesystem::path& input);

/// All scans as one. Points of noise (classes 7 and 18) and withheld ones take no part. Without a cell the least of 1, 2 and 5
/// times a power of ten is taken that is not below two spacings (kernels/survey/plan_spacing.h). Bytes hang on the points, cell
/// and options alone, not on their order, memory, threads or windows.
/// \param columns  of text files
/// \throws InputError as open_measured_scans(), and for the layer ground of scans without class 2; UsageError for layers that
///   these scans cannot have, a cell that makes too many cells, a value that is that for no data; ResourceError when cap or
///   disk cannot suffice or tessera-gdal is missing; EmptyError without points; StoppedError
RasterReport write_scan_rasters(const std::vector<std::filesystem::path>& scans, const RasterOptions& options,
                                const std::vector<std::string>& columns,
                                const std::vector<RasterOutput>& outputs);

}  // namespace tessera
