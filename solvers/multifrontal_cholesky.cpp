#include "solvers/multifrontal_cholesky.h"

#include <algorithm>
#include <cassert>

#include "solvers/dense_front.h"
#include "solvers/front_sweeps.h"

namespace tessera {
namespace {

// A pivot this small beside the diagonal it came from is what rounding leaves of zero.
constexpr double kMinFrontPivot = 1e-14;

}  // namespace

MultifrontalCholesky::MultifrontalCholesky(const SparseMatrix& a, Ordering ordering) : tree_(a, ordering) {}

std::uint64_t MultifrontalCholesky::factor_bytes() const {
  const std::size_t largest = tree_.largest();
  return sizeof(double) * (tree_.stack_of_triangles() + largest * largest + largest) +
         eliminate_bytes(largest) + sizeof(std::int32_t) * tree_.unknowns();
}

std::uint64_t MultifrontalCholesky::solve_bytes(int width) const {
  return sizeof(double) * tree_.largest_columns() + sweep_bytes(tree_, width);
}

/// The entries of the matrix in the columns that the front eliminates. \param slot  of each row of the front in it
void MultifrontalCholesky::assemble(const SparseMatrix& a, std::size_t front, std::span<double> value,
                                    std::vector<std::int32_t>& slot) const {
  const std::span<const std::int32_t> rows = tree_.rows(front);
  for (std::size_t i = 0; i < rows.size(); ++i)
    slot[static_cast<std::size_t>(rows[i])] = static_cast<std::int32_t>(i);
  for (std::size_t j = 0; j < tree_.eliminated(front); ++j) {
    const auto unknown = static_cast<std::size_t>(tree_.unknown(rows[j]));
    double* column = value.data() + j * rows.size();
    for (std::int32_t e = a.start[unknown]; e < a.start[unknown + 1]; ++e) {
      const std::int32_t row = tree_.slot(a.column[static_cast<std::size_t>(e)]);
      if (row >= rows[j]) column[slot[static_cast<std::size_t>(row)]] = a.value[static_cast<std::size_t>(e)];
    }
  }
}

/// What a child leaves: a lower triangle by columns.
void MultifrontalCholesky::add_contribution(std::size_t child, std::span<const double> contribution,
                                            std::span<double> value, std::size_t size,
                                            const std::vector<std::int32_t>& slot) const {
  const auto rows = tree_.rows(child).subspan(tree_.eliminated(child));
  const double* from = contribution.data();
  for (std::size_t j = 0; j < rows.size(); ++j) {
    double* column = value.data() + static_cast<std::size_t>(slot[static_cast<std::size_t>(rows[j])]) * size;
    for (std::size_t i = j; i < rows.size(); ++i) column[slot[static_cast<std::size_t>(rows[i])]] += *from++;
  }
}

std::int64_t MultifrontalCholesky::factor(const SparseMatrix& a, FactorStore& store) const {
  assert(store.size() == 0 && a.rows == static_cast<std::int32_t>(tree_.unknowns()));
  std::vector<double> value(tree_.largest() * tree_.largest()), packed, smallest;
  store.reserve(entries());
  ContributionStack contributions(tree_.stack_of_triangles());
  std::vector<std::int32_t> slot(tree_.unknowns());
  for (std::size_t k = 0; k < tree_.count(); ++k) {
    const std::size_t size = tree_.size(k), eliminated = tree_.eliminated(k);
    DenseFront front{std::span(value).first(size * size), size, eliminated};
    std::fill(front.value.begin(), front.value.end(), 0.0);
    assemble(a, k, front.value, slot);
    smallest.clear();
    for (std::size_t j = 0; j < eliminated; ++j) smallest.push_back(kMinFrontPivot * front.column(j)[j]);
    contributions.take(tree_.children(k), [&](std::size_t child, std::span<const double> left) {
      add_contribution(child, left, front.value, size, slot);
    });
    if (const std::ptrdiff_t bad = eliminate(front, smallest, packed); bad >= 0)
      return tree_.unknown(tree_.rows(k)[static_cast<std::size_t>(bad)]);
    for (std::size_t j = 0; j < eliminated; ++j) store.append({front.column(j) + j, size - j});
    if (tree_.contribution(k) == 0) continue;
    contributions.push(k);
    for (std::size_t j = eliminated; j < size; ++j)
      contributions.append(front.column(j) + j, front.column(j) + size);
  }
  return -1;
}

void MultifrontalCholesky::solve(FactorStore& store, std::span<double> b, int width) const {
  assert(store.size() == entries());
  std::vector<double> buffer(tree_.largest_columns());
  const auto columns = [&](std::size_t k) {
    const std::uint64_t first = tree_.first(k);
    return FrontColumns{store.read(first, std::span(buffer).first(tree_.first(k + 1) - first)), tree_.size(k),
                        tree_.eliminated(k)};
  };
  sweep_fronts(
      tree_, b, width, [&](std::size_t k, std::span<double> x, int w) { solve_forward(columns(k), x, w); },
      [&](std::size_t k, std::span<double> x, int w) { solve_backward(columns(k), x, w); });
}

}  // namespace tessera
