/// \file jacobi_eigen3.h
/// Eigen-decomposition of a symmetric 3x3 matrix by cyclic Jacobi rotations, with nothing but + - * / sqrt.
/// Source: Golub, Van Loan, "Matrix Computations", 8.5 (convergence is quadratic).
#pragma once
#include <array>
#include <cmath>

#include "octree/lattice.h"

namespace tessera {

/// \param a  symmetric matrix
/// \param vector  out: eigenvectors as columns
/// \param sweeps  at most so many
/// \param enough  stop when the squares of the off-diagonal entries sum to at most this share of the squared trace
/// \return eigenvalues, in no order
inline Double3 jacobi_eigen3(std::array<Double3, 3> a, std::array<Double3, 3>& vector, int sweeps,
                             double enough) {
  vector = {Double3{1, 0, 0}, Double3{0, 1, 0}, Double3{0, 0, 1}};
  const double scale = a[0][0] + a[1][1] + a[2][2];
  for (int sweep = 0; sweep < sweeps; ++sweep) {
    const double off = a[0][1] * a[0][1] + a[0][2] * a[0][2] + a[1][2] * a[1][2];
    if (off <= enough * scale * scale) break;
    for (std::size_t p = 0; p < 2; ++p) {
      for (std::size_t q = p + 1; q < 3; ++q) {
        if (a[p][q] == 0.0) continue;
        const double theta = (a[q][q] - a[p][p]) / (2.0 * a[p][q]);
        const double t = (theta < 0.0 ? -1.0 : 1.0) / (std::fabs(theta) + std::sqrt(theta * theta + 1.0));
        const double c = 1.0 / std::sqrt(t * t + 1.0);
        const double s = t * c;
        for (std::size_t k = 0; k < 3; ++k) {
          const double kp = a[k][p], kq = a[k][q];
          a[k][p] = c * kp - s * kq;
          a[k][q] = s * kp + c * kq;
        }
        for (std::size_t k = 0; k < 3; ++k) {
          const double pk = a[p][k], qk = a[q][k];
          a[p][k] = c * pk - s * qk;
          a[q][k] = s * pk + c * qk;
        }
        a[p][q] = a[q][p] = 0.0;
        for (std::size_t k = 0; k < 3; ++k) {
          const double kp = vector[k][p], kq = vector[k][q];
          vector[k][p] = c * kp - s * kq;
          vector[k][q] = s * kp + c * kq;
        }
      }
    }
  }
  return {a[0][0], a[1][1], a[2][2]};
}

}  // namespace tessera
