/// \file coarse_level.h
/// The coarse level of implicit smoothing: few unknowns for the long wavelengths that a filter of fixed degree cannot
/// reach, on a mesh of any size.
///
/// Unknowns are values at the corners of a cubic grid, interpolated trilinearly: linear displacements are exact. A
/// corner has one unknown for every connected piece of the mesh within its eight cells, so that the two sides of
/// a thin wall move apart; free vertices and vertices of lines (surface_rows.h) form pieces of their own. An unknown is
/// named by the smallest key in its piece and the parity of its corner (in the upper three bits). Other vertices do not move.
///
/// Order 1: (D + lambda (D - W)) d = residual, the system of the implicit filter (polynomial_filter.h). Order 2: the
/// same with i sqrt(lambda) in the place of lambda and complex values, moved and bend, so first derivatives serve for a
/// plate too. It is tested with the unknowns of each vertex's own kind: lines do not see the surface, so their block is
/// solved first. A little stiffness between the values that a vertex is interpolated from keeps the matrix definite: a
/// flat sheet does not tell the corners above it from those below. All that concerns a vertex depends on its
/// surroundings alone; sums are taken over the vertices that the caller names, in their order. Sources: Galerkin coarse
/// levels, Botsch, thesis 7.3.3; trilinear functions on a surface, Olshanskii, Reusken, Grande 2009; plates in mixed
/// form, Ciarlet and Raviart 1974.
#pragma once
#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "kernels/mesh/mesh_block.h"
#include "kernels/smooth/surface_rows.h"

namespace tessera {

struct CoarseOptions {
  double cell = 0.0;  ///< edge of the grid's cells, scan units; > 0. The grid is aligned to the world's zero
  int order = 1;      ///< of the filter
  double lambda = 10.0;    ///< of the filter; order 2: its root
  double stiffness = 0.0;  ///< in units of lambda D
  int degree = 0;          ///< Chebyshev steps that go with it
  double lowest = 0.0;     ///< and the least eigenvalue that they are for (FilterOptions)
};

/// The grid for a mesh, and the filter that takes what it leaves: from numbers of the whole mesh alone.
/// \param edge  root mean square length of its edges
[[nodiscard]] CoarseOptions coarse_options(double lambda, int order, double edge, std::uint64_t faces);

/// How far from a vertex its unknowns reach, beyond its ring.
double coarse_halo(const CoarseOptions& options);

/// Corners of the cell that a vertex lies in.
constexpr std::size_t kCoarseCorners = 8;

/// The unknowns that a block sees, and the interpolation from them.
struct CoarseBasis {
  static constexpr std::uint32_t kNone = ~std::uint32_t{0};
  std::vector<std::uint64_t> name;    ///< of the unknowns, ascending
  std::vector<std::uint32_t> seed;    ///< the vertex with the smallest key
  std::vector<std::uint8_t> on_line;  ///< the piece is of a crease or border
  /// n; vertices of one patch, connected inside a cell, are interpolated from the same unknowns; kNone: does not move.
  std::vector<std::uint32_t> patch;
  std::vector<std::array<std::uint32_t, kCoarseCorners>> unknown;  ///< of each patch, or kNone
  std::vector<std::array<float, kCoarseCorners>> weight;  ///< n; >= 0, 0 for kNone; sum to 1, or 0 for all
  std::vector<std::uint8_t> right;                        ///< n; all that the row depends on is in the block

  /// sink(unknown, weight) for all that the vertex is interpolated from.
  template <class Sink>
  void for_unknowns(std::uint32_t v, const Sink& sink) const {
    if (patch[v] == kNone) return;
    for (std::size_t k = 0; k < kCoarseCorners; ++k)
      if (const std::uint32_t u = unknown[patch[v]][k]; u != kNone)
        sink(u, static_cast<double>(weight[v][k]));
  }
};

/// \pre the rows are the block's own; keys below 2^61
/// \throws InputError for a position farther than 10^9 cells from zero
[[nodiscard]] CoarseBasis make_coarse_basis(const MeshBlock& block, const SurfaceRows& rows,
                                            const CoarseOptions& options);

/// One entry of the Galerkin matrices, summed over some vertices.
struct CoarseEntry {
  std::uint64_t row = 0, column = 0;  ///< names
  double mass = 0.0;                  ///< of D
  double stiffness = 0.0;             ///< of D - W
};
/// One entry of a right-hand side, summed over some vertices.
struct CoarseLoad {
  std::uint64_t row = 0;
  Double3 moved = {0, 0, 0};
  Double3 laplacian = {0, 0, 0};  ///< order 2
};

/// What the vertices add to the matrices, by row and column.
/// \param vertices  ascending
/// \throws std::logic_error when one of them or of their neighbours is not `right`
[[nodiscard]] std::vector<CoarseEntry> coarse_matrix(const SurfaceRows& rows, const CoarseBasis& basis,
                                                     std::span<const std::uint32_t> vertices,
                                                     const CoarseOptions& options);

/// Where vertices are in the middle of an implicit step.
struct StepState {
  std::span<const Double3> from;      ///< n: where it began
  std::span<const Double3> now;       ///< n
  std::span<const Float3> laplacian;  ///< order 2: n, or empty: zero
};

/// What they add to the right-hand side, the residual of the step.
[[nodiscard]] std::vector<CoarseLoad> coarse_load(const SurfaceRows& rows, const CoarseBasis& basis,
                                                  const StepState& state,
                                                  std::span<const std::uint32_t> vertices,
                                                  const CoarseOptions& options);

/// Bytes that make_coarse_basis() takes, and most of them keeps, for a block of so many vertices.
[[nodiscard]] std::uint64_t coarse_basis_bytes(std::uint64_t vertices);

}  // namespace tessera
