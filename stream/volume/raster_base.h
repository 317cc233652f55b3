/// \file raster_base.h
/// Heights of a GeoTIFF as a base: `tessera-gdal` unpacks them into a scratch file, which is read window by window.
#pragma once
#include <array>
#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include "stream/files/read_file.h"
#include "stream/volume/base_surface.h"

namespace tessera {

/// The surface through the centres of cells, flat on two triangles between four of them, whose common edge runs from the first
/// row and column to the last; with three centres that have heights one triangle, with fewer none. So it ends half a cell
/// inside the raster.
class RasterBase : public BaseSurface {
 public:
  /// \param crs  of the mesh, empty = unknown  \param scratch  a folder for the heights
  /// \throws InputError for what is no georeferenced single band of real numbers or has no height at all; ResourceError when
  ///   tessera-gdal is missing or disk cannot suffice
  RasterBase(const std::filesystem::path& raster, const std::string& crs, const Double3& origin,
             const std::filesystem::path& scratch, std::uint64_t memory_bytes);
  std::uint64_t window_bytes(const MeshBox& window) const override;
  void for_triangles(const MeshBox& window, const Use& use) const override;
  double low() const override { return low_; }
  double high() const override { return high_; }
  const std::string& warnings() const { return warnings_; }  ///< lines for the user

 private:
  /// Cells between centres: [first, end) of columns and rows.
  struct Range {
    std::int64_t first[2], end[2];
  };
  Range range_of(const MeshBox& window) const;
  void read_batch(const Range& range, std::vector<double>& heights, std::vector<SpaceTriangle>& out) const;
  Double3 centre(std::int64_t column, std::int64_t row, double height) const;

  std::unique_ptr<ReadFile> file_;
  std::int64_t columns_ = 0, rows_ = 0;
  std::array<double, 6> transform_{};  ///< GDAL's: of the upper left corner, per column and per row
  Double3 origin_;
  double low_ = 0.0, high_ = 0.0;
  std::string warnings_;
};

}  // namespace tessera
