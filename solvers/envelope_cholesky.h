/// \file envelope_cholesky.h
/// Cholesky factors of a sparse symmetric positive definite matrix inside its envelope, for systems of a few
/// thousand unknowns whose solution must have the same bits on every machine: CHOLMOD's depends on the BLAS.
/// Source: George, Liu, "Computer Solution of Large Sparse Positive Definite Systems", 1981, chapter 4.
#pragma once
#include <cstdint>
#include <span>
#include <vector>

#include "solvers/sparse_matrix.h"

namespace tessera {

class EnvelopeCholesky {
 public:
  /// Orders (reverse Cuthill-McKee) and lays out; nothing is factored yet. \pre symmetric, with a full diagonal
  explicit EnvelopeCholesky(const SparseMatrix& a);

  /// Entries inside the envelope: factoring takes 8 bytes each and the sum of their rows' squares in time.
  [[nodiscard]] std::uint64_t envelope() const { return first_.back(); }
  /// \pre the matrix of the constructor. Returns false if it is not positive definite in double
  /// precision; then solve() must not be called.
  bool factor(const SparseMatrix& a);
  /// x = A^-1 b in place. \pre factor() was true; b.size() == n
  void solve(std::span<double> b) const;

 private:
  /// Entries of the lower triangle in the new numbers.
  template <class Sink>
  void for_lower(const SparseMatrix& a, const Sink& sink) const;

  std::vector<std::uint32_t> slot_;   ///< new number of every unknown
  std::vector<std::uint32_t> start_;  ///< first column of every row inside the envelope
  std::vector<std::uint64_t> first_;  ///< offset of that entry; row r ends before first_[r + 1]
  std::vector<double> entry_;
};

}  // namespace tessera
