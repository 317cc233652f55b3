/// \file mesh_contours.h
/// Contour lines of a mesh of any size, exact on its faces, chained over all of them and written by `tessera-gdal`.
#pragma once
#include <cstdint>
#include <filesystem>
#include <string>

namespace tessera {

struct ContourOptions {
  double interval = 0.0;  ///< between levels, which are whole multiples of it
  int index = 5;          ///< every so many levels a line is an index line; 0 = none
  /// Lines may leave the mesh by so much in plan to be smooth (line_smoothing.h); 0 = they lie on its faces.
  double smooth = 0.0;
  std::string crs;  ///< WKT, or EPSG:n; empty = none is known
  std::uint64_t memory_bytes = 0;
  int threads = 0;
  std::filesystem::path temp;  ///< folder for scratch files
};

struct ContourReport {
  std::uint64_t lines = 0, closed = 0, points = 0;
  double lowest = 0.0, highest = 0.0;  ///< levels that have lines
  std::uint64_t smoothed = 0;          ///< lines that changed
  std::string warnings;                ///< lines for the user
};

/// Lines ascend by level. Each is closed or ends where the mesh does, with higher ground on its left, and crosses no other
/// one. Their bytes hang on mesh and options alone.
/// \param output  .gpkg, .geojson or .dxf
/// \throws InputError; UsageError for an interval that makes too many levels; EmptyError when no level is met; ResourceError
///   when cap or disk cannot suffice or tessera-gdal is missing; StoppedError
ContourReport write_contours(const std::filesystem::path& mesh, const ContourOptions& options,
                             const std::filesystem::path& output);

/// "GPKG", "GeoJSON" or "DXF". \throws UsageError for another extension
std::string line_format(const std::filesystem::path& output);

}  // namespace tessera
