/// \file lu_solver.h
/// Sparse LU with pivoting by UMFPACK behind LinearSolver. Source: Davis 2004.
#pragma once
#include <memory>

#include "solvers/linear_solver.h"

namespace tessera {

/// kLu. Any square matrix; orderings kAuto, kMinimumDegree and kNestedDissection (the others: UsageError).
std::unique_ptr<LinearSolver> make_lu_solver(const SolverOptions& options);

}  // namespace tessera
