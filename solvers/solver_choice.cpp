// Which solver for which system: a fit of what tools/bench solvers measures.
#include <algorithm>
#include <cmath>
#include <memory>
#include <string>
#include <utility>

#include "octree/error.h"
#include "solvers/solver_choice.h"

namespace tessera {
namespace {

/// At a million unknowns, per unknown: bytes, microseconds before the first solution, microseconds a right-hand side.
struct Cost {
  double bytes, setup, column;
};

struct Measured {
  Cost cholesky;
  double work_exponent;  // of the factorization over the number of unknowns; small factors live in the cache
  Cost multigrid;
};
constexpr Measured kMeasured[] = {
    {{800.0, 3.2, 0.11}, 1.2, {180.0, 0.71, 0.26}},
    {{2700.0, 13.0, 0.24}, 1.4, {720.0, 3.7, 1.2}},
    {{5200.0, 30.0, 0.40}, 1.4, {720.0, 4.5, 4.8}},
};
// A direct solution is exact, so multigrid has to be faster by this factor.
constexpr double kFasterBy = 1.5;
constexpr double kLuOverCholesky = 2.5;  // memory

std::string mebibytes(double bytes) {
  return std::to_string(static_cast<std::uint64_t>(bytes / 1048576.0) + 1) + " MiB";
}

std::string describe(std::size_t unknowns, int order, std::size_t right_hand_sides) {
  return std::to_string(unknowns) + " unknowns of order " + std::to_string(order) + ", " +
         std::to_string(right_hand_sides) + " right-hand sides: ";
}

}  // namespace

SolverChoice choose_solver(std::size_t unknowns, int order, std::size_t right_hand_sides,
                           std::uint64_t memory_bytes, bool symmetric) {
  if (order < 1 || order > 3)
    throw UsageError("a Laplacian of order " + std::to_string(order) + " is not supported");
  const Measured& m = kMeasured[order - 1];
  const double n = static_cast<double>(std::max<std::size_t>(unknowns, 2)),
               columns = static_cast<double>(right_hand_sides);
  const double fill = std::log2(n) / std::log2(1e6);
  double direct_bytes = n * m.cholesky.bytes * fill;
  if (!symmetric) direct_bytes *= kLuOverCholesky;
  const double iterative_bytes = n * m.multigrid.bytes;
  const bool fits = memory_bytes == 0 || direct_bytes <= static_cast<double>(memory_bytes);
  const std::string what = describe(unknowns, order, right_hand_sides);
  SolverChoice out;
  if (!symmetric) {
    out.kind = fits ? SolverKind::kLu : SolverKind::kBicgstab;
    out.predicted_bytes = static_cast<std::uint64_t>(fits ? direct_bytes : iterative_bytes);
    out.reason = what + "not symmetric, " +
                 (fits ? "LU fits in " + mebibytes(direct_bytes)
                       : "LU would need " + mebibytes(direct_bytes) + ", above the cap, so BiCGSTAB");
    return out;
  }
  const double scale = n * 1e-6;
  const double direct =
      m.cholesky.setup * std::pow(scale, m.work_exponent) + m.cholesky.column * columns * scale * fill;
  const double multigrid = (m.multigrid.setup + m.multigrid.column * columns) * scale;
  if (!fits) {
    out.kind = SolverKind::kMultigrid;
    out.reason = what + "a Cholesky factor would need " + mebibytes(direct_bytes) + ", above the cap of " +
                 mebibytes(static_cast<double>(memory_bytes)) + ", so multigrid";
  } else {
    out.kind = direct <= kFasterBy * multigrid ? SolverKind::kCholesky : SolverKind::kMultigrid;
    const auto seconds = [](double s) {
      return std::to_string(static_cast<int>(std::ceil(s * 10.0))) + " tenths of a second";
    };
    out.reason = what + "Cholesky about " + seconds(direct) + ", multigrid about " + seconds(multigrid);
  }
  out.predicted_bytes =
      static_cast<std::uint64_t>(out.kind == SolverKind::kCholesky ? direct_bytes : iterative_bytes);
  return out;
}

namespace {

class AutomaticSolver final : public LinearSolver {
 public:
  explicit AutomaticSolver(const SolverOptions& options) : options_(options) {}

  FactorReport analyse(const SparseMatrix& a) override {
    const SolverChoice choice =
        choose_solver(static_cast<std::size_t>(a.rows), options_.order, options_.right_hand_sides,
                      options_.memory_bytes, options_.symmetric);
    std::string reason = choice.reason;
    // Without positions multigrid is slow: then it is the last resort.
    SolverKind kind = choice.kind;
    if (options_.symmetric && (options_.prefer_direct || options_.positions.empty())) {
      kind = SolverKind::kCholesky;
      reason = describe(static_cast<std::size_t>(a.rows), options_.order, options_.right_hand_sides) +
               "Cholesky where it fits";
    }
    solver_ = make_solver(kind, options_);
    FactorReport report = solver_->analyse(a);
    const bool direct = kind == SolverKind::kCholesky || kind == SolverKind::kLu;
    if (report.status == SolveStatus::kTooLarge && direct) {
      // The exact count knows better than the rule.
      const SolverKind other = options_.symmetric ? SolverKind::kMultigrid : SolverKind::kBicgstab;
      reason += "; " + report.message.substr(0, report.message.rfind(':')) + ", so " + name(other);
      solver_ = make_solver(other, options_);
      report = solver_->analyse(a);
    }
    report.choice = std::move(reason);
    return report;
  }
  FactorReport factor(const SparseMatrix& a) override { return solver_->factor(a); }
  SolveReport solve(std::span<const double> b, std::span<double> x, int width) override {
    return solver_->solve(b, x, width);
  }

 private:
  SolverOptions options_;
  std::unique_ptr<LinearSolver> solver_;
};

}  // namespace

std::unique_ptr<LinearSolver> make_automatic_solver(const SolverOptions& options) {
  return std::make_unique<AutomaticSolver>(options);
}

}  // namespace tessera
