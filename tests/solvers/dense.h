/// \file dense.h
/// Sparse matrices and interleaved vectors as Eigen's dense ones, to compare with.
#pragma once
#include <Eigen/Dense>
#include <span>

#include "solvers/sparse_matrix.h"

namespace tessera::test {

inline Eigen::MatrixXd dense(const SparseMatrix& a) {
  Eigen::MatrixXd m = Eigen::MatrixXd::Zero(a.rows, a.columns);
  for (std::int32_t i = 0; i < a.rows; ++i)
    for (std::int32_t e = a.start[i]; e < a.start[i + 1]; ++e) m(i, a.column[e]) += a.value[e];
  return m;
}

inline Eigen::MatrixXd dense(std::span<const double> interleaved, int width) {
  return Eigen::Map<const Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>>(
      interleaved.data(), static_cast<Eigen::Index>(interleaved.size()) / width, width);
}

/// Largest |a_ij - a_ji| over the largest |a_ij|; 0 for an exactly symmetric matrix. \pre square
inline double asymmetry(const SparseMatrix& a) {
  const Eigen::MatrixXd m = dense(a);
  const double largest = m.cwiseAbs().maxCoeff();
  return largest > 0.0 ? (m - m.transpose()).cwiseAbs().maxCoeff() / largest : 0.0;
}

}  // namespace tessera::test
