#include "tests/helpers/cholmod_solver.h"

#include <algorithm>
#include <cassert>
#include <cmath>
#include <string>
#include <vector>

#include "solvers/rcm_ordering.h"
#include "tests/helpers/cholmod_view.h"
#include "tests/helpers/single_thread.h"

namespace tessera::test {
namespace {

// Above this much work nested dissection pays for its time within two factorizations (tools/bench solvers).
constexpr double kDissectFlops = 2e11;
constexpr std::int32_t kMinDissected = 1000;
// A pivot this small beside the diagonal it came from is what rounding leaves of zero.
constexpr double kSmallestPivot = 1e-14;

std::string mebibytes(double bytes) {
  return std::to_string(static_cast<std::uint64_t>(bytes / 1048576.0) + 1) + " MiB";
}

class CholmodSolver final : public LinearSolver {
 public:
  explicit CholmodSolver(const SolverOptions& options) : options_(options) {
    cholmod_start(&common_);
    common_.print = 0;
    common_.supernodal = CHOLMOD_SUPERNODAL;
    common_.nmethods = 1;
    common_.postorder = 1;
  }
  ~CholmodSolver() override {
    release();
    cholmod_finish(&common_);
  }

  FactorReport analyse(const SparseMatrix& a) override {
    const SingleThread single;
    assert(a.rows == a.columns);
    if (options_.ordering != Ordering::kAuto) return analyse(a, options_.ordering);
    // Minimum degree takes a fifth of the time. Where the factor is large or does not fit, dissection pays.
    FactorReport report = analyse(a, Ordering::kMinimumDegree);
    if (a.rows < kMinDissected || (report.status == SolveStatus::kSolved && report.flops < kDissectFlops))
      return report;
    return analyse(a, Ordering::kNestedDissection);
  }

  FactorReport factor(const SparseMatrix& a) override {
    const SingleThread single;
    assert(factor_ != nullptr && a.rows == static_cast<std::int32_t>(factor_->n));
    FactorReport report;
    matrix_ = &a;
    ready_ = false;
    if (!all_finite(a.value)) {
      report.status = SolveStatus::kNotFinite;
      report.message = "the matrix holds a value that is not finite";
      return report;
    }
    cholmod_sparse view = cholmod_view(a);
    cholmod_factorize(&view, factor_, &common_);
    if (common_.status < CHOLMOD_OK) return failed(a.rows);
    report.factor_entries = static_cast<std::uint64_t>(common_.lnz);
    report.flops = common_.fl;
    report.bytes = common_.memory_inuse;
    report.peak_bytes = common_.memory_usage;
    const std::int64_t bad = common_.status == CHOLMOD_NOT_POSDEF ? static_cast<std::int64_t>(factor_->minor)
                                                                  : first_vanishing_pivot(a);
    if (bad >= 0) {
      const auto* permutation = static_cast<const int*>(factor_->Perm);
      set_singular(report, permutation[std::min<std::int64_t>(bad, a.rows - 1)]);
      return report;
    }
    ready_ = true;
    return report;
  }

  SolveReport solve(std::span<const double> b, std::span<double> x, int width) override {
    const SingleThread single;
    assert(ready_ && b.size() == x.size() && b.size() == factor_->n * static_cast<std::size_t>(width));
    SolveReport report;
    if (!all_finite(b)) {
      report.status = SolveStatus::kNotFinite;
      report.message = "the right-hand side holds a value that is not finite";
      return report;
    }
    const std::size_t n = factor_->n;
    const auto w = static_cast<std::size_t>(width);
    columns_.resize(b.size());
    for (std::size_t c = 0; c < w; ++c)
      for (std::size_t i = 0; i < n; ++i) columns_[c * n + i] = b[i * w + c];
    cholmod_dense right{};
    right.nrow = right.d = n;
    right.ncol = w;
    right.nzmax = columns_.size();
    right.x = columns_.data();
    right.xtype = CHOLMOD_REAL;
    right.dtype = CHOLMOD_DOUBLE;
    if (!cholmod_solve2(CHOLMOD_A, factor_, &right, nullptr, &solution_, nullptr, &work_, &work2_,
                        &common_)) {
      report.status = SolveStatus::kTooLarge;
      report.message = "out of memory while solving with a Cholesky factor";
      return report;
    }
    const auto* s = static_cast<const double*>(solution_->x);
    for (std::size_t c = 0; c < w; ++c)
      for (std::size_t i = 0; i < n; ++i) x[i * w + c] = s[c * n + i];
    report.residual = relative_residual(*matrix_, x, b, width);
    return report;
  }

 private:
  FactorReport analyse(const SparseMatrix& a, Ordering ordering) {
    release();
    std::vector<std::int32_t> given;
    switch (ordering) {
      case Ordering::kReverseCuthillMcKee:
        common_.method[0].ordering = CHOLMOD_GIVEN;
        given = reverse_cuthill_mckee(a);
        break;
      case Ordering::kNatural:
        common_.method[0].ordering = CHOLMOD_NATURAL;
        break;
      case Ordering::kNestedDissection:
        common_.method[0].ordering = CHOLMOD_METIS;
        break;
      default:
        common_.method[0].ordering = CHOLMOD_AMD;
    }
    // A postorder would undo an ordering that is meant to keep a band.
    common_.postorder = ordering == Ordering::kMinimumDegree || ordering == Ordering::kNestedDissection;
    cholmod_sparse view = cholmod_view(a);
    factor_ = given.empty() ? cholmod_analyze(&view, &common_)
                            : cholmod_analyze_p(&view, given.data(), nullptr, 0, &common_);
    FactorReport report;
    if (factor_ == nullptr) return failed(a.rows);
    report.factor_entries = static_cast<std::uint64_t>(common_.lnz);
    report.flops = common_.fl;
    report.bytes = common_.memory_inuse;
    // The numeric factor, its map, the workspace of the largest front and two permuted copies of a triangle.
    const double n = a.rows;
    const double factoring = 8.0 * static_cast<double>(factor_->xsize + factor_->maxcsize) +
                             4.0 * (static_cast<double>(factor_->maxesize) + 4.0 * n) +
                             12.0 * static_cast<double>(a.entries());
    const double predicted = static_cast<double>(common_.memory_inuse) + factoring;
    report.peak_bytes =
        std::max(static_cast<std::uint64_t>(predicted), static_cast<std::uint64_t>(common_.memory_usage));
    if (options_.memory_bytes > 0 && predicted > static_cast<double>(options_.memory_bytes)) {
      report.status = SolveStatus::kTooLarge;
      report.message = "the Cholesky factor of " + std::to_string(a.rows) + " unknowns needs " +
                       mebibytes(predicted) + ", allowed are " +
                       mebibytes(static_cast<double>(options_.memory_bytes)) +
                       ": use multigrid or a larger memory cap";
      release();
    }
    return report;
  }

  FactorReport failed(std::int32_t unknowns) {
    FactorReport report;
    report.status = SolveStatus::kTooLarge;
    report.message =
        "no Cholesky factor of " + std::to_string(unknowns) + " unknowns: " +
        (common_.status == CHOLMOD_TOO_LARGE ? "it has more than 2^31 entries" : "out of memory") +
        "; use multigrid";
    report.peak_bytes = common_.memory_usage;
    release();
    return report;
  }

  /// Column of the factor whose squared diagonal is nothing beside the diagonal of the matrix; -1 without.
  std::int64_t first_vanishing_pivot(const SparseMatrix& a) const {
    const auto* permutation = static_cast<const int*>(factor_->Perm);
    const auto* x = static_cast<const double*>(factor_->x);
    std::vector<double> diagonal(static_cast<std::size_t>(a.rows));
    for (std::int32_t i = 0; i < a.rows; ++i) diagonal[i] = entry(a, i, i);
    const auto vanishes = [&](std::int64_t column, double pivot) {
      return !(pivot * pivot > kSmallestPivot * diagonal[permutation[column]]);
    };
    if (!factor_->is_super) {
      const auto* p = static_cast<const int*>(factor_->p);
      for (std::size_t j = 0; j < factor_->n; ++j)
        if (vanishes(static_cast<std::int64_t>(j), x[p[j]])) return static_cast<std::int64_t>(j);
      return -1;
    }
    const auto* super = static_cast<const int*>(factor_->super);
    const auto* pi = static_cast<const int*>(factor_->pi);
    const auto* px = static_cast<const int*>(factor_->px);
    for (std::size_t s = 0; s < factor_->nsuper; ++s) {
      const std::int64_t rows = pi[s + 1] - pi[s];
      for (std::int64_t j = super[s]; j < super[s + 1]; ++j)
        if (vanishes(j, x[px[s] + (j - super[s]) * (rows + 1)])) return j;
    }
    return -1;
  }

  void release() {
    cholmod_free_factor(&factor_, &common_);
    cholmod_free_dense(&solution_, &common_);
    cholmod_free_dense(&work_, &common_);
    cholmod_free_dense(&work2_, &common_);
    ready_ = false;
  }

  SolverOptions options_;
  cholmod_common common_;
  cholmod_factor* factor_ = nullptr;
  cholmod_dense *solution_ = nullptr, *work_ = nullptr, *work2_ = nullptr;
  const SparseMatrix* matrix_ = nullptr;
  std::vector<double> columns_;
  bool ready_ = false;
};

}  // namespace

std::unique_ptr<LinearSolver> make_cholmod_solver(const SolverOptions& options) {
  return std::make_unique<CholmodSolver>(options);
}

}  // namespace tessera::test
