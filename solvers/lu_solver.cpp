#include "solvers/lu_solver.h"

#include <umfpack.h>

#include <algorithm>
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
    report.flops = info_[UMFPACK_FLOPS];
    report.peak_bytes = static_cast<std::uint64_t>(info_[UMFPACK_PEAK_MEMORY] * unit);
    const auto numeric_bytes = static_cast<std::uint64_t>(info_[UMFPACK_NUMERIC_SIZE] * unit);
    const int taken = take_factors(a.rows);
    umfpack_di_free_numeric(&numeric_);
    if (taken != UMFPACK_OK) return failed(taken, a.rows);
    report.factor_entries = lower_.value.size() + upper_.value.size();
    report.bytes = 12 * report.factor_entries;
    report.peak_bytes = std::max(report.peak_bytes, numeric_bytes + report.bytes);
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
    for (std::size_t from = 0; from < w; from += kTogether) {
      const std::size_t some = std::min(kTogether, w - from);
      work_.assign(n * kTogether, 0.0);
      for (std::size_t k = 0; k < n; ++k)
        for (std::size_t c = 0; c < some; ++c)
          work_[k * kTogether + c] = b[static_cast<std::size_t>(column_order_[k]) * w + from + c];
      substitute();
      for (std::size_t k = 0; k < n; ++k) {
        const auto row = static_cast<std::size_t>(row_order_[k]);
        for (std::size_t c = 0; c < some; ++c)
          x[row * w + from + c] = work_[k * kTogether + c] * row_scale_[row];
      }
    }
    report.residual = relative_residual(*matrix_, x, b, width);
    return report;
  }

 private:
  /// Right-hand sides that go through the factors at a time: UMFPACK's own solve reads them once for each.
  static constexpr std::size_t kTogether = 16;

  struct Triangle {
    std::vector<int> start, index;
    std::vector<double> value;
  };

  /// P S B Q = L U of the transpose B: L by rows with units last, U by columns with pivots last.
  int take_factors(std::int32_t n) {
    int lower_entries = 0, upper_entries = 0, rows = 0, columns = 0, unused = 0, multiplies = 0;
    int status = umfpack_di_get_lunz(&lower_entries, &upper_entries, &rows, &columns, &unused, numeric_);
    if (status != UMFPACK_OK) return status;
    const auto size = [](Triangle& t, std::int32_t many, int entries) {
      t.start.resize(static_cast<std::size_t>(many) + 1);
      t.index.resize(static_cast<std::size_t>(entries));
      t.value.resize(static_cast<std::size_t>(entries));
    };
    size(lower_, n, lower_entries);
    size(upper_, n, upper_entries);
    row_order_.resize(static_cast<std::size_t>(n));
    column_order_.resize(static_cast<std::size_t>(n));
    row_scale_.resize(static_cast<std::size_t>(n));
    status = umfpack_di_get_numeric(lower_.start.data(), lower_.index.data(), lower_.value.data(),
                                    upper_.start.data(), upper_.index.data(), upper_.value.data(),
                                    row_order_.data(), column_order_.data(), nullptr, &multiplies,
                                    row_scale_.data(), numeric_);
    if (multiplies == 0)
      for (double& s : row_scale_) s = 1.0 / s;
    return status;
  }

  /// work_ <- L'^-1 U'^-1 work_.
  void substitute() {
    const std::size_t n = row_order_.size();
    using Values = std::array<double, kTogether>;
    const auto values = [&](std::size_t k) { return work_.data() + k * kTogether; };
    for (std::size_t j = 0; j < n; ++j) {
      Values sum;
      std::copy(values(j), values(j) + kTogether, sum.data());
      const auto last = static_cast<std::size_t>(upper_.start[j + 1]) - 1;
      for (auto e = static_cast<std::size_t>(upper_.start[j]); e < last; ++e) {
        const double u = upper_.value[e];
        const double* const other = values(static_cast<std::size_t>(upper_.index[e]));
        for (std::size_t c = 0; c < kTogether; ++c) sum[c] -= u * other[c];
      }
      const double pivot = upper_.value[last];
      for (std::size_t c = 0; c < kTogether; ++c) values(j)[c] = sum[c] / pivot;
    }
    for (std::size_t i = n; i-- > 0;) {
      Values own;
      std::copy(values(i), values(i) + kTogether, own.data());
      const auto last = static_cast<std::size_t>(lower_.start[i + 1]) - 1;
      for (auto e = static_cast<std::size_t>(lower_.start[i]); e < last; ++e) {
        const double l = lower_.value[e];
        double* const other = values(static_cast<std::size_t>(lower_.index[e]));
        for (std::size_t c = 0; c < kTogether; ++c) other[c] -= l * own[c];
      }
    }
  }

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
  Triangle lower_, upper_;
  std::vector<int> row_order_, column_order_;
  std::vector<double> row_scale_, work_;
};

}  // namespace

std::unique_ptr<LinearSolver> make_lu_solver(const SolverOptions& options) {
  return std::make_unique<LuSolver>(options);
}

}  // namespace tessera
