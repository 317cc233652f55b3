/// \file quadric.h
/// Squared distance to weighted planes as a quadratic form, plain or with uncertain planes.
/// Sources: Garland and Heckbert 1997; Trettner and Kobbelt, "Fast and Robust QEM Minimization using
/// Probabilistic Quadrics", 2020, equation 12 (isotropic noise of the position and of the normal).
#pragma once
#include <immintrin.h>

#include "octree/portable_math.h"

namespace tessera {

/// q(x) = x'Ax - 2 b'x + c, with A symmetric. Sums of quadrics are exact in the sense of their order only:
/// add in a fixed order.
struct Quadric {
  double xx = 0, xy = 0, xz = 0, yy = 0, yz = 0, zz = 0;
  double bx = 0, by = 0, bz = 0, c = 0;

  Quadric& operator+=(const Quadric& o) {
    // The ten numbers lie side by side.
    double* to = reinterpret_cast<double*>(this);
    const double* from = reinterpret_cast<const double*>(&o);
    _mm256_storeu_pd(to, _mm256_add_pd(_mm256_loadu_pd(to), _mm256_loadu_pd(from)));
    _mm256_storeu_pd(to + 4, _mm256_add_pd(_mm256_loadu_pd(to + 4), _mm256_loadu_pd(from + 4)));
    _mm_storeu_pd(to + 8, _mm_add_pd(_mm_loadu_pd(to + 8), _mm_loadu_pd(from + 8)));
    return *this;
  }
  double operator()(double x, double y, double z) const {
    const double ax = xx * x + xy * y + xz * z - 2.0 * bx;
    const double ay = xy * x + yy * y + yz * z - 2.0 * by;
    const double az = xz * x + yz * y + zz * z - 2.0 * bz;
    return ax * x + ay * y + az * z + c;
  }
};

/// \param normal  unit length
[[nodiscard]] inline Quadric plane_quadric(const Double3& normal, const Double3& point, double weight) {
  const double d = dot(normal, point);
  const Double3 w = normal * weight;
  return {w[0] * normal[0], w[0] * normal[1], w[0] * normal[2], w[1] * normal[1], w[1] * normal[2],
          w[2] * normal[2], w[0] * d,         w[1] * d,         w[2] * d,         weight * d * d};
}

/// Expected squared distance to a plane whose point and normal are off by independent normal variates.
/// \param position_variance  per coordinate, squared scan units
/// \param normal_variance    per coordinate, no unit
[[nodiscard]] inline Quadric uncertain_plane_quadric(const Double3& normal, const Double3& point,
                                                     double weight, double position_variance,
                                                     double normal_variance) {
  Quadric q = plane_quadric(normal, point, weight);
  const double wn = weight * normal_variance;
  q.xx += wn, q.yy += wn, q.zz += wn;
  q.bx += wn * point[0], q.by += wn * point[1], q.bz += wn * point[2];
  q.c += wn * dot(point, point) + weight * position_variance * (1.0 + 3.0 * normal_variance);
  return q;
}

static_assert(sizeof(Quadric) == 10 * sizeof(double));

/// The minimum of q. \return false where it is not well determined (the condition number is above 1e6)
bool quadric_minimum(const Quadric& q, Double3& minimum);

}  // namespace tessera
