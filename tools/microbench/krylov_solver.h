/// \file krylov_solver.h
/// Conjugate gradients with incomplete Cholesky (Lin and More 1999) behind LinearSolver; the preconditioner is Eigen's.
/// Source: Barrett et al. 1994, "Templates".
#pragma once
#include <memory>

#include "solvers/linear_solver.h"

namespace tessera {

/// What multigrid is measured against.
std::unique_ptr<LinearSolver> make_conjugate_gradients_solver(const SolverOptions& options);

}  // namespace tessera
