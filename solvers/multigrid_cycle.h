/// \file multigrid_cycle.h
/// The steps of a multigrid cycle on vectors of kWidth interleaved columns: Gauss-Seidel, restriction,
/// prolongation. All run in ascending or descending row order on one thread. With kSkew the two columns are the
/// real and imaginary parts of one complex column, and the matrix of the level is matrix + i skew.
#pragma once
#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "solvers/multigrid_levels.h"

namespace tessera {

template <int kWidth>
using Columns = std::array<double, kWidth>;

/// s -= the entries [from, to) of a, times x
template <int kWidth>
inline void subtract_row(const SparseMatrix& a, std::int32_t from, std::int32_t to, const double* x,
                         Columns<kWidth>& s) {
  for (std::int32_t e = from; e < to; ++e) {
    const double v = a.value[e];
    const double* xj = x + static_cast<std::size_t>(a.column[e]) * kWidth;
    for (int c = 0; c < kWidth; ++c) s[c] -= v * xj[c];
  }
}

/// The part of row i of i skew with columns in [from, to).
template <int kWidth, bool kSkew>
inline void subtract_skew(const MultigridLevel& level, std::int32_t i, std::int32_t from, std::int32_t to,
                          const double* x, Columns<kWidth>& s) {
  if constexpr (kSkew) {
    static_assert(kWidth == 2);
    const SparseMatrix& k = *level.skew;
    for (std::int32_t e = k.start[i]; e < k.start[i + 1]; ++e) {
      if (k.column[e] < from || k.column[e] >= to) continue;
      const double* xj = x + static_cast<std::size_t>(k.column[e]) * 2;
      s[0] += k.value[e] * xj[1];
      s[1] -= k.value[e] * xj[0];
    }
  }
}

template <int kWidth>
[[nodiscard]] inline Columns<kWidth> load(const double* b, std::int32_t i) {
  Columns<kWidth> s;
  for (int c = 0; c < kWidth; ++c) s[c] = b[static_cast<std::size_t>(i) * kWidth + c];
  return s;
}

/// A Gauss-Seidel sweep.
template <int kWidth, bool kSkew = false>
void relax(const MultigridLevel& level, const double* b, double* x, bool forward) {
  const SparseMatrix& a = *level.matrix;
  const std::int32_t step = forward ? 1 : -1, end = forward ? a.rows : -1;
  for (std::int32_t i = forward ? 0 : a.rows - 1; i != end; i += step) {
    Columns<kWidth> s = load<kWidth>(b, i);
    subtract_row<kWidth>(a, a.start[i], a.start[i + 1], x, s);
    subtract_skew<kWidth, kSkew>(level, i, 0, a.rows, x, s);
    // The row holds the diagonal, so this is a correction.
    for (int c = 0; c < kWidth; ++c)
      x[static_cast<std::size_t>(i) * kWidth + c] += level.inverse_diagonal[i] * s[c];
  }
}

/// A forward sweep from x = 0: only the lower triangle counts.
template <int kWidth, bool kSkew = false>
void relax_from_zero(const MultigridLevel& level, const double* b, double* x) {
  const SparseMatrix& a = *level.matrix;
  for (std::int32_t i = 0; i < a.rows; ++i) {
    Columns<kWidth> s = load<kWidth>(b, i);
    std::int32_t to = a.start[i];
    while (to < a.start[i + 1] && a.column[to] < i) ++to;
    subtract_row<kWidth>(a, a.start[i], to, x, s);
    subtract_skew<kWidth, kSkew>(level, i, 0, i, x, s);
    for (int c = 0; c < kWidth; ++c)
      x[static_cast<std::size_t>(i) * kWidth + c] = level.inverse_diagonal[i] * s[c];
  }
}

/// coarse = P^T (b - A x). \param one_sweep  x comes from one sweep from zero: then only the upper triangle counts
template <int kWidth, bool kSkew = false>
void restrict_residual(const MultigridLevel& level, const double* b, const double* x,
                       std::vector<double>& coarse, bool one_sweep) {
  const SparseMatrix& a = *level.matrix;
  const Prolongation& p = level.prolongation;
  coarse.assign(coarse.size(), 0.0);
  for (std::int32_t i = 0; i < a.rows; ++i) {
    Columns<kWidth> s{};
    std::int32_t from = a.start[i];
    if (one_sweep)
      while (from < a.start[i + 1] && a.column[from] <= i) ++from;
    else
      s = load<kWidth>(b, i);
    subtract_row<kWidth>(a, from, a.start[i + 1], x, s);
    subtract_skew<kWidth, kSkew>(level, i, one_sweep ? i : 0, a.rows, x, s);
    for (std::int32_t f = p.start[i]; f < p.start[i + 1]; ++f)
      for (int c = 0; c < kWidth; ++c)
        coarse[static_cast<std::size_t>(p.column[f]) * kWidth + c] += static_cast<double>(p.weight[f]) * s[c];
  }
}

/// coarse = P^T b
template <int kWidth>
void restrict_load(const MultigridLevel& level, const double* b, std::vector<double>& coarse) {
  const Prolongation& p = level.prolongation;
  coarse.assign(coarse.size(), 0.0);
  for (std::int32_t i = 0; i < level.matrix->rows; ++i) {
    const Columns<kWidth> s = load<kWidth>(b, i);
    for (std::int32_t f = p.start[i]; f < p.start[i + 1]; ++f)
      for (int c = 0; c < kWidth; ++c)
        coarse[static_cast<std::size_t>(p.column[f]) * kWidth + c] += static_cast<double>(p.weight[f]) * s[c];
  }
}

/// x += P coarse
template <int kWidth>
void add_prolonged(const MultigridLevel& level, const std::vector<double>& coarse, double* x) {
  const Prolongation& p = level.prolongation;
  for (std::int32_t i = 0; i < level.matrix->rows; ++i) {
    Columns<kWidth> s{};
    for (std::int32_t f = p.start[i]; f < p.start[i + 1]; ++f)
      for (int c = 0; c < kWidth; ++c)
        s[c] += static_cast<double>(p.weight[f]) * coarse[static_cast<std::size_t>(p.column[f]) * kWidth + c];
    for (int c = 0; c < kWidth; ++c) x[static_cast<std::size_t>(i) * kWidth + c] += s[c];
  }
}

/// Dot products of the columns.
template <int kWidth>
[[nodiscard]] Columns<kWidth> dots(std::span<const double> u, std::span<const double> v) {
  Columns<kWidth> s{};
  for (std::size_t i = 0; i < u.size(); i += kWidth)
    for (int c = 0; c < kWidth; ++c) s[c] += u[i + c] * v[i + c];
  return s;
}

}  // namespace tessera
