/// \file cholmod_solver.h
/// Supernodal sparse Cholesky by CHOLMOD behind LinearSolver: what our fronts are held against. Its Supernodal module is under the
/// GPL, so nothing that is installed links it. Solutions depend on the machine's BLAS kernels; the BLAS and OpenMP are held to one
/// thread. Source: Chen, Davis, Hager, Rajamanickam 2008.
#pragma once
#include <memory>

#include "solvers/linear_solver.h"

namespace tessera::test {

/// Reads the upper triangle of the matrix alone.
std::unique_ptr<LinearSolver> make_cholmod_solver(const SolverOptions& options = {});

}  // namespace tessera::test
