/// \file multifrontal_cholesky.h
/// Cholesky factors of sparse symmetric positive definite matrices whose solutions have the same bits on every machine:
/// our own dense kernels (dense_front.h) on the supernodes that CHOLMOD's analysis finds, which is whole numbers alone.
/// The factor goes to a store front by front and is read from there: a stack of fronts is all that it takes in memory.
/// Sources: Duff, Reid, "The Multifrontal Solution of Indefinite Sparse Symmetric Linear Equations", 1983; Liu, "The
/// Multifrontal Method for Sparse Matrix Solution", 1992.
#pragma once
#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "solvers/factor_store.h"
#include "solvers/sparse_matrix.h"

namespace tessera {

class MultifrontalCholesky {
 public:
  /// Orders by minimum degree and finds the fronts, by the pattern alone. \pre symmetric, with a full diagonal
  /// \throws ResourceError when CHOLMOD runs out of memory or of indices
  explicit MultifrontalCholesky(const SparseMatrix& a);

  std::uint64_t entries() const { return first_.back(); }  ///< of the factor, 8 bytes each in the store
  double flops() const { return flops_; }                  ///< of factor()
  /// Held now: ordering and fronts.
  std::uint64_t bytes() const;
  /// Held beside these and the store by factor(), and by solve() for so many columns.
  std::uint64_t factor_bytes() const;
  std::uint64_t solve_bytes(int width) const;

  /// Appends entries() numbers. Returns the unknown whose pivot is not positive, or is what rounding leaves of zero; -1
  /// when the matrix is positive definite. \pre the pattern of the constructor; the store is empty
  std::int64_t factor(const SparseMatrix& a, FactorStore& store) const;
  /// x = A^-1 b in place, n x width interleaved. \pre the store holds what factor() put there
  void solve(FactorStore& store, std::span<double> b, int width) const;

 private:
  struct Front {
    std::int32_t column = 0;      ///< first of those that it eliminates
    std::int32_t eliminated = 0;  ///< how many
    std::int32_t children = 0;    ///< fronts before it whose rest it takes, the last on the stack
  };
  std::size_t size(std::size_t front) const { return rows_start_[front + 1] - rows_start_[front]; }
  std::size_t rest(std::size_t front) const {
    return size(front) - static_cast<std::size_t>(fronts_[front].eliminated);
  }
  std::span<const std::int32_t> rows(std::size_t front) const {
    return std::span(rows_).subspan(rows_start_[front], size(front));
  }
  void measure();
  void assemble(const SparseMatrix& a, std::size_t front, std::span<double> value,
                std::vector<std::int32_t>& place) const;
  void add_rest(std::size_t child, std::span<const double> rest, std::span<double> value, std::size_t size,
                const std::vector<std::int32_t>& place) const;

  std::vector<std::int32_t> unknown_;  ///< in the order of elimination
  std::vector<std::int32_t> place_;    ///< of each unknown in it
  std::vector<Front> fronts_;          ///< children before parents
  std::vector<std::size_t> rows_start_;
  std::vector<std::int32_t> rows_;                 ///< of each front, in the order of elimination, ascending
  std::vector<std::uint64_t> first_;               ///< of each front's columns in the store, and the end
  std::size_t largest_ = 0, largest_columns_ = 0;  ///< rows of a front; entries of its columns
  std::size_t stack_ = 0;                          ///< most numbers that wait on the stack at a time
  double flops_ = 0.0;
};

}  // namespace tessera
