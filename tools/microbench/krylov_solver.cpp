#include "tools/microbench/krylov_solver.h"

#include <Eigen/Core>
#include <Eigen/IterativeLinearSolvers>
#include <Eigen/SparseCore>
#include <algorithm>
#include <cassert>
#include <cmath>
#include <string>
#include <vector>

#include "solvers/conjugate_gradients.h"

namespace tessera {
namespace {

using Rows = Eigen::Map<const Eigen::SparseMatrix<double, Eigen::RowMajor, std::int32_t>>;

Rows view_of(const SparseMatrix& a) {
  return {a.rows,         a.columns,       static_cast<Eigen::Index>(a.entries()),
          a.start.data(), a.column.data(), a.value.data()};
}

template <class Report>
bool not_finite(std::span<const double> values, const char* what, Report& report) {
  if (all_finite(values)) return false;
  report.status = SolveStatus::kNotFinite;
  report.message = std::string(what) + " holds a value that is not finite";
  return true;
}

/// The rule for what an iterative solver gives back.
void judge(bool converged, bool breakdown, double tolerance, const char* method, SolveReport& report) {
  if (converged && report.residual <= kResidualDrift * tolerance) return;
  report.status = breakdown ? SolveStatus::kSingular : SolveStatus::kNotConverged;
  report.message = std::string(method) + (breakdown ? " broke down" : " did not converge") + " in " +
                   std::to_string(report.iterations) + " iterations (relative residual " +
                   std::to_string(report.residual) + ")";
}

/// The prediction before anything is allocated.
FactorReport predicted(std::uint64_t bytes, std::uint64_t cap, const char* method, std::int32_t unknowns) {
  FactorReport report;
  report.peak_bytes = bytes;
  if (cap > 0 && bytes > cap) {
    report.status = SolveStatus::kTooLarge;
    report.message = std::string(method) + " on " + std::to_string(unknowns) + " unknowns may need " +
                     std::to_string(bytes >> 20) + " MiB: use a larger memory cap";
  }
  return report;
}

class ConjugateGradientsSolver final : public LinearSolver {
 public:
  explicit ConjugateGradientsSolver(const SolverOptions& options) : options_(options) {}

  FactorReport analyse(const SparseMatrix& a) override {
    assert(a.rows == a.columns);
    // The preconditioner holds a triangle; three columns of r, z and p.
    return predicted(a.entries() / 2 * 24 + static_cast<std::uint64_t>(a.rows) * 120, options_.memory_bytes,
                     "the conjugate gradient method", a.rows);
  }

  FactorReport factor(const SparseMatrix& a) override {
    FactorReport report;
    matrix_ = &a;
    if (not_finite(a.value, "the matrix", report)) return report;
    const Eigen::SparseMatrix<double> lower = view_of(a).triangularView<Eigen::Lower>();
    incomplete_.compute(lower);
    if (incomplete_.info() != Eigen::Success) {
      report.status = SolveStatus::kSingular;
      report.message = "no incomplete Cholesky factor: the matrix is not positive definite";
      return report;
    }
    report.factor_entries = static_cast<std::uint64_t>(incomplete_.matrixL().nonZeros());
    report.bytes = report.factor_entries * 12 + static_cast<std::uint64_t>(a.rows) * 16;
    report.peak_bytes = report.bytes;
    return report;
  }

  SolveReport solve(std::span<const double> b, std::span<double> x, int width) override {
    SolveReport report;
    if (not_finite(b, "the right-hand side", report)) return report;
    const auto w = static_cast<std::size_t>(width);
    const std::size_t n = b.size() / w;
    std::vector<double> r(n), z(n), p, xc(n);
    bool converged = true, breakdown = false;
    for (std::size_t c = 0; c < w; ++c) {
      for (std::size_t i = 0; i < n; ++i) r[i] = b[i * w + c];
      std::fill(xc.begin(), xc.end(), 0.0);
      const Columns<1> norm = {std::sqrt(dots<1>(r, r)[0])};
      const auto size = static_cast<Eigen::Index>(n);
      const ConjugateGradientsResult result =
          conjugate_gradients<1>([this](const auto& u, auto& v) { multiply(*matrix_, u, v); }, r, xc, z, p,
                                 norm, options_.tolerance, options_.max_iterations,
                                 [&] {
                                   Eigen::Map<Eigen::VectorXd>(z.data(), size) =
                                       incomplete_.solve(Eigen::Map<const Eigen::VectorXd>(r.data(), size));
                                 });
      for (std::size_t i = 0; i < n; ++i) x[i * w + c] = xc[i];
      report.iterations = std::max(report.iterations, result.iterations);
      converged = converged && result.converged;
      breakdown = breakdown || result.breakdown;
    }
    report.residual = relative_residual(*matrix_, x, b, width);
    judge(converged, breakdown, options_.tolerance, "the conjugate gradient method", report);
    return report;
  }

 private:
  SolverOptions options_;
  const SparseMatrix* matrix_ = nullptr;
  Eigen::IncompleteCholesky<double, Eigen::Lower, Eigen::AMDOrdering<std::int32_t>> incomplete_;
};

}  // namespace

std::unique_ptr<LinearSolver> make_conjugate_gradients_solver(const SolverOptions& options) {
  return std::make_unique<ConjugateGradientsSolver>(options);
}

}  // namespace tessera
