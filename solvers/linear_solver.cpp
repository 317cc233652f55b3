#include "solvers/linear_solver.h"

#include "octree/error.h"
#include "solvers/cholesky_solver.h"
#include "solvers/krylov_solver.h"
#include "solvers/lu_solver.h"
#include "solvers/multigrid_solver.h"
#include "solvers/solver_choice.h"

namespace tessera {

std::unique_ptr<LinearSolver> make_solver(SolverKind kind, const SolverOptions& options) {
  if (!(options.tolerance > 0.0)) throw UsageError("the tolerance of a solver must be positive");
  if (options.max_iterations < 1) throw UsageError("a solver needs at least one iteration");
  switch (kind) {
    case SolverKind::kCholesky:
      return make_cholesky_solver(options);
    case SolverKind::kLu:
      return make_lu_solver(options);
    case SolverKind::kConjugateGradients:
      return make_conjugate_gradients_solver(options);
    case SolverKind::kBicgstab:
      return make_bicgstab_solver(options);
    case SolverKind::kAutomatic:
      return make_automatic_solver(options);
    case SolverKind::kMultigrid:
      return make_multigrid_solver(options);
  }
  throw UsageError("this solver is not known");
}

const char* name(SolverKind kind) {
  switch (kind) {
    case SolverKind::kCholesky:
      return "Cholesky";
    case SolverKind::kLu:
      return "LU";
    case SolverKind::kConjugateGradients:
      return "conjugate gradients";
    case SolverKind::kBicgstab:
      return "BiCGSTAB";
    case SolverKind::kAutomatic:
      return "automatic";
    case SolverKind::kMultigrid:
      return "multigrid";
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
