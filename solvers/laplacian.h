/// \file laplacian.h
/// Laplace-Beltrami operator of a triangle mesh: stiffness matrix and lumped mass.
/// Source: Pinkall and Polthier 1993; Desbrun, Meyer, Schroeder, Barr 1999; Meyer, Desbrun, Schroeder, Barr
/// 2003; intrinsic Delaunay weights: Bobenko and Springborn 2007. Only + - * / sqrt: the same bits on every
/// machine.
///
/// Delta f = M^-1 L f, with L_ij = (cot alpha_ij + cot beta_ij) / 2 and M_ii the mixed Voronoi area, is the
/// Laplacian of the surface: -Delta x^2 + ... has no further factor. (The thesis prints 2 / A; that is
/// another constant, and drops out of every system with a zero right-hand side.)
#pragma once
#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "octree/vector.h"
#include "solvers/sparse_matrix.h"

namespace tessera {

/// n positions, m faces, none of them owned. Indices are below n; a face may be degenerate.
struct TriangleSpan {
  std::span<const Double3> positions;
  std::span<const std::array<std::uint32_t, 3>> faces;
};

enum class LaplacianWeights {
  kCotangent,  ///< exact for linear functions; negative where opposite angles sum to more than 180 degrees
  kClampedCotangent,   ///< negative weights become 0: a maximum principle holds, linear precision is lost
                       ///< there
  kIntrinsicDelaunay,  ///< edges flipped inside the surface until no weight is negative (closed or bordered
                       ///< mesh)
  kUniform,  ///< weight 1 on every edge, mass = number of neighbours: Taubin's umbrella, no geometry
};

struct LaplacianOptions {
  LaplacianWeights weights = LaplacianWeights::kCotangent;
  /// A face counts as degenerate when twice its area is below this times its squared longest edge.
  double degenerate_ratio = 1e-10;
};

struct LaplacianReport {
  /// Left out of stiffness and mass (their edges keep a place in the pattern); kIntrinsicDelaunay heals them.
  std::size_t degenerate_faces = 0;
  std::int64_t first_degenerate = -1;  ///< index of the first of them, -1 without
  std::size_t negative_weights = 0;    ///< edges whose weight is negative (after flips; before clamping)
  std::size_t flips = 0;               ///< intrinsic flips made
  std::size_t unflippable = 0;  ///< intrinsic edges left that are not Delaunay (non-manifold, or flip limit)
  std::size_t massless_vertices = 0;  ///< without any sound face: mass set to the smallest positive mass
};

struct Laplacian {
  SparseMatrix
      stiffness;  ///< L: n x n, symmetric, negative semidefinite but for rounding, rows sum to 0, no unit
  std::vector<double> mass;  ///< diagonal of M: n, > 0, squared length (kUniform: number of neighbours)
  LaplacianReport report;
};

/// \throws InputError  naming the first face with an index >= n or the first vertex of a face that is not
/// finite;
///                     no faces with positive area at all (but for kUniform)
/// \throws ResourceError  at 2^31 entries or more
[[nodiscard]] Laplacian laplacian(const TriangleSpan& mesh, const LaplacianOptions& options = {});

}  // namespace tessera
