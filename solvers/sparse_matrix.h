/// \file sparse_matrix.h
/// Sparse matrices in compressed rows, and the few operations that Laplacian systems are made of.
///
/// Every sum runs in ascending column order, so results do not depend on anything but the operands. Vectors
/// with several columns are interleaved: component c of row i lies at [i * width + c], as positions do.
#pragma once
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

namespace tessera {

/// rows x columns; the entries of row i are [start[i], start[i + 1]), columns ascending and unique. A stored
/// entry may be zero: the pattern then stays the same when only values change.
struct SparseMatrix {
  std::int32_t rows = 0;
  std::int32_t columns = 0;
  std::vector<std::int32_t> start;   ///< rows + 1
  std::vector<std::int32_t> column;  ///< one per entry
  std::vector<double> value;         ///< one per entry

  [[nodiscard]] std::size_t entries() const { return column.size(); }
  [[nodiscard]] std::uint64_t bytes() const {
    return start.capacity() * sizeof(std::int32_t) + column.capacity() * sizeof(std::int32_t) +
           value.capacity() * sizeof(double);
  }
};

/// Entry (row, column), 0 where none is stored. \cost O(log entries of the row)
double entry(const SparseMatrix& a, std::int32_t row, std::int32_t column);

/// y = a x. \pre x has a.columns * width values, y a.rows * width; they do not overlap; 1 <= width
void multiply(const SparseMatrix& a, std::span<const double> x, std::span<double> y, int width = 1);

/// Transpose.
[[nodiscard]] SparseMatrix transpose(const SparseMatrix& a);

/// a diag(middle) b, or a b without `middle` (Gustavson 1978). Entries that cancel stay stored.
/// \throws ResourceError  when the product has 2^31 entries or more
[[nodiscard]] SparseMatrix product(const SparseMatrix& a, const SparseMatrix& b,
                                   std::span<const double> middle = {});

/// alpha a + beta b, on the union of both patterns. \pre same shape
[[nodiscard]] SparseMatrix sum(double alpha, const SparseMatrix& a, double beta, const SparseMatrix& b);

/// n x n with `d` on its diagonal.
[[nodiscard]] SparseMatrix diagonal_matrix(std::span<const double> d);

/// Rows `rows` of a, in that order, and of these the columns j with new_column[j] >= 0, renamed to
/// new_column[j].
/// \pre new_column is ascending where it is not negative
[[nodiscard]] SparseMatrix select(const SparseMatrix& a, std::span<const std::int32_t> rows,
                                  std::span<const std::int32_t> new_column, std::int32_t columns);

/// Whether all values are finite numbers.
[[nodiscard]] bool all_finite(std::span<const double> values);

/// |b - a x| / |b| in the 2-norm, the largest over the columns; a column with b = 0 counts |a x|.
double relative_residual(const SparseMatrix& a, std::span<const double> x, std::span<const double> b,
                         int width);

/// A + iK on complex vectors as a real matrix of twice the size; real and imaginary parts take turns.
[[nodiscard]] SparseMatrix real_form(const SparseMatrix& a, const SparseMatrix& skew);

}  // namespace tessera
