/// \file point_raster.h
/// Points seen from above, cell by cell: how many there are, the highest of them, the lowest of the ground, and colour and
/// intensity of the surface that is seen. A point counts in the cell that it lies in, and in no other one: nothing is
/// interpolated. The surface that is seen are the points of a cell that lie at most `depth` below its highest one, so walls
/// below an edge do not smear into what lies above them. All is counted by integers or compared: the order of points makes no
/// difference.
#pragma once
#include <cstddef>
#include <cstdint>
#include <limits>
#include <vector>

namespace tessera {

/// What the points of a cell tell.
struct ScanCell {
  static constexpr double kNone = std::numeric_limits<double>::infinity();
  double top = -kNone;    ///< the highest; -kNone without any
  double ground = kNone;  ///< the lowest of those that are ground; kNone without any
  std::uint64_t count = 0;
  /// Sums over the surface that is seen, and how many of its points have a colour, an intensity.
  std::uint64_t red = 0, green = 0, blue = 0, coloured = 0;
  std::uint64_t intensity_sum = 0, measured = 0;

  [[nodiscard]] bool covered() const { return count > 0; }
  [[nodiscard]] bool has_ground() const { return ground < kNone; }
  /// Mean colour of the surface that is seen, rounded; alpha 255, or 0 where none is known.
  [[nodiscard]] std::uint32_t rgba() const;
  /// Mean intensity of it. \pre measured > 0
  double intensity() const { return static_cast<double>(intensity_sum) / static_cast<double>(measured); }
};

/// Index of the cell of one axis that a coordinate lies in: k where k * cell <= x < (k + 1) * cell, in doubles.
/// \pre |x / cell| < 2^52
double cell_index(double x, double cell);

class PointRaster {
 public:
  /// \param depth  of the surface that is seen, >= 0
  PointRaster(std::size_t cells, double depth) : depth_(depth), cells_(cells) {}

  /// All points first, in any order. \param ground  of the class ground
  void add(std::size_t cell, double z, bool ground);
  /// Then all of them again. \param rgba  alpha 0 = no colour \param intensity  negative = none
  void add_seen(std::size_t cell, double z, std::uint32_t rgba, std::int32_t intensity);

  [[nodiscard]] const std::vector<ScanCell>& cells() const { return cells_; }

 private:
  double depth_;
  std::vector<ScanCell> cells_;
};

}  // namespace tessera
