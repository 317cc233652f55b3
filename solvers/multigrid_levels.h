/// \file multigrid_levels.h
/// A hierarchy of coarser systems for multigrid on irregular meshes.
///
/// Unknowns are gathered into clusters along short mesh edges (so anisotropic meshes coarsen where they are
/// dense first); the seed of each cluster is an unknown of the next level, the clusters that touch are its
/// mesh. The interpolation is linear for a Laplacian and smooth for higher orders, the coarse matrix is P^T A
/// P. Chosen over the thesis's halfedge collapses: levels shrink at once by a constant factor, about 8, and
/// nothing but a graph with positions is needed. Source: Wiersma, Nasikun, Eisemann, Hildebrandt 2023;
/// clusters as Vanek, Mandel, Brezina 1996.
#pragma once
#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "octree/vector.h"
#include "solvers/sparse_matrix.h"

namespace tessera {

/// Interpolation to a level from the next coarser one, as SparseMatrix but for single precision.
struct Prolongation {
  std::vector<std::int32_t> start, column;
  std::vector<float> weight;
};

struct MultigridLevel {
  SparseMatrix own;                      ///< P^T A P of the finer level; empty on the finest
  const SparseMatrix* matrix = nullptr;  ///< &own, or the caller's
  SparseMatrix own_skew;                 ///< as `own`, of MultigridLevelsOptions::skew
  const SparseMatrix* skew = nullptr;    ///< &own_skew, or the caller's, or none
  std::vector<double> inverse_diagonal;
  Prolongation prolongation;  ///< rows: this level, columns: next coarser; empty on the coarsest
};

struct MultigridLevelsOptions {
  int order = 1;  ///< of the Laplacian; from 2 on all levels are smooth
  /// Order 1: interpolation to a level that has at most this share of the finer one's unknowns is smooth, as for
  /// order 2; to the finest it is linear.
  double smooth_share = 0.0;
  std::int32_t coarsest = 1000;          ///< stop at so few unknowns
  std::span<const Double3> positions{};  ///< n, or empty: constant interpolation
  const SparseMatrix* skew = nullptr;  ///< antisymmetric: the levels are of a + i skew, with the weights of a
  const SparseMatrix* neighbours = nullptr;  ///< mesh edges by its pattern; null: the pattern of the matrix
};

struct MultigridLevels {
  std::vector<MultigridLevel> levels;  ///< finest first
  std::size_t checked_out = 0;         ///< rows whose smooth interpolation failed its check and is linear
  [[nodiscard]] std::uint64_t bytes() const;  ///< without the caller's matrix
  [[nodiscard]] std::size_t entries() const;  ///< of all matrices and prolongations but the caller's matrix
};

/// \pre a is symmetric with a positive diagonal and lives, unmoved, as long as the result
[[nodiscard]] MultigridLevels multigrid_levels(const SparseMatrix& a, const MultigridLevelsOptions& options);

}  // namespace tessera
