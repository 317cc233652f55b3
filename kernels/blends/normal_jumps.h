/// \file normal_jumps.h
/// Normal noise of a blend: how much the angles between faces vary, along it and across it (thesis 4.3, fig. 4.16). On
/// an ideal one no edge that runs across turns at all, and all edges that run along its arc turn by the same angle.
#pragma once
#include <array>
#include <cstdint>
#include <span>

#include "kernels/blends/fishbone_fit.h"

namespace tessera {

struct JumpSum {
  std::uint64_t edges = 0;
  double mean = 0.0;      ///< radians
  double variance = 0.0;  ///< radians squared
  /// What of the variance neighbours do not share: half the mean square of the differences between each edge's jump and
  /// that of the nearest other edge, on the way along the blend or across it, radians squared. Where jumps are independent
  /// it is the variance; what the blend itself does hardly counts: spines that bend, whose jumps fall with the cosine from
  /// flank to flank, and turns that change along the way. (Von Neumann, "Distribution of the ratio of the mean square
  /// successive difference to the variance", 1941.)
  double noise = 0.0;
};
struct NormalJumps {
  JumpSum along;  ///< over edges within 30 degrees of the ribs: what one meets on the way along the blend
  /// Over edges within 30 degrees of the spine that are, of one of their faces, the side nearest to its direction: of cells
  /// far longer than high the diagonals lie near it too, and do not turn.
  JumpSum across;
};

/// Of the edges between two of the faces whose middles lie on the arc of the fishbone, but for a twelfth at its sides
/// and a quarter of a rib at its ends: there the grid meets what it is stitched to.
/// \param faces  indices below position.size()
[[nodiscard]] NormalJumps normal_jumps(const Fishbone& bone, std::span<const Double3> position,
                                       std::span<const std::array<std::uint32_t, 3>> faces);

}  // namespace tessera
