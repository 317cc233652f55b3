/// \file mesh_section.h
/// Sections of a mesh of any size, exact on its faces: upright ones across or along an axis, and horizontal ones.
#pragma once
#include <cstdint>
#include <filesystem>
#include <string>

#include <span>
#include <vector>

#include "kernels/survey/section_frame.h"
#include "stream/survey/section_files.h"

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

/// Is shown the lines too, for a page of them.
class SectionView {
 public:
  virtual ~SectionView() = default;
  /// That it takes at most, whatever the lines.
  virtual std::uint64_t bytes() const = 0;
  /// Once, before the lines. \param sections  that have lines, ascending \param axis  its pieces; none of horizontal sections
  virtual void begin(std::span<const SectionExtent> sections, std::span<const AxisPiece> axis) = 0;
  /// In the order of the output.
  virtual void add(const SectionLine& line, const SectionFrame& frame) = 0;
};

/// Lines ascend by section. Each is closed or ends where the mesh does or where it is cut off. Their bytes hang on mesh, axis
/// and options alone.
/// \param output  .csv, .svg, .dxf, .gpkg or .geojson; empty = none
/// \param view  that sees the lines before they are written; null = none
/// \throws InputError; UsageError for a spacing that makes too many sections; EmptyError when none meets the mesh;
///   ResourceError when cap or disk cannot suffice or tessera-gdal is missing and needed; StoppedError
SectionReport write_sections(const std::filesystem::path& mesh, const SectionOptions& options,
                             const std::filesystem::path& output, SectionView* view = nullptr);

/// "CSV", "SVG", or as line_format(). \throws UsageError for another extension
std::string section_format(const std::filesystem::path& output);

}  // namespace tessera
