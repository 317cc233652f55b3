/// \file fairing.h
/// Fair surfaces by linear systems, in core: minimal-energy surfaces over a region, and implicit curvature
/// flow. Sources: Botsch, thesis 6.2.2 and 7.2 (Delta^k f = 0 with k fixed rings); Desbrun, Meyer, Schroeder,
/// Barr 1999.
#pragma once
#include <array>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "octree/lattice.h"
#include "solvers/laplacian.h"
#include "solvers/linear_solver.h"

namespace tessera {

using FaceSpan = std::span<const std::array<std::uint32_t, 3>>;

struct FairingOptions {
  int order =
      2;  ///< 1 membrane (C0), 2 thin plate (C1), 3 minimum variation (C2): as many fixed rings join smoothly
  int rounds =
      1;  ///< > 1: the operator is taken anew from the surface found, analysed once; for rough first guesses
  LaplacianWeights weights = LaplacianWeights::kClampedCotangent;
  /// The first round takes uniform weights: for regions whose positions mean nothing yet, as of a filled
  /// hole.
  bool ignore_geometry_first = false;
  /// A factor that is predicted to need more is not tried: multigrid serves, or is refused; 0 = no limit
  std::uint64_t memory_bytes = 0;
};

struct FairingReport {
  std::size_t unknowns = 0;
  std::size_t degenerate_faces = 0;  ///< seen in the last round
  FactorReport factor;
  std::string choice;  ///< a sentence for the log, which solver and why
  SolveReport
      solve;  ///< kSingular where a piece of the region sees no fixed vertex: positions are then unchanged
  bool done() const { return factor.status == SolveStatus::kSolved && solve.status == SolveStatus::kSolved; }
};

/// Moves the vertices of the region to the surface of least energy that continues the fixed rings around it.
/// Only `order` rings of faces around the region are read. Where the region reaches a border of the mesh, the
/// border is free (natural conditions). \param position  n; unchanged unless the report says done() \param
/// region    n flags, 1 = free \throws UsageError   order or rounds out of range, wrong sizes, no free vertex
/// \throws InputError   a position that is not finite
FairingReport fair_region(std::span<Double3> position, FaceSpan faces, std::span<const std::uint8_t> region,
                          const FairingOptions& options);

}  // namespace tessera
