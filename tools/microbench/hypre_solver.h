/// \file hypre_solver.h
/// Algebraic multigrid of a well-kept library, hypre's BoomerAMG as preconditioner of conjugate gradients, to compare
/// with. Only the bench links it: it brings MPI.
#pragma once
#include <memory>

#include "solvers/linear_solver.h"

namespace tessera {

/// One process. Reads tolerance and max_iterations.
std::unique_ptr<LinearSolver> make_hypre_solver(const SolverOptions& options);

}  // namespace tessera
