#include "solvers/lu_solver.h"

#include <umfpack.h>

#include <array>
#include <cassert>
#include <string>
#include <vector>

#include "solvers/single_thread.h"

namespace tessera {
namespace {

class LuSolver final : public LinearSolver {
 public:
  explicit LuSolver(const SolverOptions& options) : options_(options) {
    umfpack_di_defaults(control_.data());
    control_[UMFPACK_ORDERING] =
        UMFPACK_ORDERING_METIS;  // systems of surfaces: a tenth less than by minimum degree
    // Its own refinement doubles the time of everything for the last digit; who needs that refines against the operators.
    control_[UMFPACK_IRSTEP] = 0;
  }
  ~LuSolver() override {
    umfpack_di_free_numeric(&numeric_);
    umfpack_di_free_symbolic(&symbolic_);
  }

  FactorReport analyse(const SparseMatrix& a) override {
    const SingleThread single;
    assert(a.rows == a.columns);
    umfpack_di_free_symbolic(&symbolic_);
    FactorReport report;
    // Compressed rows are the compressed columns of the transpose.
    const int status = umfpack_di_symbolic(a.rows, a.rows, a.start.data(), a.column.data(), a.value.data(),
                                           &symbolic_, control_.data(), info_.data());
    if (status < UMFPACK_OK) return failed(status, a.rows);
    const double unit = info_[UMFPACK_SIZE_OF_UNIT];
    report.peak_bytes = static_cast<std::uint64_t>(info_[UMFPACK_PEAK_MEMORY_ESTIMATE] * unit);
    report.bytes = static_cast<std::uint64_t>(info_[UMFPACK_SYMBOLIC_SIZE] * unit);
    report.flops = info_[UMFPACK_FLOPS_ESTIMATE];
    if (options_.memory_bytes > 0 && report.peak_bytes > options_.memory_bytes) {
      report.status = SolveStatus::kTooLarge;
      report.message = "the LU factors of " + std::to_string(a.rows) + " unknowns need " +
                       std::to_string((report.peak_bytes >> 20) + 1) + " MiB, allowed are " +
                       std::to_string((options_.memory_bytes >> 20) + 1) + " MiB: allow more memory";
    }
    return report;
  }

  FactorReport factor(const SparseMatrix& a) override {
    const SingleThread single;
    matrix_ = &a;
    umfpack_di_free_numeric(&numeric_);
    FactorReport report;
    if (!all_finite(a.value)) {
      report.status = SolveStatus::kNotFinite;
      report.message = "the matrix holds a value that is not finite";
      return report;
    }
    const int status = umfpack_di_numeric(a.start.data(), a.column.data(), a.value.data(), symbolic_,
                                          &numeric_, control_.data(), info_.data());
    if (status != UMFPACK_OK) return failed(status, a.rows);
    const double unit = info_[UMFPACK_SIZE_OF_UNIT];
    report.factor_entries = static_cast<std::uint64_t>(info_[UMFPACK_LNZ] + info_[UMFPACK_UNZ]);
    report.flops = info_[UMFPACK_FLOPS];
    report.bytes = static_cast<std::uint64_t>(info_[UMFPACK_NUMERIC_SIZE] * unit);
    report.peak_bytes = static_cast<std::uint64_t>(info_[UMFPACK_PEAK_MEMORY] * unit);
    return report;
  }

  SolveReport solve(std::span<const double> b, std::span<double> x, int width) override {
    const SingleThread single;
    SolveReport report;
    if (!all_finite(b)) {
      report.status = SolveStatus::kNotFinite;
      report.message = "the right-hand side holds a value that is not finite";
      return report;
    }
    const auto n = static_cast<std::size_t>(matrix_->rows), w = static_cast<std::size_t>(width);
    std::vector<double> right(n), left(n);
    for (std::size_t c = 0; c < w; ++c) {
      for (std::size_t i = 0; i < n; ++i) right[i] = b[i * w + c];
      const int status =
          umfpack_di_solve(UMFPACK_At, matrix_->start.data(), matrix_->column.data(), matrix_->value.data(),
                           left.data(), right.data(), numeric_, control_.data(), info_.data());
      if (status != UMFPACK_OK) {
        const FactorReport why = failed(status, matrix_->rows);
        report.status = why.status;
        report.message = why.message;
        return report;
      }
      for (std::size_t i = 0; i < n; ++i) x[i * w + c] = left[i];
    }
    report.residual = relative_residual(*matrix_, x, b, width);
    return report;
  }

 private:
  static FactorReport failed(int status, std::int32_t unknowns) {
    FactorReport report;
    const bool singular = status == UMFPACK_WARNING_singular_matrix;
    report.status = singular ? SolveStatus::kSingular : SolveStatus::kTooLarge;
    report.message =
        singular
            ? "the matrix is singular: a piece without a fixed vertex, or faces without area"
            : "no LU factors of " + std::to_string(unknowns) + " unknowns: out of memory or too many entries";
    return report;
  }

  SolverOptions options_;
  std::array<double, UMFPACK_CONTROL> control_{};
  std::array<double, UMFPACK_INFO> info_{};
  void *symbolic_ = nullptr, *numeric_ = nullptr;
  const SparseMatrix* matrix_ = nullptr;
};

}  // namespace

std::unique_ptr<LinearSolver> make_lu_solver(const SolverOptions& options) {
  return std::make_unique<LuSolver>(options);
}

}  // namespace tessera
