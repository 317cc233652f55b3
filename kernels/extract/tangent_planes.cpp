#include "kernels/extract/tangent_planes.h"

#include <utility>

#include "octree/small_matrix.h"

namespace tessera {
namespace {

/// A singular value below this fraction of the largest says nothing about the feature. Angles have decided
/// its kind already, so this only guards against division by noise.
constexpr double kRelativeCut = 0.03;
/// Ridge of the fit of normals, in cells^2: roots closer together than its square root predict no curvature.
constexpr double kRidge = 0.02;

/// Most matrices end after three or four sweeps; 1e-11 of the scale is far below the accuracy of any normal.
constexpr int kSweeps = 8;
constexpr double kEnough = 1e-22;

}  // namespace

PlaneIntersection intersect_planes(const TangentPlanes& planes, const Double3& anchor, int rank) {
  Matrix3 a = Matrix3::zero();
  Double3 b{};
  for (std::size_t i = 0; i < planes.size; ++i) {
    const Double3& n = planes.normal[i];
    const Double3& p = planes.point[i];
    const double d =
        planes.offset[i] + n[0] * (p[0] - anchor[0]) + n[1] * (p[1] - anchor[1]) + n[2] * (p[2] - anchor[2]);
    for (std::size_t r = 0; r < 3; ++r) {
      const double wn = planes.weight[i] * n[r];
      b[r] += wn * d;
      for (std::size_t c = 0; c < 3; ++c) a(r, c) += wn * n[c];
    }
  }
  Matrix3 vector;
  const double trace = a(0, 0) + a(1, 1) + a(2, 2);
  jacobi_eigen(a, vector, kSweeps, kEnough * trace * trace);
  const Double3 value = {a(0, 0), a(1, 1), a(2, 2)};
  std::array<std::size_t, 3> order = {0, 1, 2};
  if (value[order[0]] < value[order[1]]) std::swap(order[0], order[1]);
  if (value[order[1]] < value[order[2]]) std::swap(order[1], order[2]);
  if (value[order[0]] < value[order[1]]) std::swap(order[0], order[1]);
  const double cut = kRelativeCut * kRelativeCut * value[order[0]];
  PlaneIntersection out;
  out.position = anchor;
  for (std::size_t k = 0; k < static_cast<std::size_t>(rank); ++k) {
    const std::size_t column = order[k];
    if (!(value[column] > cut)) break;
    const Double3 v = {vector(0, column), vector(1, column), vector(2, column)};
    const double s = dot(v, b) / value[column];
    for (std::size_t r = 0; r < 3; ++r) out.position[r] += s * v[r];
  }
  out.min_spread = value[order[2]] / value[order[0]];
  return out;
}

Double3 intersect_crease(const TangentPlanes& planes, const Double3& anchor, const Double3& direction,
                         std::size_t any) {
  const Double3 e1 = planes.normal[any];  // orthogonal to the direction: one of the two that span it
  const Double3 e2 = cross(direction, e1);
  double a11 = 0.0, a12 = 0.0, a22 = 0.0, b1 = 0.0, b2 = 0.0;
  for (std::size_t i = 0; i < planes.size; ++i) {
    const Double3& n = planes.normal[i];
    const Double3& p = planes.point[i];
    const double d =
        planes.offset[i] + n[0] * (p[0] - anchor[0]) + n[1] * (p[1] - anchor[1]) + n[2] * (p[2] - anchor[2]);
    const double n1 = dot(n, e1), n2 = dot(n, e2);
    a11 += n1 * n1;
    a12 += n1 * n2;
    a22 += n2 * n2;
    b1 += n1 * d;
    b2 += n2 * d;
  }
  const double det = a11 * a22 - a12 * a12;
  const double s = (b1 * a22 - b2 * a12) / det;
  const double t = (b2 * a11 - b1 * a12) / det;
  return {anchor[0] + s * e1[0] + t * e2[0], anchor[1] + s * e1[1] + t * e2[1],
          anchor[2] + s * e1[2] + t * e2[2]};
}

void extrapolate_normals(TangentPlanes& planes, const std::array<int, kMaxPlanes>& sheets, int sheet,
                         const Double3& x) {
  std::size_t count = 0;
  Double3 p_mean{}, n_mean{};
  for (std::size_t i = 0; i < planes.size; ++i) {
    if (sheets[i] != sheet) continue;
    ++count;
    for (std::size_t k = 0; k < 3; ++k) {
      p_mean[k] += planes.point[i][k];
      n_mean[k] += planes.normal[i][k];
    }
  }
  if (count < 2) return;
  for (std::size_t k = 0; k < 3; ++k) {
    p_mean[k] /= static_cast<double>(count);
    n_mean[k] /= static_cast<double>(count);
  }
  Matrix3 spread = Matrix3::zero(), cross_cov = Matrix3::zero();
  for (int k = 0; k < 3; ++k) spread(k, k) = kRidge;
  for (std::size_t i = 0; i < planes.size; ++i) {
    if (sheets[i] != sheet) continue;
    for (std::size_t r = 0; r < 3; ++r) {
      for (std::size_t c = 0; c < 3; ++c) {
        const double q = planes.point[i][c] - p_mean[c];
        spread(r, c) += (planes.point[i][r] - p_mean[r]) * q;
        cross_cov(r, c) += (planes.normal[i][r] - n_mean[r]) * q;
      }
    }
  }
  // The ridge keeps the determinant above kRidge^3.
  const Cramer3 system{spread(0, 0), spread(0, 1), spread(0, 2), spread(1, 1), spread(1, 2), spread(2, 2)};
  const Double3 y = system.solve(x - p_mean);
  Double3 at_x;
  for (std::size_t k = 0; k < 3; ++k) at_x[k] = n_mean[k] + dot(row(cross_cov, k), y);
  at_x = unit(at_x);
  for (std::size_t i = 0; i < planes.size; ++i) {
    if (sheets[i] != sheet) continue;
    planes.normal[i] = unit(planes.normal[i] + at_x);
  }
}

}  // namespace tessera
