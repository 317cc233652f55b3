#include "solvers/multifrontal_solver.h"

#include <algorithm>
#include <cassert>
#include <optional>
#include <string>
#include <vector>

#include "octree/error.h"
#include "solvers/multifrontal_cholesky.h"
#include "solvers/multifrontal_lu.h"

namespace tessera {
namespace {

constexpr int kForecastColumns = 3;  // that the prediction of memory is for
// Above this much work nested dissection pays for its time within two factorizations (tools/bench solvers).
constexpr double kMinDissectFlops = 2e11;
constexpr std::int32_t kMinDissectedRows = 1000;

std::string in_mebibytes(std::uint64_t bytes) {
  return std::to_string((bytes >> 20) + 1) + " MiB";
}

template <class Factor>
class MultifrontalSolver final : public LinearSolver {
 public:
  /// \param store  null: in memory, within the limit, and every factor() anew
  MultifrontalSolver(const SolverOptions& options, FactorStore* store) : options_(options), store_(store) {}

  FactorReport analyse(const SparseMatrix& a) override {
    assert(a.rows == a.columns);
    if (options_.ordering == Ordering::kNestedDissection) return analyse(a, Ordering::kNestedDissection);
    FactorReport report = analyse(a, Ordering::kMinimumDegree);
    if (options_.ordering != Ordering::kAuto || a.rows < kMinDissectedRows ||
        (report.status == SolveStatus::kSolved && report.flops < kMinDissectFlops))
      return report;
    return analyse(a, Ordering::kNestedDissection);
  }

  FactorReport factor(const SparseMatrix& a) override {
    FactorReport report;
    matrix_ = &a;
    if (!all_finite(a.value)) {
      report.status = SolveStatus::kNotFinite;
      report.message = "the matrix holds a value that is not finite";
      return report;
    }
    if (store_ == nullptr) memory_ = {};
    if (store().size() != factor_->entries())
      if (const std::int64_t bad = factor_->factor(a, store()); bad >= 0)
        set_singular(report, static_cast<std::int32_t>(bad));
    report.factor_entries = factor_->entries();
    report.flops = factor_->flops();
    report.bytes = own_bytes();
    report.peak_bytes = peak();
    return report;
  }

  SolveReport solve(std::span<const double> b, std::span<double> x, int width) override {
    assert(matrix_ != nullptr && b.size() == x.size());
    SolveReport report;
    std::copy(b.begin(), b.end(), x.begin());
    factor_->solve(store(), x, width);
    report.residual = relative_residual(*matrix_, x, b, width);
    if (!(report.residual <= options_.tolerance)) refine(b, x, width, report);
    return report;
  }

 private:
  FactorStore& store() { return store_ != nullptr ? *store_ : memory_; }
  std::uint64_t own_bytes() const {
    return factor_->bytes() + (store_ != nullptr ? 0 : sizeof(double) * factor_->entries());
  }
  std::uint64_t peak() const {
    return own_bytes() + std::max(factor_->factor_bytes(), factor_->solve_bytes(kForecastColumns));
  }

  FactorReport analyse(const SparseMatrix& a, Ordering ordering) {
    FactorReport report;
    try {
      factor_.emplace(a, ordering);
    } catch (const ResourceError& e) {
      report.status = SolveStatus::kTooLarge;
      report.message = e.what();
      return report;
    }
    report.factor_entries = factor_->entries();
    report.flops = factor_->flops();
    report.bytes = factor_->bytes();
    report.peak_bytes = peak();
    if (options_.memory_bytes > 0 && report.peak_bytes > options_.memory_bytes) {
      report.status = SolveStatus::kTooLarge;
      report.message = "the fronts of " + std::to_string(a.rows) + " unknowns need " +
                       in_mebibytes(report.peak_bytes) + ", allowed are " +
                       in_mebibytes(options_.memory_bytes) + ": allow more memory";
    }
    return report;
  }

  void refine(std::span<const double> b, std::span<double> x, int width, SolveReport& report) {
    std::vector<double> residual(b.size());
    multiply(*matrix_, x, residual, width);
    for (std::size_t i = 0; i < residual.size(); ++i) residual[i] = b[i] - residual[i];
    factor_->solve(store(), residual, width);
    for (std::size_t i = 0; i < residual.size(); ++i) x[i] += residual[i];
    report.residual = relative_residual(*matrix_, x, b, width);
    if (report.residual <= options_.tolerance) return;
    report.status = all_finite(b) ? SolveStatus::kNotConverged : SolveStatus::kNotFinite;
    report.message = report.status == SolveStatus::kNotFinite
                         ? "the right-hand side holds a value that is not finite"
                         : "a factor and a refinement did not reach the tolerance";
  }

  SolverOptions options_;
  FactorStore* store_;
  MemoryFactorStore memory_;
  std::optional<Factor> factor_;
  const SparseMatrix* matrix_ = nullptr;
};

}  // namespace

std::unique_ptr<LinearSolver> make_multifrontal_solver(const SolverOptions& options, FactorStore& store) {
  return std::make_unique<MultifrontalSolver<MultifrontalCholesky>>(options, &store);
}

std::unique_ptr<LinearSolver> make_lu_solver(const SolverOptions& options, FactorStore& store) {
  return std::make_unique<MultifrontalSolver<MultifrontalLu>>(options, &store);
}

std::unique_ptr<LinearSolver> make_fronts_solver(const SolverOptions& options) {
  return std::make_unique<MultifrontalSolver<MultifrontalCholesky>>(options, nullptr);
}

std::unique_ptr<LinearSolver> make_lu_solver(const SolverOptions& options) {
  return std::make_unique<MultifrontalSolver<MultifrontalLu>>(options, nullptr);
}

}  // namespace tessera
