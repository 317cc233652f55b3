#include "solvers/envelope_cholesky.h"

#include <algorithm>
#include <cassert>
#include <cmath>

#include "solvers/rcm_ordering.h"

namespace tessera {
EnvelopeCholesky::EnvelopeCholesky(const SparseMatrix& a) {
  const auto n = static_cast<std::uint32_t>(a.rows);
  const std::vector<std::int32_t> order = reverse_cuthill_mckee(a);
  slot_.resize(n);
  for (std::uint32_t i = 0; i < n; ++i) slot_[static_cast<std::size_t>(order[i])] = i;
  start_.resize(n);
  for (std::uint32_t i = 0; i < n; ++i) start_[i] = i;
  for_lower(a, [&](std::uint32_t row, std::uint32_t column, double) {
    start_[row] = std::min(start_[row], column);
  });
  first_.assign(n + std::size_t{1}, 0);
  for (std::uint32_t i = 0; i < n; ++i) first_[i + 1] = first_[i] + (i - start_[i] + 1);
}

template <class Sink>
void EnvelopeCholesky::for_lower(const SparseMatrix& a, const Sink& sink) const {
  for (std::size_t r = 0; r < slot_.size(); ++r)
    for (std::int32_t k = a.start[r]; k < a.start[r + 1]; ++k) {
      const auto at = static_cast<std::size_t>(k);
      const std::uint32_t i = slot_[r], j = slot_[static_cast<std::size_t>(a.column[at])];
      if (j <= i) sink(i, j, a.value[at]);
    }
}

bool EnvelopeCholesky::factor(const SparseMatrix& a) {
  entry_.assign(first_.back(), 0.0);
  for_lower(a, [&](std::uint32_t row, std::uint32_t column, double value) {
    entry_[first_[row] + column - start_[row]] = value;
  });
  const auto n = static_cast<std::uint32_t>(start_.size());
  for (std::uint32_t i = 0; i < n; ++i) {
    double* row = entry_.data() + first_[i];
    for (std::uint32_t j = start_[i]; j < i; ++j) {
      const double* other = entry_.data() + first_[j];
      const std::uint32_t from = std::max(start_[i], start_[j]);
      double sum = row[j - start_[i]];
      for (std::uint32_t k = from; k < j; ++k) sum -= row[k - start_[i]] * other[k - start_[j]];
      row[j - start_[i]] = sum / other[j - start_[j]];
    }
    double& diagonal = row[i - start_[i]];
    const double whole = diagonal;
    for (std::uint32_t k = start_[i]; k < i; ++k) diagonal -= row[k - start_[i]] * row[k - start_[i]];
    if (!(diagonal > 1e-14 * whole)) return false;
    diagonal = std::sqrt(diagonal);
  }
  return true;
}

void EnvelopeCholesky::solve(std::span<double> b) const {
  const std::size_t n = start_.size();
  assert(b.size() == n);
  std::vector<double> x(n);
  for (std::size_t i = 0; i < n; ++i) x[slot_[i]] = b[i];
  for (std::size_t i = 0; i < n; ++i) {
    const double* row = entry_.data() + first_[i];
    for (std::size_t k = start_[i]; k < i; ++k) x[i] -= row[k - start_[i]] * x[k];
    x[i] /= row[i - start_[i]];
  }
  for (std::size_t i = n; i-- > 0;) {
    const double* row = entry_.data() + first_[i];
    x[i] /= row[i - start_[i]];
    for (std::size_t k = start_[i]; k < i; ++k) x[k] -= row[k - start_[i]] * x[i];
  }
  for (std::size_t i = 0; i < n; ++i) b[i] = x[slot_[i]];
}

}  // namespace tessera
