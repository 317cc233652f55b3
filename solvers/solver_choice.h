/// \file solver_choice.h
/// The automatic choice between direct and multigrid behind LinearSolver.
#pragma once
#include <memory>

#include "solvers/linear_solver.h"

namespace tessera {

/// kAutomatic.
std::unique_ptr<LinearSolver> make_automatic_solver(const SolverOptions& options);

}  // namespace tessera
