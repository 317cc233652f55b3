/// \file grid_normals.h
/// Normals of a scan from its rows and columns: who lies beside a sample in the grid was seen beside it, so nothing is
/// searched for, what lies behind a thin wall is no neighbour, and the side is the scanner's.
/// Source: planes as in Hoppe et al., "Surface Reconstruction from Unorganized Points", 1992, over the neighbours in the
/// grid (as in Holzer et al., "Adaptive Neighborhood Selection for Real-Time Surface Normal Estimation", 2012, where depth
/// jumps bound them too); the window is the one of 7 x 7, 5 x 5 or 3 x 3 samples that is flattest for its size.
#pragma once
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "octree/vector.h"

namespace tessera {

inline constexpr int kGridRadius = 3;                           ///< lines and cells to either side
inline constexpr std::size_t kGridLines = 2 * kGridRadius + 1;  ///< of a window
inline constexpr std::size_t kMaxGridCells = 20480;             ///< of a line

/// A row or a column of a scan.
class GridLine {
 public:
  /// Puts a sample into a cell; the first one of a cell stays. What lies more than kMaxGridCells away from the cells that
  /// are there has no place. \param sample  relative to the scanner, finite
  void put(std::int64_t cell, const Double3& sample);
  /// The sample of a cell; null where there is none.
  [[nodiscard]] const Double3* find(std::int64_t cell) const {
    const std::int64_t at = cell - first_;
    if (at < 0 || at >= static_cast<std::int64_t>(samples_.size())) return nullptr;
    const Double3& p = samples_[static_cast<std::size_t>(at)];
    return p[0] == p[0] ? &p : nullptr;
  }
  void clear() { samples_.clear(); }

 private:
  std::int64_t first_ = 0;
  std::vector<Double3> samples_;  ///< NaN: none
};

/// Normal of one sample, unit, towards the scanner; zero where fewer than five neighbours are reached, where they lie on a
/// line, or where no window is nearly flat.
/// A neighbour is reached from the cell before it on the way from the middle, over steps that are no jumps: a step is one
/// where it goes along the ray of sight (within ten degrees) and is more than three times as long as the step before it, or,
/// where there is none, behind it.
/// \param lines  consecutive ones around that of the sample, which is in the middle; null where the grid has none
/// \pre the middle line has a sample in the cell
/// \cost  about 0.3 us
[[nodiscard]] Float3 grid_normal(std::span<const GridLine* const, kGridLines> lines, std::int64_t cell);

}  // namespace tessera
