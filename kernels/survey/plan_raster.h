/// \file plan_raster.h
/// A mesh seen from above, cell by cell: the highest and the lowest face under the centre of every cell, with height, slope
/// and colour of the plane of that face there. Every cell is sampled exactly, none takes anything from another one.
/// Whether a centre lies in a face is decided exactly (orientation_sign.h), so faces that share an edge leave no gap, and the
/// result hangs neither on the order of faces nor on which of their corners comes first.
#pragma once
#include <array>
#include <cstdint>
#include <limits>
#include <vector>

#include "octree/vector.h"

namespace tessera {

/// A rectangle of cells of a raster, whose rows count southwards from its upper edge.
struct RasterWindow {
  std::int64_t column = 0, row = 0;    ///< of the first cell
  std::int64_t columns = 0, rows = 0;  ///< > 0
  [[nodiscard]] std::size_t size() const { return static_cast<std::size_t>(columns * rows); }
};

/// What lies under the centre of a cell.
struct RasterCell {
  static constexpr double kNone = std::numeric_limits<double>::infinity();
  double top = -kNone;    ///< height of the highest face; -kNone where there is none
  double ground = kNone;  ///< of the lowest
  /// Of the highest face: rise of its plane along x and y, at most kMaxGradient. Of equal heights the largest counts.
  float gradient_x = -std::numeric_limits<float>::max(), gradient_y = 0.0F;
  std::uint32_t rgba = 0;  ///< of the highest face; alpha 255, or 0 where it has no colour
  [[nodiscard]] bool covered() const { return top > -kNone; }
};

class PlanRaster {
 public:
  static constexpr double kMaxGradient = 1e6;

  /// \param cell  edge of a cell, > 0, finite
  PlanRaster(const RasterWindow& window, double cell);

  /// A face, either side up; one that stands upright covers no cell.
  /// \param corner  x and y relative to the upper left corner of the raster (cells lie at x >= 0, y <= 0), finite
  /// \param rgba    of the corners, alpha 0 = no colour; null = none has one
  void add(const std::array<Double3, 3>& corner, const std::array<std::uint32_t, 3>* rgba);

  [[nodiscard]] const RasterWindow& window() const { return window_; }
  /// Row by row, from the upper left.
  [[nodiscard]] const std::vector<RasterCell>& cells() const { return cells_; }

 private:
  struct Face;
  void sample(const Face& face, double x, double y, RasterCell& cell) const;

  RasterWindow window_;
  double cell_;
  std::vector<RasterCell> cells_;
};

}  // namespace tessera
