#include "solvers/lu_solver.h"

#include <umfpack.h>

#include <algorithm>
#include <cassert>
#include <string>
#include <vector>

#include "octree/error.h"
#include "solvers/cholesky_solver.h"
#include "solvers/single_thread.h"

namespace tessera {
namespace {

// Below this reciprocal condition estimate rounding has eaten a pivot.
constexpr double kSmallestCondition = 1e-14;
// Of the peak, for each entry of a Cholesky factor of the same pattern (tools/bench solvers).
constexpr double kBytesPerEntry = 40.0;
// A direct solution that leaves this much was divided by rounding errors.
constexpr double kLargestResidual = 1e-4;

class LuSolver final : public LinearSolver {
 public:
  explicit LuSolver(const SolverOptions& options) : options_(options) {
    umfpack_di_defaults(control_);
    switch (options.ordering) {
      case Ordering::kAuto:
      case Ordering::kMinimumDegree:
        control_[UMFPACK_ORDERING] = UMFPACK_ORDERING_AMD;
        break;
      case Ordering::kNestedDissection:
        control_[UMFPACK_ORDERING] = UMFPACK_ORDERING_METIS;
        break;
      default:
        throw UsageError("LU knows minimum degree and nested dissection, not this ordering");
    }
  }
  ~LuSolver() override { release(); }

  FactorReport analyse(const SparseMatrix& a) override {
    const SingleThread single;
    assert(a.rows == a.columns);
    release();
    FactorReport report;
    // Compressed rows of A are the compressed columns of its transpose, and that is what is factored.
    const int status = umfpack_di_symbolic(a.rows, a.rows, a.start.data(), a.column.data(), a.value.data(),
                                           &symbolic_, control_, info_);
    if (status == UMFPACK_ERROR_out_of_memory) return out_of_memory(a.rows);
    if (status != UMFPACK_OK && status != UMFPACK_WARNING_singular_matrix) return singular(report, a.rows);
    const double unit = info_[UMFPACK_SIZE_OF_UNIT];
    // UMFPACK's own bound allows for every pivot off the diagonal and is ten to a hundred times too high. On the
    // nearly symmetric systems of ours L and U fill like a Cholesky factor.
    const FactorReport symmetric =
        make_cholesky_solver({.ordering = options_.ordering == Ordering::kNestedDissection
                                              ? Ordering::kNestedDissection
                                              : Ordering::kMinimumDegree})
            ->analyse(a);
    const double peak = std::min(info_[UMFPACK_PEAK_MEMORY_ESTIMATE] * unit,
                                 kBytesPerEntry * static_cast<double>(symmetric.factor_entries) +
                                     24.0 * static_cast<double>(a.entries()) + 400.0 * a.rows);
    report.factor_entries = 2 * symmetric.factor_entries;
    report.bytes = static_cast<std::uint64_t>(info_[UMFPACK_SYMBOLIC_SIZE] * unit);
    report.peak_bytes = static_cast<std::uint64_t>(peak);
    report.flops = info_[UMFPACK_FLOPS_ESTIMATE];
    if (options_.memory_bytes > 0 && peak > static_cast<double>(options_.memory_bytes)) {
      report.status = SolveStatus::kTooLarge;
      report.message = "LU of " + std::to_string(a.rows) + " unknowns needs about " +
                       std::to_string(report.peak_bytes >> 20) + " MiB, allowed are " +
                       std::to_string(options_.memory_bytes >> 20) +
                       " MiB: use BiCGSTAB or a larger memory cap";
      release();
    }
    return report;
  }

  FactorReport factor(const SparseMatrix& a) override {
    const SingleThread single;
    assert(symbolic_ != nullptr);
    FactorReport report;
    umfpack_di_free_numeric(&numeric_);
    matrix_ = &a;
    if (!all_finite(a.value)) {
      report.status = SolveStatus::kNotFinite;
      report.message = "the matrix holds a value that is not finite";
      return report;
    }
    const int status = umfpack_di_numeric(a.start.data(), a.column.data(), a.value.data(), symbolic_,
                                          &numeric_, control_, info_);
    if (status == UMFPACK_ERROR_out_of_memory) return out_of_memory(a.rows);
    if (status != UMFPACK_OK || !(info_[UMFPACK_RCOND] > kSmallestCondition)) return singular(report, a.rows);
    const double unit = info_[UMFPACK_SIZE_OF_UNIT];
    report.factor_entries = static_cast<std::uint64_t>(info_[UMFPACK_LNZ] + info_[UMFPACK_UNZ]);
    report.bytes =
        static_cast<std::uint64_t>((info_[UMFPACK_NUMERIC_SIZE] + info_[UMFPACK_SYMBOLIC_SIZE]) * unit);
    report.peak_bytes = static_cast<std::uint64_t>(info_[UMFPACK_PEAK_MEMORY] * unit);
    report.flops = info_[UMFPACK_FLOPS];
    return report;
  }

  SolveReport solve(std::span<const double> b, std::span<double> x, int width) override {
    const SingleThread single;
    assert(numeric_ != nullptr && b.size() == x.size());
    SolveReport report;
    if (!all_finite(b)) {
      report.status = SolveStatus::kNotFinite;
      report.message = "the right-hand side holds a value that is not finite";
      return report;
    }
    const auto w = static_cast<std::size_t>(width);
    const std::size_t n = b.size() / w;
    std::vector<double> bc(n), xc(n);
    for (std::size_t c = 0; c < w; ++c) {
      for (std::size_t i = 0; i < n; ++i) bc[i] = b[i * w + c];
      umfpack_di_solve(UMFPACK_At, matrix_->start.data(), matrix_->column.data(), matrix_->value.data(),
                       xc.data(), bc.data(), numeric_, control_, info_);
      for (std::size_t i = 0; i < n; ++i) x[i * w + c] = xc[i];
    }
    report.residual = relative_residual(*matrix_, x, b, width);
    if (!(report.residual < kLargestResidual)) {
      report.status = SolveStatus::kSingular;
      report.message = "the LU solution misses its right-hand side (relative residual " +
                       std::to_string(report.residual) + "): the matrix is singular to working precision";
    }
    return report;
  }

 private:
  FactorReport out_of_memory(std::int32_t unknowns) {
    release();
    FactorReport report;
    report.status = SolveStatus::kTooLarge;
    report.message =
        "out of memory in the LU factorization of " + std::to_string(unknowns) + " unknowns: use BiCGSTAB";
    return report;
  }
  FactorReport singular(FactorReport& report, std::int32_t unknowns) {
    umfpack_di_free_numeric(&numeric_);
    report.status = SolveStatus::kSingular;
    report.message = "the matrix of " + std::to_string(unknowns) +
                     " unknowns is singular: a piece without a fixed vertex, or faces without area";
    return report;
  }
  void release() {
    umfpack_di_free_numeric(&numeric_);
    umfpack_di_free_symbolic(&symbolic_);
  }

  SolverOptions options_;
  double control_[UMFPACK_CONTROL], info_[UMFPACK_INFO];
  void *symbolic_ = nullptr, *numeric_ = nullptr;
  const SparseMatrix* matrix_ = nullptr;
};

}  // namespace

std::unique_ptr<LinearSolver> make_lu_solver(const SolverOptions& options) {
  return std::make_unique<LuSolver>(options);
}

}  // namespace tessera
