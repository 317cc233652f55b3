#include "kernels/decimate/quadric.h"

#include <cmath>

#include "octree/small_matrix.h"

namespace tessera {

bool quadric_minimum(const Quadric& q, Double3& minimum) {
  // A is positive semidefinite: its determinant against the cube of its trace tells how flat the smallest direction is.
  const Cramer3 system{q.xx, q.xy, q.xz, q.yy, q.yz, q.zz};
  const double trace = q.xx + q.yy + q.zz;
  if (!(system.determinant > 1e-6 * trace * trace * trace)) return false;
  minimum = system.solve({q.bx, q.by, q.bz});
  return std::isfinite(minimum[0]) && std::isfinite(minimum[1]) && std::isfinite(minimum[2]);
}

}  // namespace tessera
