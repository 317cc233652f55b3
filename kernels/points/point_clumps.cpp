#include "kernels/points/point_clumps.h"

#include <cmath>
#include <cstddef>

namespace tessera {

PointClumps find_clumps(std::span<const double> occupied, double edge, double points, double typical) {
  constexpr double kMaxRatio = 1.6;   // a line has 2
  constexpr double kMinCells = 64.0;  // fewer are the outline of the scan
  constexpr double kCoarser = 8.0;    // cells for a cell of a surface, where clumps join
  constexpr double kCrossed = 1.5;    // cells of edge e that a surface of area e^2 crosses
  constexpr double kMinPoints = 3.0;
  if (typical < kMinPoints) return {};
  std::size_t plateau = 0;
  double minimum = kMaxRatio;
  for (std::size_t k = 0; k + 1 < occupied.size() && occupied[k + 1] >= kMinCells; ++k) {
    const double ratio = occupied[k] / occupied[k + 1];
    if (ratio < minimum) minimum = ratio, plateau = k + 1;
  }
  if (plateau == 0) return {};
  const double clumps = occupied[plateau];
  for (std::size_t k = plateau + 1; k < occupied.size(); ++k) {
    if (occupied[k] * kCoarser > clumps || occupied[k] <= 0.0) continue;
    const double size = std::ldexp(edge, static_cast<int>(k));
    return {size * std::sqrt(occupied[k] / (kCrossed * clumps)), points / clumps};
  }
  return {};
}

}  // namespace tessera
