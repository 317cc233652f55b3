#include "solvers/hermitian_multigrid.h"

#include <algorithm>
#include <cassert>
#include <cmath>
#include <string>
#include <utility>

#include "solvers/conjugate_gradients.h"
#include "solvers/multigrid_cycle.h"

namespace tessera {
namespace {

using Vector = std::vector<double>;

// Entries of the coarsest factor. Levels of one piece shrink to a thousand unknowns, far below this.
constexpr std::uint64_t kMaxEnvelope = std::uint64_t{1} << 24;
// Smooth interpolation has five times the entries. Where a mesh is stretched levels shrink by 3 instead of 8: then it
// would cost too much, and linear converges as well.
constexpr double kSmoothShare = 1.0 / 5.0;

/// v = (matrix + i skew) u
void multiply_hermitian(const MultigridLevel& level, std::span<const double> u, std::span<double> v) {
  multiply(*level.matrix, u, v, 2);
  const SparseMatrix& k = *level.skew;
  for (std::int32_t i = 0; i < k.rows; ++i)
    for (std::int32_t e = k.start[i]; e < k.start[i + 1]; ++e) {
      const std::size_t to = static_cast<std::size_t>(i) * 2,
                        from = static_cast<std::size_t>(k.column[e]) * 2;
      v[to] -= k.value[e] * u[from + 1];
      v[to + 1] += k.value[e] * u[from];
    }
}

}  // namespace

HermitianMultigrid::HermitianMultigrid(const SparseMatrix& a, const SparseMatrix& skew,
                                       std::span<const Double3> positions) {
  assert(a.rows == a.columns && skew.rows == a.rows && skew.columns == a.rows);
  if (!all_finite(a.value) || !all_finite(skew.value)) {
    report_.status = SolveStatus::kNotFinite;
    report_.message = "the matrix holds a value that is not finite";
    return;
  }
  for (std::int32_t i = 0; i < a.rows; ++i)
    if (!(entry(a, i, i) > 0.0)) {
      report_.status = SolveStatus::kSingular;
      report_.message = "the diagonal of unknown " + std::to_string(i) + " is not positive";
      return;
    }
  levels_ = multigrid_levels(a, {.smooth_share = kSmoothShare, .positions = positions, .skew = &skew});
  for (const MultigridLevel& level : levels_.levels) {
    x_.emplace_back(static_cast<std::size_t>(level.matrix->rows) * 2);
    b_.emplace_back(static_cast<std::size_t>(level.matrix->rows) * 2);
  }
  report_.factor_entries = levels_.entries();
  report_.bytes = levels_.bytes();
  factor_coarsest();
  report_.peak_bytes = report_.bytes;
}

void HermitianMultigrid::factor_coarsest() {
  const SparseMatrix real = real_form(*levels_.levels.back().matrix, *levels_.levels.back().skew);
  coarsest_.emplace(real);
  if (coarsest_->envelope() > kMaxEnvelope) {
    report_.status = SolveStatus::kTooLarge;
    report_.message = "the levels of multigrid stop at " + std::to_string(real.rows / 2) + " unknowns";
    return;
  }
  report_.factor_entries += coarsest_->envelope();
  report_.bytes += 8 * coarsest_->envelope();
  if (coarsest_->factor(real)) return;
  report_.status = SolveStatus::kSingular;
  report_.message = "the coarsest level is singular: a piece without a fixed vertex, or faces without area";
}

/// x_[k] = about (A + iK)^-1 b_[k]; Hermitian and positive definite as a function of b_[k].
void HermitianMultigrid::cycle(std::size_t k) {
  if (k + 1 == levels_.levels.size()) {
    x_[k] = b_[k];
    coarsest_->solve(x_[k]);
    return;
  }
  const MultigridLevel& level = levels_.levels[k];
  relax_from_zero<2, true>(level, b_[k].data(), x_[k].data());
  restrict_residual<2, true>(level, b_[k].data(), x_[k].data(), b_[k + 1], true);
  cycle(k + 1);
  if (k > 0 && k + 2 < levels_.levels.size()) {
    const Vector first = x_[k + 1];
    multiply_hermitian(levels_.levels[k + 1], first, x_[k + 1]);
    for (std::size_t i = 0; i < first.size(); ++i) b_[k + 1][i] -= x_[k + 1][i];
    cycle(k + 1);
    for (std::size_t i = 0; i < first.size(); ++i) x_[k + 1][i] += first[i];
  }
  add_prolonged<2>(level, x_[k + 1], x_[k].data());
  relax<2, true>(level, b_[k].data(), x_[k].data(), false);
}

SolveReport HermitianMultigrid::solve(std::span<const double> b, std::span<double> z, double tolerance,
                                      int max_iterations) {
  SolveReport report;
  if (!all_finite(b)) {
    report.status = SolveStatus::kNotFinite;
    report.message = "the right-hand side holds a value that is not finite";
    return report;
  }
  const MultigridLevel& finest = levels_.levels.front();
  Vector& r = b_[0];
  assert(b.size() == r.size() && z.size() == r.size());
  const Columns<1> norm = {std::sqrt(dots<1>(b, b)[0])};
  const auto residual = [&] {
    multiply_hermitian(finest, z, r);
    for (std::size_t i = 0; i < r.size(); ++i) r[i] = b[i] - r[i];
    return norm[0] > 0.0 ? std::sqrt(dots<1>(r, r)[0]) / norm[0] : 0.0;
  };
  residual();
  Vector p;
  const ConjugateGradientsResult result =
      conjugate_gradients<1>([&](const Vector& u, Vector& v) { multiply_hermitian(finest, u, v); }, r, z,
                             x_[0], p, norm, tolerance, max_iterations, [this] { cycle(0); });
  report.iterations = result.iterations;
  report.residual = residual();
  if (result.breakdown) {
    report.status = SolveStatus::kSingular;
    report.message = "multigrid broke down after " + std::to_string(result.iterations) +
                     " cycles: the matrix is not positive definite";
  } else if (!result.converged || !(report.residual <= kResidualDrift * tolerance)) {
    report.status = SolveStatus::kNotConverged;
    report.message = "multigrid reached a relative residual of " + std::to_string(report.residual) + " in " +
                     std::to_string(result.iterations) + " cycles";
  }
  return report;
}

}  // namespace tessera
