/// \file tolerance_filter.h
/// Which triangles a tolerance volume settles alone: the filter in front of the exact certificate. Samples
/// are refined round by round until a triangle is clearly inside, clearly outside, or not worth more samples.
#pragma once
#include <cstdint>
#include <span>
#include <vector>

#include "kernels/certify/tolerance_raster.h"

namespace tessera {

enum class ToleranceVerdict : std::uint8_t { kDoubt, kInside, kOutside };

struct ToleranceFilterOptions {
  int first_per_side = 2;  ///< 3 samples
  int most_per_side = 64;  ///< 2080 samples; doubled from round to round
};

struct ToleranceFilterReport {
  std::uint64_t inside = 0, outside = 0, doubt = 0;
  std::uint64_t samples = 0;
};

/// \param corners  three per triangle, world
/// \param verdict  one per triangle, filled
ToleranceFilterReport filter_by_volume(const ToleranceVolume& volume, TexturePrecision precision,
                                       ToleranceRaster& raster, std::span<const Double3> corners,
                                       const ToleranceFilterOptions& options,
                                       std::vector<ToleranceVerdict>& verdict);

/// The other way of old: one bit per cell, set where a whole cell stays within the tolerance; a triangle
/// passes when every cell that it may touch is set. After Zelinka and Garland, "Permission grids", 2002. For
/// comparison.
class PermissionGrid {
 public:
  /// \pre as ToleranceVolume
  PermissionGrid(const Box3& box, const ClosestFaces& reference, double tolerance, double spacing);
  bool permits(const Double3& a, const Double3& b, const Double3& c) const;
  bool permits(const Double3& p) const;
  std::uint64_t bytes() const { return bits_.size() * 8; }

 private:
  bool cell(int i, int j, int k) const;

  Double3 low_{};
  double spacing_;
  Int3 cells_{};
  std::vector<std::uint64_t> bits_;
};

}  // namespace tessera
