/// \file multifrontal_lu.h
/// LU factors of sparse matrices with a pattern that is nearly symmetric, on the fronts of front_tree.h and with the dense kernels
/// of dense_front.h: the same bits on every machine. Pivots are chosen within a front, so that fill is what the fronts say; a pivot
/// that vanishes there is told, and small ones show in the residual, which is the caller's to refine.
/// Source: Duff, Reid, "The Multifrontal Solution of Unsymmetric Sets of Linear Equations", 1984.
#pragma once
#include <cstdint>
#include <span>
#include <vector>

#include "solvers/factor_store.h"
#include "solvers/front_tree.h"
#include "solvers/sparse_matrix.h"

namespace tessera {

class MultifrontalLu {
 public:
  /// Orders and finds the fronts, by the pattern of the matrix and its transpose alone. \pre a full diagonal
  /// \throws ResourceError when CHOLMOD runs out of memory or of indices
  explicit MultifrontalLu(const SparseMatrix& a, Ordering ordering = Ordering::kMinimumDegree);

  [[nodiscard]] std::uint64_t entries() const {
    return 2 * tree_.first(tree_.count());
  }                                                     ///< of both factors, 8 bytes each
  double flops() const { return 2.0 * tree_.flops(); }  ///< of factor()
  [[nodiscard]] std::uint64_t bytes() const {
    return tree_.bytes() + sizeof(std::int32_t) * tree_.unknowns();
  }
  /// Held beside these and the store by factor(), and by solve() for so many columns.
  [[nodiscard]] std::uint64_t factor_bytes() const;
  [[nodiscard]] std::uint64_t solve_bytes(int width) const;

  /// Appends entries() numbers. Returns the unknown whose pivot is what rounding leaves of zero; -1 when there is none.
  /// \pre the pattern of the constructor; the store is empty
  std::int64_t factor(const SparseMatrix& a, FactorStore& store);
  /// x = A^-1 b in place, n x width interleaved. \pre the store holds what factor() put there
  void solve(FactorStore& store, std::span<double> b, int width) const;

 private:
  void assemble(const SparseMatrix& a, const SparseMatrix& transposed, std::size_t front,
                std::span<double> value, std::vector<std::int32_t>& slot) const;
  void add_contribution(std::size_t child, std::span<const double> contribution, std::span<double> value,
                        std::size_t size, const std::vector<std::int32_t>& slot) const;

  FrontTree tree_;
  std::vector<std::int32_t> swapped_;   ///< by place: the row of its front that it changed places with
  std::uint64_t transposed_bytes_ = 0;  ///< of the matrix, by columns, while it is factored
};

}  // namespace tessera
