#include "kernels/points/plane_fits.h"

#include <algorithm>
#include <cmath>

#include "octree/lanes.h"
#include "octree/small_matrix.h"

namespace tessera {
namespace {

/// Ratio of the two larger eigenvalues below which the neighbours lie on a line: any plane through it fits.
constexpr double kLine = 0.0025;

Double4 row_of(const NeighbourSums& sums, std::size_t row) {
  return load4(sums.row[row]);
}

/// Of four matrices, as MinEigen3 has it of one; `known` tells where: elsewhere min_eigen3() takes other ways.
struct MinEigenLanes {
  Double4x3 values, vector;
  Mask4 known;
};

/// min_eigen3(), operation by operation.
MinEigenLanes min_eigen(const std::array<Double4, 6>& m) {
  constexpr int kNewtonSteps = 40;
  constexpr double kEnough = 4e-16, kParallel = 1e-12;
  const Double4 zero = {}, one = zero + 1.0;
  MinEigenLanes out;
  const Double4 mean = (m[0] + m[3] + m[5]) / 3.0;
  const Double4 xx = m[0] - mean, yy = m[3] - mean, zz = m[5] - mean;
  const Double4 square = xx * xx + yy * yy + zz * zz + 2.0 * (m[1] * m[1] + m[2] * m[2] + m[4] * m[4]);
  const Double4 spread = square_root(square / 6.0);
  out.known = spread > 1e-14 * (mean < 0.0 ? -mean : mean);
  const Double4 determinant =
      xx * (yy * zz - m[4] * m[4]) - m[1] * (m[1] * zz - m[4] * m[2]) + m[2] * (m[1] * m[4] - yy * m[2]);
  Double4 r = determinant / (2.0 * spread * spread * spread);
  r = r < -1.0 ? -one : r > 1.0 ? one : r;
  Double4 t = zero - 2.0;
  Mask4 runs = out.known;
  for (int k = 0; k < kNewtonSteps; ++k) {
    const Double4 slope = 3.0 * (t * t - 1.0);
    const Double4 step = (t * (t * t - 3.0) - 2.0 * r) / slope;
    runs &= (slope > 0.0) & (step < -kEnough);
    if (bits_of(runs) == 0) break;
    t = runs ? t - step : t;
  }
  t = t > -1.0 ? -one : t;
  const Double4 left = 12.0 - 3.0 * t * t, apart = square_root(left > 0.0 ? left : zero);
  out.values = {mean + spread * t, mean + spread * 0.5 * (-t - apart), mean + spread * 0.5 * (-t + apart)};
  const Double4x3 a = {xx - spread * t, m[1], m[2]}, b = {m[1], yy - spread * t, m[4]},
                  c = {m[2], m[4], zz - spread * t};
  Double4x3 best = cross(a, b);
  Double4 length2 = dot(best, best);
  for (const Double4x3& other : {cross(b, c), cross(c, a)}) {
    const Double4 theirs = dot(other, other);
    const Mask4 longer = theirs > length2;
    for (std::size_t k = 0; k < 3; ++k) best[k] = longer ? other[k] : best[k];
    length2 = longer ? theirs : length2;
  }
  out.known &= length2 > kParallel * square * square;
  const Double4 scale = 1.0 / square_root(length2);
  for (std::size_t k = 0; k < 3; ++k) out.vector[k] = best[k] * scale;
  return out;
}

FittedPlane plane_of(const Double3& values, const Double3& n) {
  FittedPlane plane;
  const double minimum = std::max(values[0], 0.0), sum = minimum + values[1] + values[2];
  if (!(sum > 0.0) || values[1] < kLine * values[2]) return plane;
  // A sign that every block agrees on: the component of largest magnitude is positive.
  std::size_t major = 0;
  for (std::size_t a = 1; a < 3; ++a)
    if (std::fabs(n[a]) > std::fabs(n[major])) major = a;
  const double sign = n[major] < 0.0 ? -1.0 : 1.0;
  for (std::size_t a = 0; a < 3; ++a) plane.normal[a] = static_cast<float>(sign * n[a]);
  plane.variation = static_cast<float>(minimum / sum);
  plane.residual = static_cast<float>(std::sqrt(minimum));
  return plane;
}

}  // namespace

std::array<FittedPlane, kDoubleLanes> fit_planes(const NeighbourSums& sums) {
  using S = NeighbourSums;
  const Double4 weight = row_of(sums, S::kWeight);
  const Double4x3 mean = {row_of(sums, S::kX) / weight, row_of(sums, S::kY) / weight,
                          row_of(sums, S::kZ) / weight};
  const std::array<Double4, 6> covariance = {
      row_of(sums, S::kXX) / weight - mean[0] * mean[0], row_of(sums, S::kXY) / weight - mean[0] * mean[1],
      row_of(sums, S::kXZ) / weight - mean[0] * mean[2], row_of(sums, S::kYY) / weight - mean[1] * mean[1],
      row_of(sums, S::kYZ) / weight - mean[1] * mean[2], row_of(sums, S::kZZ) / weight - mean[2] * mean[2]};
  const MinEigenLanes eigen = min_eigen(covariance);
  std::array<FittedPlane, kDoubleLanes> planes;
  for (std::size_t lane = 0; lane < kDoubleLanes; ++lane) {
    if (!(weight[lane] > 0.0)) continue;
    const auto of = [lane](const auto& four) { return four[lane]; };
    MinEigen3 one{{of(eigen.values[0]), of(eigen.values[1]), of(eigen.values[2])},
                  {of(eigen.vector[0]), of(eigen.vector[1]), of(eigen.vector[2])}};
    if (eigen.known[lane] == 0) {
      std::array<double, 6> m;
      for (std::size_t k = 0; k < m.size(); ++k) m[k] = covariance[k][lane];
      one = min_eigen3(m);
    }
    planes[lane] = plane_of(one.values, one.vector);
  }
  return planes;
}

}  // namespace tessera
