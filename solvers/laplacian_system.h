/// \file laplacian_system.h
/// Linear systems of Laplacians of order 1, 2, 3 with fixed vertices, and of implicit fairing steps.
/// Source: Botsch, thesis 6.2.2, 6.2.3 and 7.2 (symmetric form M (D M)^(k-1), boundary smoothness).
#pragma once
#include <cstdint>
#include <span>
#include <vector>

#include "solvers/laplacian.h"
#include "solvers/sparse_matrix.h"

namespace tessera {

/// A system in the free vertices alone: matrix x_free = load_free - coupling x_fixed.
struct ConstrainedSystem {
  SparseMatrix matrix;    ///< free x free, positive definite if every piece has a fixed vertex
  SparseMatrix coupling;  ///< free x fixed
  std::vector<std::int32_t> free_vertices;   ///< ascending
  std::vector<std::int32_t> fixed_vertices;  ///< ascending

  /// Right-hand side for the values of all n vertices (only fixed ones are read) and a load on all n vertices
  /// (empty: none).
  /// \return free x width, interleaved
  [[nodiscard]] std::vector<double> right_hand_side(std::span<const double> values, int width,
                                                    std::span<const double> load = {}) const;
  /// Writes the solution into the free vertices of `values` (n x width).
  void scatter(std::span<const double> solution, std::span<double> values, int width) const;
};

/// Splits a system over all vertices into free and fixed ones.
/// \pre fixed has a.rows flags, a is square
/// \throws UsageError  when no vertex is free
[[nodiscard]] ConstrainedSystem constrain(const SparseMatrix& a, std::span<const std::uint8_t> fixed);

/// (-1)^k L (M^-1 L)^(k-1): the Euler-Lagrange matrix of the membrane (1), thin plate (2) and minimum
/// variation (3) energy, positive semidefinite.
/// \throws UsageError  when order is not 1, 2 or 3
[[nodiscard]] SparseMatrix laplacian_power(const Laplacian& operators, int order);

/// The system Delta^k f = 0 on the free vertices; the first k rings of fixed vertices give the boundary
/// condition: C^(k-1).
/// \throws UsageError  order or sizes; no free vertex
[[nodiscard]] ConstrainedSystem laplacian_system(const Laplacian& operators, int order,
                                                 std::span<const std::uint8_t> fixed);

/// The same from a stiffness and the diagonals between its powers: (-1)^k L D_(k-1) ... D_1 L, k - 1 = scale.size().
/// Diagonals 1 / M give laplacian_system(); less at fixed vertices makes the boundary less smooth (thesis 6.2.3).
/// Symmetric when all diagonals agree within reach of the free vertices.
[[nodiscard]] ConstrainedSystem damped_laplacian_system(const SparseMatrix& stiffness,
                                                        std::span<const std::vector<double>> scale,
                                                        std::span<const std::uint8_t> fixed);

/// M + step (-1)^k L (M^-1 L)^(k-1): one implicit fairing step solves it against M f. Same pattern for every
/// step.
/// \pre step >= 0, squared length (k = 1), its k-th power for order k
[[nodiscard]] SparseMatrix implicit_step_matrix(const Laplacian& operators, double step, int order = 1);

/// The mesh edges between free vertices, for SolverOptions::neighbours: the stiffness restricted to them.
[[nodiscard]] SparseMatrix mesh_neighbours(const Laplacian& operators, const ConstrainedSystem& system);

}  // namespace tessera
