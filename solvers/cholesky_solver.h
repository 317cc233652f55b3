/// \file cholesky_solver.h
/// Supernodal sparse Cholesky by CHOLMOD behind LinearSolver. Source: Chen, Davis, Hager, Rajamanickam 2008.
#pragma once
#include <memory>

#include "solvers/linear_solver.h"

namespace tessera {

/// kCholesky. Reads the upper triangle of the matrix alone.
std::unique_ptr<LinearSolver> make_cholesky_solver(const SolverOptions& options);

}  // namespace tessera
