#include "solvers/multifrontal_solver.h"

#include <algorithm>
#include <cassert>
#include <optional>
#include <string>
#include <vector>

#include "octree/error.h"
#include "solvers/multifrontal_cholesky.h"

namespace tessera {
namespace {

constexpr int kMostColumns = 3;  // that the prediction of memory is for

class MultifrontalSolver final : public LinearSolver {
 public:
  MultifrontalSolver(const SolverOptions& options, FactorStore& store) : options_(options), store_(store) {}

  FactorReport analyse(const SparseMatrix& a) override {
    FactorReport report;
    try {
      factor_.emplace(a);
    } catch (const ResourceError& e) {
      report.status = SolveStatus::kTooLarge;
      report.message = e.what();
      return report;
    }
    report.factor_entries = factor_->entries();
    report.flops = factor_->flops();
    report.bytes = factor_->bytes();
    report.peak_bytes =
        factor_->bytes() + std::max(factor_->factor_bytes(), factor_->solve_bytes(kMostColumns));
    if (options_.memory_bytes > 0 && report.peak_bytes > options_.memory_bytes) {
      report.status = SolveStatus::kTooLarge;
      report.message = "the fronts of " + std::to_string(a.rows) + " unknowns need " +
                       std::to_string((report.peak_bytes >> 20) + 1) + " MiB, allowed are " +
                       std::to_string(options_.memory_bytes >> 20) + " MiB";
    }
    return report;
  }

  FactorReport factor(const SparseMatrix& a) override {
    FactorReport report;
    matrix_ = &a;
    if (store_.size() == factor_->entries()) return report;
    const std::int64_t bad = factor_->factor(a, store_);
    if (bad >= 0) set_singular(report, static_cast<std::int32_t>(bad));
    return report;
  }

  SolveReport solve(std::span<const double> b, std::span<double> x, int width) override {
    assert(matrix_ != nullptr && b.size() == x.size());
    SolveReport report;
    std::copy(b.begin(), b.end(), x.begin());
    factor_->solve(store_, x, width);
    report.residual = relative_residual(*matrix_, x, b, width);
    if (!(report.residual <= options_.tolerance)) refine(b, x, width, report);
    return report;
  }

 private:
  void refine(std::span<const double> b, std::span<double> x, int width, SolveReport& report) {
    std::vector<double> rest(b.size());
    multiply(*matrix_, x, rest, width);
    for (std::size_t i = 0; i < rest.size(); ++i) rest[i] = b[i] - rest[i];
    factor_->solve(store_, rest, width);
    for (std::size_t i = 0; i < rest.size(); ++i) x[i] += rest[i];
    report.residual = relative_residual(*matrix_, x, b, width);
    if (report.residual <= options_.tolerance) return;
    report.status = all_finite(b) ? SolveStatus::kNotConverged : SolveStatus::kNotFinite;
    report.message = report.status == SolveStatus::kNotFinite
                         ? "the right-hand side holds a value that is not finite"
                         : "a factor and a refinement did not reach the tolerance";
  }

  SolverOptions options_;
  FactorStore& store_;
  std::optional<MultifrontalCholesky> factor_;
  const SparseMatrix* matrix_ = nullptr;
};

}  // namespace

std::unique_ptr<LinearSolver> make_multifrontal_solver(const SolverOptions& options, FactorStore& store) {
  return std::make_unique<MultifrontalSolver>(options, store);
}

}  // namespace tessera
