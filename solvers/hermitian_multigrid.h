/// \file hermitian_multigrid.h
/// Conjugate gradients for a complex Hermitian system (A + iK) z = b, A a real Laplacian and K real, antisymmetric
/// and with entries in a few rows alone: the least-squares conformal map with a free border (Levy, Petitjean, Ray,
/// Maillot 2002), where K is the area. Both coordinates run through one hierarchy, that of A, as one column of
/// complex numbers: the levels take a tenth of what a factor takes.
///
/// Holomorphic functions have next to no energy, whatever their values at the border: of (k h)^2 relative to their
/// Dirichlet energy, at k waves along the border and mesh width h. Linear interpolation between levels adds
/// (k H)^2. Smooth interpolation adds less, so all levels but the finest use it where they shrink fast, and take a
/// W-cycle. To 1e-8 that is 120 to 280 cycles for 10^5 to 10^6 vertices; a Laplacian takes 30.
#pragma once
#include <array>
#include <optional>
#include <span>
#include <vector>

#include "octree/vector.h"
#include "solvers/envelope_cholesky.h"
#include "solvers/linear_solver.h"
#include "solvers/multigrid_levels.h"

namespace tessera {

class HermitianMultigrid {
 public:
  /// \param positions  of the unknowns, read here alone. Both matrices live, unchanged, as long as the solver.
  /// \pre both n x n, A + iK positive definite
  HermitianMultigrid(const SparseMatrix& a, const SparseMatrix& skew, std::span<const Double3> positions);
  /// kSolved, kNotFinite, kSingular or kTooLarge; solve() only after kSolved.
  [[nodiscard]] const FactorReport& report() const { return report_; }
  /// Improves z from its current value until |b - (A + iK) z| <= tolerance |b|. Vectors are n x 2: real and
  /// imaginary parts interleaved.
  SolveReport solve(std::span<const double> b, std::span<double> z, double tolerance, int max_iterations);

 private:
  void cycle(std::size_t k);
  void factor_coarsest();

  MultigridLevels levels_;
  std::optional<EnvelopeCholesky> coarsest_;  ///< of the last level as a real matrix of twice the size
  std::vector<std::vector<double>> x_, b_;    ///< by level
  FactorReport report_;
};

}  // namespace tessera
