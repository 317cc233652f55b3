/// \file linear_solver.h
/// One interface for all sparse solvers: analyse a pattern, factor its values, solve many right-hand sides.
///
/// What may happen to a sound program on given numbers is a value: not converging, a singular matrix, a
/// factor that does not fit. Nothing throws but for broken preconditions (UsageError). A solver is used by
/// one thread at a time and computes on one thread, without a BLAS, so a result depends neither on threads nor on the machine.
#pragma once
#include <array>
#include <cstdint>
#include <memory>
#include <span>
#include <string>

#include "octree/vector.h"
#include "solvers/sparse_matrix.h"

namespace tessera {

enum class SolverKind {
  kFronts,     ///< multifrontal Cholesky; symmetric positive definite
  kAutomatic,  ///< fronts where the factor fits, else multigrid
  kMultigrid,  ///< conjugate gradients preconditioned by our multigrid; symmetric positive definite
  kLu,         ///< multifrontal, with pivots within the fronts; nearly symmetric pattern
};

enum class Ordering {
  kAuto,              ///< minimum degree; nested dissection where the factor is large or would not fit
  kMinimumDegree,     ///< AMD
  kNestedDissection,  ///< METIS
  kReverseCuthillMcKee,
  kNatural,
};

enum class SolveStatus {
  kSolved,
  kNotConverged,  ///< iterations spent; the solution holds the best there is
  kSingular,      ///< a pivot is zero or negative: unconstrained piece, or not positive definite
  kNotFinite,     ///< the matrix or a right-hand side holds NaN or infinity
  kTooLarge,  ///< predicted to exceed SolverOptions::memory_bytes, or out of memory, or out of index range
};

/// How multigrid uses its levels (thesis 7.3.3).
enum class MultigridCycle {
  kV,          ///< V-cycles as preconditioner, from zero
  kFull,       ///< nested iteration as start, then V-cycles
  kCascading,  ///< nested iteration with conjugate gradients on each level, no V-cycle
};

struct SolverOptions {
  Ordering ordering = Ordering::kAuto;
  std::uint64_t memory_bytes = 0;  ///< refuse what is predicted to need more; 0: no limit
  double tolerance = 1e-8;         ///< iterative: stop at this relative residual, of every column
  int max_iterations = 1000;       ///< iterative: cycles or steps
  /// Multigrid and automatic: order k of the Laplacian; from 2 on the interpolation is smooth and the cycle a W.
  int order = 1;
  MultigridCycle cycle = MultigridCycle::kFull;
  /// Multigrid: position of each unknown, n, for linear interpolation between levels. Empty: interpolation by
  /// the matrix alone (constants only, more cycles). Read by factor().
  std::span<const Double3> positions{};
  /// Multigrid: n x n, its pattern holds the mesh edges between unknowns (as mesh_neighbours() gives it).
  /// Null: the pattern of the matrix. Read by factor().
  const SparseMatrix* neighbours = nullptr;
};

/// The updated residual of an iteration may drift from the true one by this factor before it counts as lost.
inline constexpr double kResidualDrift = 10.0;

struct SolveReport {
  SolveStatus status = SolveStatus::kSolved;
  double residual = 0.0;  ///< measured |b - A x| / |b|, the largest of the columns
  int iterations = 0;     ///< 0 for direct solvers
  std::string message;    ///< one sentence when the status is not kSolved
};

struct FactorReport {
  SolveStatus status = SolveStatus::kSolved;
  std::string message;               ///< one sentence when the status is not kSolved
  std::int32_t unknown = -1;         ///< kSingular: whose pivot vanished, where the solver knows it
  std::uint64_t factor_entries = 0;  ///< nonzeros of the factor, preconditioner or all levels
  std::uint64_t bytes = 0;           ///< held after this step, without the matrix of the caller
  std::uint64_t peak_bytes = 0;  ///< most held at a time up to now; after analyse() a prediction for factor()
  double flops = 0.0;            ///< of the numeric factorization, 0 where unknown
  std::string choice;            ///< automatic: a sentence for the log, which solver and why
};

/// Tells of a matrix that is not positive definite. \param unknown  whose pivot is not positive
void set_singular(FactorReport& report, std::int32_t unknown);

class LinearSolver {
 public:
  virtual ~LinearSolver() = default;

  /// Orders and counts by the pattern alone. Again only when the pattern changes.
  virtual FactorReport analyse(const SparseMatrix& a) = 0;
  /// Takes the values.
  /// \pre same pattern as in analyse(), which has reported kSolved; the matrix lives, unchanged, until the
  ///       last solve()
  virtual FactorReport factor(const SparseMatrix& a) = 0;
  /// x for b, both n x width interleaved; iterative solvers start from zero. \pre factor() has reported kSolved
  virtual SolveReport solve(std::span<const double> b, std::span<double> x, int width) = 0;
};

[[nodiscard]] std::unique_ptr<LinearSolver> make_solver(SolverKind kind, const SolverOptions& options = {});

[[nodiscard]] const char* name(SolverKind kind);
[[nodiscard]] const char* name(Ordering ordering);
[[nodiscard]] const char* name(SolveStatus status);

}  // namespace tessera
