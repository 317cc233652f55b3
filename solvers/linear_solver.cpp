#include "solvers/linear_solver.h"

#include <string>
#include <utility>

#include "octree/error.h"
#include "solvers/multifrontal_solver.h"
#include "solvers/multigrid_solver.h"

namespace tessera {
namespace {

class AutomaticSolver final : public LinearSolver {
 public:
  explicit AutomaticSolver(const SolverOptions& options) : options_(options) {}

  FactorReport analyse(const SparseMatrix& a) override {
    solver_ = make_fronts_solver(options_);
    FactorReport report = solver_->analyse(a);
    std::string reason = std::to_string(a.rows) + " unknowns of order " + std::to_string(options_.order) +
                         ": Cholesky where it fits";
    if (report.status == SolveStatus::kTooLarge) {
      reason += "; " + report.message.substr(0, report.message.rfind(':')) + ", so multigrid";
      solver_ = make_multigrid_solver(options_);
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

std::unique_ptr<LinearSolver> make_solver(SolverKind kind, const SolverOptions& options) {
  if (!(options.tolerance > 0.0)) throw UsageError("the tolerance of a solver must be positive");
  if (options.max_iterations < 1) throw UsageError("a solver needs at least one iteration");
  switch (kind) {
    case SolverKind::kFronts:
      return make_fronts_solver(options);
    case SolverKind::kAutomatic:
      return std::make_unique<AutomaticSolver>(options);
    case SolverKind::kMultigrid:
      return make_multigrid_solver(options);
    case SolverKind::kLu:
      return make_lu_solver(options);
  }
  throw UsageError("this solver is not known");
}

const char* name(SolverKind kind) {
  switch (kind) {
    case SolverKind::kFronts:
      return "fronts";
    case SolverKind::kAutomatic:
      return "automatic";
    case SolverKind::kMultigrid:
      return "multigrid";
    case SolverKind::kLu:
      return "LU";
  }
  return "unknown";
}

const char* name(Ordering ordering) {
  switch (ordering) {
    case Ordering::kAuto:
      return "automatic";
    case Ordering::kMinimumDegree:
      return "minimum degree";
    case Ordering::kNestedDissection:
      return "nested dissection";
    case Ordering::kReverseCuthillMcKee:
      return "reverse Cuthill-McKee";
    case Ordering::kNatural:
      return "natural";
  }
  return "unknown";
}

void set_singular(FactorReport& report, std::int32_t unknown) {
  report.status = SolveStatus::kSingular;
  report.unknown = unknown;
  report.message = "the matrix is not positive definite (pivot of unknown " + std::to_string(unknown) +
                   "): a piece without a fixed vertex, or faces without area";
}

const char* name(SolveStatus status) {
  switch (status) {
    case SolveStatus::kSolved:
      return "solved";
    case SolveStatus::kNotConverged:
      return "not converged";
    case SolveStatus::kSingular:
      return "singular";
    case SolveStatus::kNotFinite:
      return "not finite";
    case SolveStatus::kTooLarge:
      return "too large";
  }
  return "unknown";
}

}  // namespace tessera
