/// \file krylov_solver.h
/// Conjugate gradients with incomplete Cholesky (Lin and More 1999) and BiCGSTAB with incomplete LU (Saad
/// 1994) behind LinearSolver; the preconditioners are Eigen's. Source: Barrett et al. 1994, "Templates".
#pragma once
#include <memory>

#include "solvers/linear_solver.h"

namespace tessera {

/// kConjugateGradients.
std::unique_ptr<LinearSolver> make_conjugate_gradients_solver(const SolverOptions& options);

/// kBicgstab.
std::unique_ptr<LinearSolver> make_bicgstab_solver(const SolverOptions& options);

}  // namespace tessera
