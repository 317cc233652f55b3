#include "solvers/multigrid_solver.h"

#include <algorithm>
#include <array>
#include <cassert>
#include <cmath>
#include <cstdio>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "solvers/conjugate_gradients.h"
#include "solvers/envelope_cholesky.h"
#include "solvers/multifrontal_solver.h"
#include "solvers/multigrid_cycle.h"
#include "solvers/multigrid_levels.h"

namespace tessera {
namespace {

using Vector = std::vector<double>;

constexpr int kMaxColumns = 3;    // run through the levels together; more cost memory and gain little
constexpr int kCascadeSteps = 4;  // m and gamma of the cascade (thesis 7.3.3): m gamma^i steps on level i
constexpr double kCascadeGrowth = 2.5;
constexpr double kStartTolerance = 1e-12;
// Bytes an unknown while solving three columns, at the most (tests/solvers, tools/bench solvers), by order.
constexpr double kBytesPerUnknown[] = {180.0, 720.0, 720.0};

// Entries of the coarsest factor up to which an envelope serves. A mesh of very many pieces may stop above it.
constexpr std::uint64_t kLargestEnvelope = std::uint64_t{1} << 24;

/// Solves the coarsest level directly: by an envelope as long as that is small, else by fronts.
class CoarsestLevel {
 public:
  FactorReport factor(const SparseMatrix& a) {
    FactorReport report;
    envelope_.emplace(a);
    if (envelope_->envelope() > kLargestEnvelope) {
      envelope_.reset();
      large_ = make_fronts_solver({});
      report = large_->analyse(a);
      return report.status == SolveStatus::kSolved ? large_->factor(a) : report;
    }
    report.factor_entries = envelope_->envelope();
    report.bytes = report.peak_bytes = 8 * envelope_->envelope();
    if (!envelope_->factor(a)) report.status = SolveStatus::kSingular;
    return report;
  }

  void solve(const Vector& b, Vector& x, int width) {
    if (large_) {
      large_->solve(b, x, width);
      return;
    }
    const auto w = static_cast<std::size_t>(width);
    column_.resize(b.size() / w);
    for (std::size_t c = 0; c < w; ++c) {
      for (std::size_t i = 0; i < column_.size(); ++i) column_[i] = b[i * w + c];
      envelope_->solve(column_);
      for (std::size_t i = 0; i < column_.size(); ++i) x[i * w + c] = column_[i];
    }
  }

 private:
  std::optional<EnvelopeCholesky> envelope_;
  std::unique_ptr<LinearSolver> large_;
  Vector column_;
};

class MultigridSolver final : public LinearSolver {
 public:
  explicit MultigridSolver(const SolverOptions& options) : options_(options) {}

  FactorReport analyse(const SparseMatrix& a) override {
    assert(a.rows == a.columns);
    FactorReport report;
    const double need = kBytesPerUnknown[std::clamp(options_.order, 1, 3) - 1] * a.rows + 4e6;
    report.peak_bytes = static_cast<std::uint64_t>(need);
    if (options_.memory_bytes > 0 && need > static_cast<double>(options_.memory_bytes)) {
      report.status = SolveStatus::kTooLarge;
      report.message = "multigrid for " + std::to_string(a.rows) + " unknowns needs " +
                       std::to_string(report.peak_bytes >> 20) + " MiB, allowed are " +
                       std::to_string(options_.memory_bytes >> 20) + " MiB: use a larger memory cap";
    }
    return report;
  }

  FactorReport factor(const SparseMatrix& a) override {
    FactorReport report;
    levels_ = {};
    x_.clear();
    b_.clear();
    if (!all_finite(a.value)) {
      report.status = SolveStatus::kNotFinite;
      report.message = "the matrix holds a value that is not finite";
      return report;
    }
    for (std::int32_t i = 0; i < a.rows; ++i)
      if (!(entry(a, i, i) > 0.0)) {
        report.status = SolveStatus::kSingular;
        report.message = "the diagonal of unknown " + std::to_string(i) +
                         " is not positive: a vertex without a sound face and without constraint";
        return report;
      }
    levels_ = multigrid_levels(a, {.order = options_.order,
                                   .coarsest = MultigridLevelsOptions{}.coarsest,
                                   .positions = options_.positions,
                                   .neighbours = options_.neighbours});
    coarsest_ = {};
    report = coarsest_.factor(*levels_.levels.back().matrix);
    report.factor_entries += levels_.entries();
    report.bytes += levels_.bytes();
    report.peak_bytes = report.bytes;
    if (report.status == SolveStatus::kSingular)
      report.message =
          "the coarsest level is singular: a piece without a fixed vertex, or faces without area";
    return report;
  }

  SolveReport solve(std::span<const double> b, std::span<double> x, int width) override {
    assert(!levels_.levels.empty() && b.size() == x.size() &&
           b.size() ==
               static_cast<std::size_t>(levels_.levels[0].matrix->rows) * static_cast<std::size_t>(width));
    SolveReport report;
    if (!all_finite(b)) {
      report.status = SolveStatus::kNotFinite;
      report.message = "the right-hand side holds a value that is not finite";
      return report;
    }
    if (width <= kMaxColumns) return run(b, x, width);
    // In slices of the columns.
    const auto w = static_cast<std::size_t>(width);
    const std::size_t n = b.size() / w;
    for (std::size_t first = 0; first < w; first += kMaxColumns) {
      const std::size_t columns = std::min<std::size_t>(kMaxColumns, w - first);
      Vector bs(n * columns), xs(n * columns);
      for (std::size_t i = 0; i < n; ++i)
        for (std::size_t c = 0; c < columns; ++c) bs[i * columns + c] = b[i * w + first + c];
      SolveReport part = run(bs, xs, static_cast<int>(columns));
      for (std::size_t i = 0; i < n; ++i)
        for (std::size_t c = 0; c < columns; ++c) x[i * w + first + c] = xs[i * columns + c];
      report.iterations = std::max(report.iterations, part.iterations);
      report.residual = std::max(report.residual, part.residual);
      if (part.status != SolveStatus::kSolved) {
        report.status = part.status;
        report.message = std::move(part.message);
      }
    }
    return report;
  }

 private:
  SolveReport run(std::span<const double> b, std::span<double> x, int width) {
    return width == 1 ? run_columns<1>(b, x) : width == 2 ? run_columns<2>(b, x) : run_columns<3>(b, x);
  }

  const MultigridLevel& level(std::size_t k) const { return levels_.levels[k]; }
  bool coarsest(std::size_t k) const { return k + 1 == levels_.levels.size(); }
  int sweeps() const { return options_.order == 1 ? 1 : 2; }

  template <int kWidth>
  auto product_with(std::size_t k) const {
    return [&a = *level(k).matrix](const Vector& u, Vector& v) { multiply(a, u, v, kWidth); };
  }

  /// x_[k] = about A^-1 b_[k]; symmetric and positive definite as a function of b_[k].
  template <int kWidth>
  void cycle(std::size_t k) {
    if (coarsest(k)) {
      coarsest_.solve(b_[k], x_[k], kWidth);
      return;
    }
    relax_from_zero<kWidth>(level(k), b_[k].data(), x_[k].data());
    for (int s = 1; s < sweeps(); ++s) relax<kWidth>(level(k), b_[k].data(), x_[k].data(), true);
    restrict_residual<kWidth>(level(k), b_[k].data(), x_[k].data(), b_[k + 1], sweeps() == 1);
    cycle<kWidth>(k + 1);
    if (options_.order > 1 && k > 0 && !coarsest(k + 1)) again<kWidth>(k + 1);
    add_prolonged<kWidth>(level(k), x_[k + 1], x_[k].data());
    for (int s = 0; s < sweeps(); ++s) relax<kWidth>(level(k), b_[k].data(), x_[k].data(), false);
  }

  /// A second cycle on what the first has left: the W-cycle, cheap where levels are small.
  template <int kWidth>
  void again(std::size_t k) {
    const Vector first = x_[k];
    Vector ax(first.size());
    multiply(*level(k).matrix, first, ax, kWidth);
    for (std::size_t i = 0; i < ax.size(); ++i) b_[k][i] -= ax[i];
    cycle<kWidth>(k);
    for (std::size_t i = 0; i < ax.size(); ++i) x_[k][i] += first[i];
  }

  /// A start for the finest level from all coarser ones. The prolonged start of a level is checked: it is
  /// scaled to the least energy, and dropped where it points uphill, so it is never worse than zero.
  template <int kWidth>
  void nested_iteration(std::span<const double> b, std::span<double> x, const Columns<kWidth>& norms) {
    const std::size_t last = levels_.levels.size() - 1;
    std::vector<Vector> loads(last + 1), starts(last + 1);  // none on the finest level: b and x serve
    for (std::size_t k = 0; k < last; ++k) {
      loads[k + 1].resize(x_[k + 1].size());
      starts[k + 1].assign(x_[k + 1].size(), 0.0);
      restrict_load<kWidth>(level(k), k == 0 ? b.data() : loads[k].data(), loads[k + 1]);
    }
    coarsest_.solve(loads[last], starts[last], kWidth);
    for (std::size_t k = last; k-- > 0;) {
      const std::span<const double> load = k == 0 ? b : loads[k];
      const std::span<double> start = k == 0 ? x : starts[k];
      add_prolonged<kWidth>(level(k), starts[k + 1], start.data());
      starts[k + 1] = {};
      Vector& r = b_[k];
      multiply(*level(k).matrix, start, r, kWidth);
      const Columns<kWidth> gain = dots<kWidth>(load, start), energy = dots<kWidth>(start, r);
      for (std::size_t i = 0; i < r.size(); i += kWidth)
        for (int c = 0; c < kWidth; ++c) {
          const double scale = energy[c] > 0.0 ? std::max(0.0, gain[c] / energy[c]) : 0.0;
          start[i + c] *= scale;
          r[i + c] = load[i + c] - scale * r[i + c];
        }
      if (k == 0) return;
      if (options_.cycle == MultigridCycle::kCascading) {
        double steps = kCascadeSteps;
        for (std::size_t j = 0; j < k; ++j) steps *= kCascadeGrowth;
        Vector p;
        conjugate_gradients<kWidth>(product_with<kWidth>(k), r, start, x_[k], p, norms, kStartTolerance,
                                    static_cast<int>(steps), [&] { smooth<kWidth>(k); });
      } else {
        cycle<kWidth>(k);
        for (std::size_t i = 0; i < r.size(); ++i) start[i] += x_[k][i];
      }
    }
  }

  /// Symmetric Gauss-Seidel alone.
  template <int kWidth>
  void smooth(std::size_t k) {
    relax_from_zero<kWidth>(level(k), b_[k].data(), x_[k].data());
    relax<kWidth>(level(k), b_[k].data(), x_[k].data(), false);
  }

  template <int kWidth>
  SolveReport run_columns(std::span<const double> b, std::span<double> x) {
    const SparseMatrix& a = *level(0).matrix;
    x_.resize(levels_.levels.size());
    b_.resize(levels_.levels.size());
    for (std::size_t k = 0; k < x_.size(); ++k) {
      const std::size_t size = static_cast<std::size_t>(level(k).matrix->rows) * kWidth;
      x_[k].resize(size);
      b_[k].resize(size);
    }
    std::fill(x.begin(), x.end(), 0.0);
    Columns<kWidth> norms = dots<kWidth>(b, b);
    for (double& v : norms) v = std::sqrt(v);
    const bool nested = options_.cycle != MultigridCycle::kV && !coarsest(0);
    if (nested)
      nested_iteration<kWidth>(b, x, norms);
    else
      std::copy(b.begin(), b.end(), b_[0].begin());
    Vector p;
    const bool cascade = options_.cycle == MultigridCycle::kCascading && !coarsest(0);
    const ConjugateGradientsResult result = conjugate_gradients<kWidth>(
        product_with<kWidth>(0), b_[0], x, x_[0], p, norms, options_.tolerance, options_.max_iterations,
        [&] { cascade ? smooth<kWidth>(0) : cycle<kWidth>(0); });
    SolveReport report;
    report.iterations = result.iterations;
    report.residual = relative_residual(a, x, b, kWidth);
    if (result.breakdown) {
      report.status = SolveStatus::kSingular;
      report.message = "multigrid broke down after " + std::to_string(result.iterations) +
                       " cycles: the matrix is not positive definite";
    } else if (!result.converged || !(report.residual <= kResidualDrift * options_.tolerance)) {
      report.status = SolveStatus::kNotConverged;
      std::array<char, 16> residual{};
      std::snprintf(residual.data(), residual.size(), "%.1e", report.residual);
      report.message = "multigrid reached a relative residual of " + std::string(residual.data()) + " in " +
                       std::to_string(result.iterations) + " cycles";
    }
    return report;
  }

  SolverOptions options_;
  MultigridLevels levels_;
  CoarsestLevel coarsest_;
  std::vector<Vector> x_, b_;  // by level, kept between calls
};

}  // namespace

std::unique_ptr<LinearSolver> make_multigrid_solver(const SolverOptions& options) {
  return std::make_unique<MultigridSolver>(options);
}

}  // namespace tessera
