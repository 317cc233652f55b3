/// \file tolerance_volume.h
/// The distance field of a reference on a regular grid, kept so that trilinear interpolation never says less
/// than the true distance: a fast filter in front of the exact certificate. After Botsch, Bommes, Vogel,
/// Kobbelt, "GPU-based tolerance volumes for mesh processing", 2004, with a bound of our own per cell.
/// Every stored value is an upper bound; why, and what sampling and textures lose, is proven in tolerance_volume.cpp.
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

}  // namespace tessera
