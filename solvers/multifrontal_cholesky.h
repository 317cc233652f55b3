/// \file multifrontal_cholesky.h
/// Cholesky factors of sparse symmetric positive definite matrices whose solutions have the same bits on every machine:
/// our own dense kernels (dense_front.h) on the fronts that front_tree.h finds. The factor goes to a store front by front and is
/// read from there: a stack of fronts is all that it takes in memory.
#pragma once
#include <cstdint>
#include <span>
#include <vector>

#include "solvers/factor_store.h"
#include "solvers/front_tree.h"
#include "solvers/sparse_matrix.h"

namespace tessera {

class MultifrontalCholesky {
 public:
  /// Orders and finds the fronts, by the pattern alone. \pre symmetric, with a full diagonal
  /// \throws ResourceError when CHOLMOD runs out of memory or of indices
  explicit MultifrontalCholesky(const SparseMatrix& a, Ordering ordering = Ordering::kMinimumDegree);

  [[nodiscard]] std::uint64_t entries() const {
    return tree_.first(tree_.count());
  }                                               ///< of the factor, 8 bytes each in the store
  double flops() const { return tree_.flops(); }  ///< of factor()
  /// Held now: ordering and fronts.
  [[nodiscard]] std::uint64_t bytes() const { return tree_.bytes(); }
  /// Held beside these and the store by factor(), and by solve() for so many columns.
  [[nodiscard]] std::uint64_t factor_bytes() const;
  [[nodiscard]] std::uint64_t solve_bytes(int width) const;

  /// Appends entries() numbers. Returns the unknown whose pivot is not positive, or is what rounding leaves of zero; -1
  /// when the matrix is positive definite. \pre the pattern of the constructor; the store is empty
  std::int64_t factor(const SparseMatrix& a, FactorStore& store) const;
  /// x = A^-1 b in place, n x width interleaved. \pre the store holds what factor() put there
  void solve(FactorStore& store, std::span<double> b, int width) const;

 private:
  void assemble(const SparseMatrix& a, std::size_t front, std::span<double> value,
                std::vector<std::int32_t>& slot) const;
  void add_contribution(std::size_t child, std::span<const double> contribution, std::span<double> value,
                        std::size_t size, const std::vector<std::int32_t>& slot) const;

  FrontTree tree_;
};

}  // namespace tessera
