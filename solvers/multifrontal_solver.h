/// \file multifrontal_solver.h
/// The factors of multifrontal_cholesky.h and multifrontal_lu.h behind LinearSolver.
#pragma once
#include <memory>

#include "solvers/factor_store.h"
#include "solvers/linear_solver.h"

namespace tessera {

/// For systems that are solved again and again with the same bits on every machine. A solution whose residual exceeds the
/// tolerance is refined once.
/// \param store  outlives the solver; empty, or what a factor() of the same matrix has put there: then that serves. What lies in
///               it does not count: neither for SolverOptions::memory_bytes nor in reports
[[nodiscard]] std::unique_ptr<LinearSolver> make_multifrontal_solver(const SolverOptions& options,
                                                                     FactorStore& store);
/// The same by multifrontal_lu.h, whose factor always is a new one. \pre the store is empty
[[nodiscard]] std::unique_ptr<LinearSolver> make_lu_solver(const SolverOptions& options, FactorStore& store);

/// kFronts, kLu. The factor lies in memory and counts.
[[nodiscard]] std::unique_ptr<LinearSolver> make_fronts_solver(const SolverOptions& options);
[[nodiscard]] std::unique_ptr<LinearSolver> make_lu_solver(const SolverOptions& options);

}  // namespace tessera
