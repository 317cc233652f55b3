/// \file tolerance_volume.h
/// The distance field of a reference on a regular grid, kept so that trilinear interpolation never says less
/// than the true distance: a fast filter in front of the exact certificate. After Botsch, Bommes, Vogel,
/// Kobbelt, "GPU-based tolerance volumes for mesh processing", 2004, with a bound of our own per cell.
///
/// Field. Nodes within `band` of the reference get their exact distance d, the others a fast marching
/// continuation (Sethian 1996, first order), at least the band. Unsigned, so open surfaces need no case of
/// their own.
///
/// Interpolation, h the spacing. d is 1-Lipschitz, so |I(p) - d(p)| <= h sqrt(sum t (1 - t)) <= sqrt(3)/2 h,
/// the thesis's term. But the distance to ONE triangle F is convex, and interpolating a convex function
/// overestimates it (Jensen): with c = min over F of max over the 8 corners of dist(corner, F) - d(corner),
/// I(p) + c >= d(p) in that cell. Every node stores d plus the largest c of its cells (`lift`, never above
/// the worst case), so I(p) >= d(p) everywhere. The lift is nothing where one triangle serves the whole cell,
/// so it pays where triangles are larger than cells.
///
/// Outside. With y the closest point to p, the nodes' distances are at most |node - y|, their weighted squares sum to
/// d(p)^2 + h^2 sum t (1 - t) because trilinear weights reproduce linear functions, and roots are concave: so the
/// interpolation of exact distances is at most sqrt(d(p)^2 + 3/4 h^2).
///
/// Samples. A triangle is sampled at the points with barycentric coordinates ((i + o) / n, (j + o) / n), i +
/// j < n, o = 85/256: the centroids of the upright triangles of its n-fold subdivision but for 1/768, so that
/// hardware which snaps vertices to 1/256 of a pixel takes the very same points. Any point is within delta =
/// 0.68 m / n of a sample, m the longest median: 2/3 m / n for true centroids (the reflected triangles by
/// their three neighbours), and 0.0131 m / n for the shift.
///
/// Texture. Stored values are rounded up to the precision: by at most cap/255 (8 bit), 2^-10 of the value (16
/// bit float), nothing (32 bit). Filtering hardware rounds weights to 1/256: at most 3 h / 256
/// (`weight_error`; our own rasterizer: 2^-16 of the nodes per axis times h, from the rounding of float
/// coordinates).
///
///   clearly inside:   max I + delta + filter_error <= tolerance
///   clearly outside:  max I - largest lift - texture_error - filter_error > sqrt(tolerance^2 + 3/4 h^2)
///   else in doubt: the exact test decides.
#pragma once
#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "kernels/certify/certificate.h"
#include "kernels/mesh/closest_face.h"
#include "octree/lattice.h"

namespace tessera {

enum class TexturePrecision { k8Bit, kHalf, kFloat };

/// Barycentric offset of the samples.
inline constexpr float kSampleOffset = 85.0f / 256.0f;

struct ToleranceVolumeOptions {
  double tolerance = 0.0;  ///< scan units, > 0
  double spacing = 0.0;    ///< of the grid, > 0
};

class ToleranceVolume {
 public:
  /// \param box  what triangles to be tested lie in; a node layer is added on each side
  /// \pre  reference complete within tolerance + 2 sqrt(3) spacing of the box; at most 1024 nodes an axis
  ToleranceVolume(const Box3& box, const ClosestFaces& reference, const ToleranceVolumeOptions& options);

  const Int3& nodes() const { return nodes_; }
  double spacing() const { return options_.spacing; }
  double tolerance() const { return options_.tolerance; }
  const Double3& low() const { return low_; }  ///< of node (0, 0, 0), world
  double cap() const { return cap_; }          ///< stored values end here
  double largest_lift() const { return largest_lift_; }
  double mean_lift() const { return mean_lift_; }  ///< over cells that the tolerance can reach
  /// x fastest; lifted, rounded up, at most cap; in units of the spacing, so that every precision has its range
  std::span<const float> values() const { return value_; }

  double texture_error(TexturePrecision precision) const;
  double filter_error(TexturePrecision precision, bool hardware_filter) const;
  /// Largest sampled value up to which a triangle is clearly inside, and above which it is clearly outside.
  double inside_below(double delta, TexturePrecision precision, bool hardware_filter) const;
  double outside_above(TexturePrecision precision, bool hardware_filter) const;

  /// World to grid coordinates: node (i, j, k) at (i, j, k).
  Float3 to_grid(const Double3& p) const;
  /// Trilinear, in double: what rasterizers are compared with.
  double interpolate(const Double3& p) const;

 private:
  void fill_band(const ClosestFaces& reference);
  void march();
  void lift(const ClosestFaces& reference);
  std::size_t at(int i, int j, int k) const {
    return (static_cast<std::size_t>(k) * static_cast<std::size_t>(nodes_[1]) + static_cast<std::size_t>(j)) *
               static_cast<std::size_t>(nodes_[0]) +
           static_cast<std::size_t>(i);
  }
  Double3 local(int i, int j, int k, const ClosestFaces& reference) const;

  ToleranceVolumeOptions options_;
  Double3 low_{};
  Int3 nodes_{};
  double band_ = 0.0, cap_ = 0.0, largest_lift_ = 0.0, mean_lift_ = 0.0;
  std::vector<float> value_;
  std::vector<std::uint32_t> slot_;  ///< closest triangle, while filling
};

/// The samples per side that keep delta below `delta`, for a triangle with this longest median.
int samples_per_side(double longest_median, double delta);
double longest_median(const Double3& a, const Double3& b, const Double3& c);
/// Upper bound of the distance of any point of a triangle to its nearest sample.
inline double sample_delta(double longest_median, int per_side) {
  return 0.68 * longest_median / per_side;
}

/// A value rounded up to a half float, as its bits; and back.
std::uint16_t half_rounded_up(float value);
float half_value(std::uint16_t bits);

}  // namespace tessera
