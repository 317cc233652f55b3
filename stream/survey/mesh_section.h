/// \file mesh_section.h
/// Sections of a mesh of any size, exact on its faces: upright ones across or along an axis, and horizontal ones.
#pragma once
#include <cstdint>
#include <filesystem>
#include <string>

#include "kernels/survey/section_frame.h"

namespace tessera {

struct SectionOptions {
  SectionKind kind = SectionKind::kAcross;
  std::filesystem::path axis;  ///< GeoJSON in the coordinates of the mesh; not of horizontal sections
  /// Between two sections, units of the mesh: across from station 0 on, > 0; horizontal from `from` on, 0 = only that one.
  double spacing = 0.0;
  double from = 0.0;   ///< height of the first horizontal section
  double width = 0.0;  ///< across: lines are cut off half of it beside the axis; 0 = not at all
  std::string crs;     ///< as ContourOptions has it
  std::uint64_t memory_bytes = 0;
  int threads = 0;
  std::filesystem::path temp;  ///< folder for scratch files
};

struct SectionReport {
  std::uint64_t sections = 0;  ///< that have lines
  std::uint64_t lines = 0, closed = 0, points = 0;
  double first = 0.0, last = 0.0;  ///< stations or heights that have lines; along: ends of lines
  std::string warnings;            ///< lines for the user
};

/// Lines ascend by section. Each is closed or ends where the mesh does or where it is cut off. Their bytes hang on mesh, axis
/// and options alone.
/// \param output  .csv, .svg, .dxf, .gpkg or .geojson
/// \throws InputError; UsageError for a spacing that makes too many sections; EmptyError when none meets the mesh;
///   ResourceError when cap or disk cannot suffice or tessera-gdal is missing and needed; StoppedError
SectionReport write_sections(const std::filesystem::path& mesh, const SectionOptions& options,
                             const std::filesystem::path& output);

/// "CSV", "SVG", or as line_format(). \throws UsageError for another extension
std::string section_format(const std::filesystem::path& output);

}  // namespace tessera
