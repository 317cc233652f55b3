/// \file hole_limit.h
/// Which holes of the welded mesh are filled: `--max-hole` as the stages read it.
#pragma once
#include <cstdint>
#include <limits>

#include "stream/points/plan.h"
#include "stream/points/reconstruct_options.h"
#include "stream/stages/surface/hole_files.h"

namespace tessera {

struct HoleLimit {
  std::uint32_t edges = 0;                                 ///< of the rim, at most; 0 = none are filled
  double width = std::numeric_limits<double>::infinity();  ///< cells: 4 area / length of the rim, at most
  double min_cosine = -1.0;                                ///< between faces that meet in a filling
  /// Of a batch of fillings.
  std::uint64_t filling_bytes() const { return edges > 0 ? batch_vertices(edges) * (24 + 48) : 0; }
};

/// auto: what is narrower than the support of a sample, in noisy scans, and where the filling folds no farther than a right
/// angle: beyond, the shreds at a border stand against each other, and a filling makes a spike of a gap. An exact scan
/// ends where it says.
inline HoleLimit hole_limit(const ReconstructOptions& options, const Plan& plan) {
  if (options.max_hole != "auto") return {options.max_hole_edges()};
  if (!options.smooths_border() || !(plan.noise_cells > 0.0)) return {};
  return {kMaxShortEdges, plan.radius_cells, 0.0};
}

}  // namespace tessera
