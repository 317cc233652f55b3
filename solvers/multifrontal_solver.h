/// \file multifrontal_solver.h
/// The factor of multifrontal_cholesky.h behind LinearSolver.
#pragma once
#include <memory>

#include "solvers/factor_store.h"
#include "solvers/linear_solver.h"

namespace tessera {

/// For systems that are solved again and again with the same bits on every machine. A solution whose residual exceeds the
/// tolerance is refined once.
/// \param store  outlives the solver; empty, or what a factor() of the same matrix has put there: then that serves
std::unique_ptr<LinearSolver> make_multifrontal_solver(const SolverOptions& options, FactorStore& store);

}  // namespace tessera
