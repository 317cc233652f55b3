#include "solvers/multifrontal_lu.h"

#include <algorithm>
#include <cassert>
#include <cmath>
#include <utility>

#include "solvers/dense_front.h"
#include "solvers/front_sweeps.h"

namespace tessera {
namespace {

// A pivot this small beside the diagonal it came from is what rounding leaves of zero.
constexpr double kMinLuPivot = 1e-14;

/// The fronts of whatever is in the matrix or its transpose.
FrontTree fronts_of(const SparseMatrix& a, Ordering ordering) {
  const SparseMatrix transposed = transpose(a);
  if (transposed.start == a.start && transposed.column == a.column) return {a, ordering};
  return {sum(1.0, a, 1.0, transposed), ordering};
}

}  // namespace

MultifrontalLu::MultifrontalLu(const SparseMatrix& a, Ordering ordering)
    : tree_(fronts_of(a, ordering)), transposed_bytes_(a.bytes()) {}

std::uint64_t MultifrontalLu::factor_bytes() const {
  const std::size_t largest = tree_.largest();
  return sizeof(double) * (tree_.stack_of_squares() + largest * largest + largest) +
         eliminate_lu_bytes(largest) + sizeof(std::int32_t) * tree_.unknowns() + transposed_bytes_;
}

std::uint64_t MultifrontalLu::solve_bytes(int width) const {
  return sizeof(double) * tree_.largest_columns() + sweep_bytes(tree_, width);
}

/// The entries of the matrix in the rows and columns that the front eliminates. \param slot  of each row of the front in it
void MultifrontalLu::assemble(const SparseMatrix& a, const SparseMatrix& transposed, std::size_t front,
                              std::span<double> value, std::vector<std::int32_t>& slot) const {
  const std::span<const std::int32_t> rows = tree_.rows(front);
  for (std::size_t i = 0; i < rows.size(); ++i)
    slot[static_cast<std::size_t>(rows[i])] = static_cast<std::int32_t>(i);
  for (std::size_t j = 0; j < tree_.eliminated(front); ++j) {
    const auto unknown = static_cast<std::size_t>(tree_.unknown(rows[j]));
    const auto each_later = [&](const SparseMatrix& m, const auto& use) {
      for (std::int32_t e = m.start[unknown]; e < m.start[unknown + 1]; ++e)
        if (const std::int32_t later = tree_.slot(m.column[static_cast<std::size_t>(e)]); later >= rows[j])
          use(static_cast<std::size_t>(slot[static_cast<std::size_t>(later)]),
              m.value[static_cast<std::size_t>(e)]);
    };
    each_later(a, [&](std::size_t column, double v) { value[column * rows.size() + j] = v; });
    each_later(transposed, [&](std::size_t row, double v) { value[j * rows.size() + row] = v; });
  }
}

/// What a child leaves: a square by columns.
void MultifrontalLu::add_contribution(std::size_t child, std::span<const double> contribution,
                                      std::span<double> value, std::size_t size,
                                      const std::vector<std::int32_t>& slot) const {
  const auto rows = tree_.rows(child).subspan(tree_.eliminated(child));
  const double* from = contribution.data();
  for (const std::int32_t j : rows) {
    double* column = value.data() + static_cast<std::size_t>(slot[static_cast<std::size_t>(j)]) * size;
    for (const std::int32_t i : rows) column[slot[static_cast<std::size_t>(i)]] += *from++;
  }
}

std::int64_t MultifrontalLu::factor(const SparseMatrix& a, FactorStore& store) {
  assert(store.size() == 0 && a.rows == static_cast<std::int32_t>(tree_.unknowns()));
  const SparseMatrix transposed = transpose(a);
  std::vector<double> value(tree_.largest() * tree_.largest()), packed, smallest, row;
  store.reserve(entries());
  ContributionStack contributions(tree_.stack_of_squares());
  swapped_.assign(tree_.unknowns(), 0);
  std::vector<std::int32_t> slot(tree_.unknowns());
  for (std::size_t k = 0; k < tree_.count(); ++k) {
    const std::size_t size = tree_.size(k), eliminated = tree_.eliminated(k),
                      contribution = tree_.contribution(k);
    DenseFront front{std::span(value).first(size * size), size, eliminated};
    std::fill(front.value.begin(), front.value.end(), 0.0);
    assemble(a, transposed, k, front.value, slot);
    smallest.clear();
    for (std::size_t j = 0; j < eliminated; ++j)
      smallest.push_back(kMinLuPivot * std::fabs(front.column(j)[j]));
    contributions.take(tree_.children(k), [&](std::size_t child, std::span<const double> left) {
      add_contribution(child, left, front.value, size, slot);
    });
    const auto first = static_cast<std::size_t>(tree_.rows(k).front());
    if (const std::ptrdiff_t bad =
            eliminate_lu(front, smallest, std::span(swapped_).subspan(first, eliminated), packed);
        bad >= 0)
      return tree_.unknown(tree_.rows(k)[static_cast<std::size_t>(bad)]);
    for (std::size_t j = 0; j < eliminated; ++j) {
      const double one = 1.0;
      store.append({&one, 1});
      store.append({front.column(j) + j + 1, size - j - 1});
    }
    for (std::size_t j = 0; j < eliminated; ++j) {
      row.clear();
      for (std::size_t c = j; c < size; ++c) row.push_back(front.column(c)[j]);
      store.append(row);
    }
    if (contribution == 0) continue;
    contributions.push(k);
    for (std::size_t j = eliminated; j < size; ++j)
      contributions.append(front.column(j) + eliminated, front.column(j) + size);
  }
  return -1;
}

void MultifrontalLu::solve(FactorStore& store, std::span<double> b, int width) const {
  assert(store.size() == entries());
  std::vector<double> buffer(tree_.largest_columns());
  // Of each front the columns of L, then the rows of U.
  const auto columns = [&](std::size_t k, bool upper) {
    const std::uint64_t first = tree_.first(k), count = tree_.first(k + 1) - first;
    return FrontColumns{store.read(2 * first + (upper ? count : 0), std::span(buffer).first(count)),
                        tree_.size(k), tree_.eliminated(k)};
  };
  sweep_fronts(
      tree_, b, width,
      [&](std::size_t k, std::span<double> x, int w) {
        const auto first = static_cast<std::size_t>(tree_.rows(k).front());
        const std::size_t size = tree_.size(k), wide = static_cast<std::size_t>(w);
        const bool by_rows = w >= kWideSolve;
        for (std::size_t j = 0; j < tree_.eliminated(k); ++j)
          if (const auto other = static_cast<std::size_t>(swapped_[first + j]); other != j)
            for (std::size_t c = 0; c < wide; ++c)
              std::swap(by_rows ? x[j * wide + c] : x[c * size + j],
                        by_rows ? x[other * wide + c] : x[c * size + other]);
        solve_forward(columns(k, false), x, w);
      },
      [&](std::size_t k, std::span<double> x, int w) { solve_backward(columns(k, true), x, w); });
}

}  // namespace tessera
