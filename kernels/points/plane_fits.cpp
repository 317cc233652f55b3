#include "kernels/points/plane_fits.h"

#include <immintrin.h>

#include <algorithm>
#include <cmath>

#include "octree/small_matrix.h"

namespace tessera {
namespace {

constexpr std::size_t kLanes = NeighbourSums::kLanes;
/// Four numbers added and multiplied one by one: the same bits as one after the other.
using Four [[gnu::vector_size(kLanes * sizeof(double))]] = double;
/// All bits of a lane, or none.
using Mask = decltype(Four{} < Four{});

/// Ratio of the two larger eigenvalues below which the neighbours lie on a line: any plane through it fits.
constexpr double kLine = 0.0025;

Four root(Four v) {
  return _mm256_sqrt_pd(v);
}
bool any(Mask mask) {
  return !_mm256_testz_si256(reinterpret_cast<__m256i&>(mask), reinterpret_cast<__m256i&>(mask));
}
Four row_of(const NeighbourSums& sums, std::size_t row) {
  return _mm256_load_pd(sums.row[row]);
}

using Four3 = std::array<Four, 3>;
Four3 cross(const Four3& a, const Four3& b) {
  return {a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]};
}
Four dot(const Four3& a, const Four3& b) {
  return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

/// Of four matrices, as MinEigen3 has it of one; `known` tells where: elsewhere min_eigen3() takes other ways.
struct MinEigenLanes {
  Four3 values, vector;
  Mask known;
};

/// min_eigen3(), operation by operation.
MinEigenLanes min_eigen(const std::array<Four, 6>& m) {
  constexpr int kNewtonSteps = 40;
  constexpr double kEnough = 4e-16, kParallel = 1e-12;
  const Four zero = {}, one = zero + 1.0;
  MinEigenLanes out;
  const Four mean = (m[0] + m[3] + m[5]) / 3.0;
  const Four xx = m[0] - mean, yy = m[3] - mean, zz = m[5] - mean;
  const Four square = xx * xx + yy * yy + zz * zz + 2.0 * (m[1] * m[1] + m[2] * m[2] + m[4] * m[4]);
  const Four spread = root(square / 6.0);
  out.known = spread > 1e-14 * (mean < 0.0 ? -mean : mean);
  const Four determinant =
      xx * (yy * zz - m[4] * m[4]) - m[1] * (m[1] * zz - m[4] * m[2]) + m[2] * (m[1] * m[4] - yy * m[2]);
  Four r = determinant / (2.0 * spread * spread * spread);
  r = r < -1.0 ? -one : r > 1.0 ? one : r;
  Four t = zero - 2.0;
  Mask runs = out.known;
  for (int k = 0; k < kNewtonSteps; ++k) {
    const Four slope = 3.0 * (t * t - 1.0);
    const Four step = (t * (t * t - 3.0) - 2.0 * r) / slope;
    runs &= (slope > 0.0) & (step < -kEnough);
    if (!any(runs)) break;
    t = runs ? t - step : t;
  }
  t = t > -1.0 ? -one : t;
  const Four left = 12.0 - 3.0 * t * t, apart = root(left > 0.0 ? left : zero);
  out.values = {mean + spread * t, mean + spread * 0.5 * (-t - apart), mean + spread * 0.5 * (-t + apart)};
  const Four3 a = {xx - spread * t, m[1], m[2]}, b = {m[1], yy - spread * t, m[4]},
              c = {m[2], m[4], zz - spread * t};
  Four3 best = cross(a, b);
  Four length2 = dot(best, best);
  for (const Four3& other : {cross(b, c), cross(c, a)}) {
    const Four theirs = dot(other, other);
    const Mask longer = theirs > length2;
    for (std::size_t k = 0; k < 3; ++k) best[k] = longer ? other[k] : best[k];
    length2 = longer ? theirs : length2;
  }
  out.known &= length2 > kParallel * square * square;
  const Four scale = 1.0 / root(length2);
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

std::array<FittedPlane, kLanes> fit_planes(const NeighbourSums& sums) {
  using S = NeighbourSums;
  const Four weight = row_of(sums, S::kWeight);
  const Four3 mean = {row_of(sums, S::kX) / weight, row_of(sums, S::kY) / weight,
                      row_of(sums, S::kZ) / weight};
  const std::array<Four, 6> covariance = {
      row_of(sums, S::kXX) / weight - mean[0] * mean[0], row_of(sums, S::kXY) / weight - mean[0] * mean[1],
      row_of(sums, S::kXZ) / weight - mean[0] * mean[2], row_of(sums, S::kYY) / weight - mean[1] * mean[1],
      row_of(sums, S::kYZ) / weight - mean[1] * mean[2], row_of(sums, S::kZZ) / weight - mean[2] * mean[2]};
  const MinEigenLanes eigen = min_eigen(covariance);
  std::array<FittedPlane, kLanes> planes;
  for (std::size_t lane = 0; lane < kLanes; ++lane) {
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
