/// \file multigrid_solver.h
/// Conjugate gradients preconditioned by multigrid behind LinearSolver: V-cycle, full and cascading
/// (thesis 7.3.3). All right-hand sides run through the levels together.
#pragma once
#include <memory>

#include "solvers/linear_solver.h"

namespace tessera {

/// kMultigrid.
[[nodiscard]] std::unique_ptr<LinearSolver> make_multigrid_solver(const SolverOptions& options);

}  // namespace tessera
