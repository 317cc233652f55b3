/// \file curvature_flow.h
/// Implicit curvature flow of a whole mesh, in core. Sources: Desbrun, Meyer, Schroeder, Barr 1999 (implicit fairing,
/// fresh geometry every step); Bobenko and Springborn 2007 (intrinsic Delaunay weights: no vertex drifts along the
/// surface, however obtuse the triangles); Botsch, thesis 6.2.3 (C0 boundaries).
#pragma once
#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <string>

#include "octree/vector.h"
#include "solvers/laplacian.h"
#include "solvers/linear_solver.h"

namespace tessera {

using FaceSpan = std::span<const std::array<std::uint32_t, 3>>;

struct FlowOptions {
  double step = 0.0;  ///< of one implicit step, squared length (order 1) or its square (order 2); > 0
  int steps = 1;
  int order = 1;  ///< 1 mean curvature flow, 2 surface diffusion; does not bend at fixed vertices
  LaplacianWeights weights = LaplacianWeights::kIntrinsicDelaunay;
  /// Direct: multigrid only where the factor would not fit. Not direct: multigrid always, so that the result has the
  /// same bits on every machine.
  bool direct = true;
  /// A factor that is predicted to need more is not tried: multigrid serves, or is refused; 0 = no limit
  std::uint64_t memory_bytes = 0;
};

struct FlowReport {
  std::size_t unknowns = 0;
  std::size_t degenerate_faces = 0;  ///< seen in the last step
  FactorReport factor;
  std::string choice;  ///< a sentence for the log, which solver and why
  SolveReport solve;
  std::size_t systems = 0;  ///< solved, over all steps: more than steps where a step was cut
  /// That would have folded: their vertices moved as one, counted in every step.
  std::size_t faces_as_one = 0;
  /// Faces that turn over and fold against more of their neighbours than before, even in the shortest part of a step:
  /// not 0 = no result.
  std::size_t folding_faces = 0;
  std::uint32_t first_folding = 0;  ///< the first of them
  [[nodiscard]] bool done() const {
    return factor.status == SolveStatus::kSolved && solve.status == SolveStatus::kSolved &&
           folding_faces == 0;
  }
};

/// `steps` times (M + step L) x' = M x, of order 2 (M + step L M^-1 L) x' = M x, with operators of the
/// current surface. Vertices with fixed != 0 stay. No step folds a face over: the vertices of the few that
/// would fold (slivers, what is folded already) move as one; where more would, the step is cut in halves,
/// down to 2^-10, each with fresh geometry.
/// \param position  n; unchanged unless the report says done()
/// \throws UsageError  order or steps out of range, wrong sizes.
/// \throws InputError  a position that is not finite
FlowReport curvature_flow(std::span<Double3> position, FaceSpan faces, std::span<const std::uint8_t> fixed,
                          const FlowOptions& options);

}  // namespace tessera
