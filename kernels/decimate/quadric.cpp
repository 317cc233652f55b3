#include "kernels/decimate/quadric.h"

#include <cmath>

namespace tessera {

bool quadric_minimum(const Quadric& q, synth::Vec3& minimum) {
  // Cramer's rule with cofactors; A is positive semidefinite, so its determinant against the cube of its
  // trace tells how flat the smallest direction is.
  const double c00 = q.yy * q.zz - q.yz * q.yz;
  const double c01 = q.xz * q.yz - q.xy * q.zz;
  const double c02 = q.xy * q.yz - q.xz * q.yy;
  const double det = q.xx * c00 + q.xy * c01 + q.xz * c02;
  const double trace = q.xx + q.yy + q.zz;
  if (!(det > 1e-6 * trace * trace * trace)) return false;
  const double c11 = q.xx * q.zz - q.xz * q.xz;
  const double c12 = q.xy * q.xz - q.xx * q.yz;
  const double c22 = q.xx * q.yy - q.xy * q.xy;
  minimum = {(c00 * q.bx + c01 * q.by + c02 * q.bz) / det, (c01 * q.bx + c11 * q.by + c12 * q.bz) / det,
             (c02 * q.bx + c12 * q.by + c22 * q.bz) / det};
  return std::isfinite(minimum.x) && std::isfinite(minimum.y) && std::isfinite(minimum.z);
}

}  // namespace tessera
