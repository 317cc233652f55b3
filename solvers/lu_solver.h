/// \file lu_solver.h
/// UMFPACK behind LinearSolver: for the few systems that are not symmetric (thesis 7.3.5).
/// Source: Davis, "Algorithm 832: UMFPACK V4.3, an Unsymmetric-Pattern Multifrontal Method", 2004.
#pragma once
#include <memory>

#include "solvers/linear_solver.h"

namespace tessera {

/// kLu.
std::unique_ptr<LinearSolver> make_lu_solver(const SolverOptions& options);

}  // namespace tessera
