/// \file small_matrix.h
/// Systems of at most a handful of unknowns. The order of all sums is written down, with nothing but + - * / sqrt: the same
/// bits on every machine.
#pragma once
#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <type_traits>

#include "octree/vector.h"

namespace tessera {

/// Rows of a square matrix; not set by default.
template <std::size_t kSize>
struct SmallMatrix {
  std::array<double, kSize * kSize> entries;

  [[nodiscard]] static SmallMatrix zero() { return {{}}; }
  double& operator()(std::size_t row, std::size_t column) { return entries[row * kSize + column]; }
  double operator()(std::size_t row, std::size_t column) const { return entries[row * kSize + column]; }
};
using Matrix3 = SmallMatrix<3>;

/// The row as a vector.
[[nodiscard]] inline Double3 row(const Matrix3& m, std::size_t i) {
  return {m(i, 0), m(i, 1), m(i, 2)};
}

/// Turns the lower triangle of the leading n x n block into its Cholesky factor.
/// \return false where a pivot is not above `minimum` + `share` of its diagonal entry
template <std::size_t kSize>
bool cholesky_factor(SmallMatrix<kSize>& a, double minimum = 0.0, double share = 0.0, std::size_t n = kSize) {
  for (std::size_t i = 0; i < n; ++i) {
    for (std::size_t j = 0; j <= i; ++j) {
      double sum = a(i, j);
      for (std::size_t k = 0; k < j; ++k) sum -= a(i, k) * a(j, k);
      if (i != j) {
        a(i, j) = sum / a(j, j);
      } else if (sum > minimum + share * a(i, i)) {
        a(i, i) = std::sqrt(sum);
      } else {
        return false;
      }
    }
  }
  return true;
}

/// x of L L' x = b in place of b. \param factor  of cholesky_factor
template <std::size_t kSize>
void cholesky_solve(const SmallMatrix<kSize>& factor, std::type_identity_t<std::array<double, kSize>>& x,
                    std::size_t n = kSize) {
  double* const at = x.data();
  for (std::size_t i = 0; i < n; ++i) {
    for (std::size_t k = 0; k < i; ++k) at[i] -= factor(i, k) * at[k];
    at[i] /= factor(i, i);
  }
  for (std::size_t i = n; i-- > 0;) {
    for (std::size_t k = i + 1; k < n; ++k) at[i] -= factor(k, i) * at[k];
    at[i] /= factor(i, i);
  }
}

/// x of m x = b in place of b, by elimination of the leading n x n block without pivots.
/// \pre m is symmetric, positive definite
template <std::size_t kSize>
void eliminate(SmallMatrix<kSize>& m, std::type_identity_t<std::array<double, kSize>>& b,
               std::size_t n = kSize) {
  double* const at = b.data();
  for (std::size_t i = 0; i < n; ++i) {
    for (std::size_t r = i + 1; r < n; ++r) {
      const double factor = m(r, i) / m(i, i);
      for (std::size_t j = i; j < n; ++j) m(r, j) -= factor * m(i, j);
      at[r] -= factor * at[i];
    }
  }
  for (std::size_t i = n; i-- > 0;) {
    for (std::size_t j = i + 1; j < n; ++j) at[i] -= m(i, j) * at[j];
    at[i] /= m(i, i);
  }
}

/// Cramer's rule for a symmetric matrix.
struct Cramer3 {
  double xx, xy, xz, yy, yz, zz;  ///< of the matrix
  double c00 = yy * zz - yz * yz, c01 = xz * yz - xy * zz, c02 = xy * yz - xz * yy;
  double determinant = xx * c00 + xy * c01 + xz * c02;

  [[nodiscard]] Double3 solve(const Double3& b) const {
    const double c11 = xx * zz - xz * xz, c12 = xy * xz - xx * yz, c22 = xx * yy - xy * xy;
    return {(c00 * b[0] + c01 * b[1] + c02 * b[2]) / determinant,
            (c01 * b[0] + c11 * b[1] + c12 * b[2]) / determinant,
            (c02 * b[0] + c12 * b[1] + c22 * b[2]) / determinant};
  }
};

/// Turns a symmetric matrix into its eigenvalues, in no order, on the diagonal, by cyclic Jacobi rotations.
/// Source: Golub, Van Loan, "Matrix Computations", 8.5 (convergence is quadratic).
/// \param vector  out: eigenvectors as columns
/// \param sweeps  at most so many
/// \param enough  stop when the squares of the entries above the diagonal sum to no more
template <std::size_t kSize>
void jacobi_eigen(SmallMatrix<kSize>& a, SmallMatrix<kSize>& vector, int sweeps, double enough) {
  vector = SmallMatrix<kSize>::zero();
  for (std::size_t k = 0; k < kSize; ++k) vector(k, k) = 1.0;
  for (int sweep = 0; sweep < sweeps; ++sweep) {
    double off = 0.0;
    for (std::size_t p = 0; p + 1 < kSize; ++p)
      for (std::size_t q = p + 1; q < kSize; ++q) off += a(p, q) * a(p, q);
    if (off <= enough) break;
    for (std::size_t p = 0; p + 1 < kSize; ++p) {
      for (std::size_t q = p + 1; q < kSize; ++q) {
        if (a(p, q) == 0.0) continue;
        const double theta = (a(q, q) - a(p, p)) / (2.0 * a(p, q));
        const double t = (theta < 0.0 ? -1.0 : 1.0) / (std::fabs(theta) + std::sqrt(theta * theta + 1.0));
        const double c = 1.0 / std::sqrt(t * t + 1.0);
        const double s = t * c;
        const auto rotate = [c, s](double& first, double& second) {
          const double u = first, v = second;
          first = c * u - s * v;
          second = s * u + c * v;
        };
        for (std::size_t k = 0; k < kSize; ++k) rotate(a(k, p), a(k, q));
        for (std::size_t k = 0; k < kSize; ++k) rotate(a(p, k), a(q, k));
        a(p, q) = a(q, p) = 0.0;
        for (std::size_t k = 0; k < kSize; ++k) rotate(vector(k, p), vector(k, q));
      }
    }
  }
}

/// Eigenvalues to the last bit that rotations reach, ascending, eigenvectors as rows.
/// \param m  xx, xy, xz, yy, yz, zz
inline void symmetric_eigen3(const std::array<double, 6>& m, Double3& values,
                             std::array<Double3, 3>& vectors) {
  constexpr int kSweeps = 12;  // six suffice for double, twice that costs nothing
  Matrix3 a = {{m[0], m[1], m[2], m[1], m[3], m[4], m[2], m[4], m[5]}}, column;
  jacobi_eigen(a, column, kSweeps, 0.0);
  const Double3 value = {a(0, 0), a(1, 1), a(2, 2)};
  std::array<std::size_t, 3> order = {0, 1, 2};
  std::sort(order.begin(), order.end(),
            [&](std::size_t i, std::size_t j) { return value[i] != value[j] ? value[i] < value[j] : i < j; });
  for (std::size_t i = 0; i < 3; ++i) {
    values[i] = value[order[i]];
    for (std::size_t k = 0; k < 3; ++k) vectors[i][k] = column(k, order[i]);
  }
}

/// The smallest eigenvalue with its vector, and the other two, without rotations: a quarter of their time.
struct MinEigen3 {
  Double3 values{};  ///< ascending
  Double3
      vector{};  ///< unit, of the smallest one; any that is across the largest where the smaller two are equal
};

/// Newton's method on the characteristic polynomial from below its least root; the vector is the longest cross product
/// of two rows. Source: Smith, "Eigenvalues of a Symmetric 3 x 3 Matrix", 1961 (scaled characteristic polynomial).
/// \param m  xx, xy, xz, yy, yz, zz
[[nodiscard]] inline MinEigen3 min_eigen3(const std::array<double, 6>& m) {
  constexpr int kNewtonSteps =
      40;  // five do but where the smaller two are equal: there each halves the error
  constexpr double kEnough = 4e-16;  // of a step, in units of the spread
  constexpr double kParallel =
      1e-12;  // squared length of a cross product of which rounding is a share, spread^4
  MinEigen3 out;
  const double mean = (m[0] + m[3] + m[5]) / 3.0;
  const double xx = m[0] - mean, yy = m[3] - mean, zz = m[5] - mean;
  const double square = xx * xx + yy * yy + zz * zz + 2.0 * (m[1] * m[1] + m[2] * m[2] + m[4] * m[4]);
  const double spread = std::sqrt(square / 6.0);
  if (!(spread > 1e-14 * std::fabs(mean))) return {{mean, mean, mean}, {1.0, 0.0, 0.0}};
  // m = mean + spread * b; the eigenvalues t of b are roots of t^3 - 3 t - 2 r, the least between -2 and -1.
  const double determinant =
      xx * (yy * zz - m[4] * m[4]) - m[1] * (m[1] * zz - m[4] * m[2]) + m[2] * (m[1] * m[4] - yy * m[2]);
  const double r = std::clamp(determinant / (2.0 * spread * spread * spread), -1.0, 1.0);
  double t = -2.0;
  for (int k = 0; k < kNewtonSteps; ++k) {
    const double slope = 3.0 * (t * t - 1.0);
    if (!(slope > 0.0)) break;
    const double step = (t * (t * t - 3.0) - 2.0 * r) / slope;
    if (!(step < -kEnough)) break;
    t -= step;
  }
  t = std::min(t, -1.0);
  const double apart = std::sqrt(std::max(0.0, 12.0 - 3.0 * t * t));
  out.values = {mean + spread * t, mean + spread * 0.5 * (-t - apart), mean + spread * 0.5 * (-t + apart)};
  const Double3 a = {xx - spread * t, m[1], m[2]}, b = {m[1], yy - spread * t, m[4]},
                c = {m[2], m[4], zz - spread * t};
  Double3 best = cross(a, b);
  for (const Double3& other : {cross(b, c), cross(c, a)})
    if (dot(other, other) > dot(best, best)) best = other;
  const double length2 = dot(best, best);
  if (length2 > kParallel * square * square) {
    out.vector = best * (1.0 / std::sqrt(length2));
    return out;
  }
  std::array<Double3, 3> vectors;
  symmetric_eigen3(m, out.values, vectors);
  out.vector = vectors[0];
  return out;
}

}  // namespace tessera
