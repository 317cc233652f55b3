/// \file height_noise.h
/// How far noise in the heights of a surface's points may move a volume, as a statistical bound: errors average out over what
/// lies farther apart than they hang together.
/// Source: variance of a block mean by the integral range of its covariance: Chiles and Delfiner, "Geostatistics", 2.3;
/// of elevation differences: Rolstad et al., "Spatially integrated geodetic glacier mass balance and its uncertainty", 2009.
#pragma once
#include <algorithm>
#include <cmath>

namespace tessera {

/// Of one surface.
struct HeightNoise {
  double deviation = 0.0;  ///< standard deviation of the heights of its points; 0 = none is known
  double spacing = 0.0;    ///< of points whose errors are independent of each other; 0 = unknown
  double length = 0.0;     ///< over which errors hang together: their correlation is exp(-(d / length)^2)

  bool known() const { return deviation > 0.0; }
  /// Plan area over which errors count as one.
  double range() const { return std::max(spacing * spacing, kPi * length * length); }
  /// Along a line: as long a piece of it.
  double range_along() const { return std::max(spacing, std::sqrt(kPi) * length); }
  /// Of the volume over a plan area, its square root a volume.
  double variance(double area) const { return deviation * deviation * area * std::min(area, range()); }

 private:
  static constexpr double kPi = 3.14159265358979323846;
};

/// Of a normal distribution, two-sided, 95 %.
inline double bound95(double variance) {
  return 1.959963984540054 * std::sqrt(variance);
}

}  // namespace tessera
