#include "kernels/change/near_cells.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace tessera {
namespace {

/// Widens ranges so that rounding leaves no cell out.
constexpr double kCellMargin = 1e-6;
constexpr double kAcross = 1e-12;  ///< an axis with less of a coordinate runs across it

/// The part of a segment whose coordinate lies in a range.
struct AxisPart {
  double begin = 0.0, end = 0.0;
  bool empty() const { return begin > end; }
};

/// A coordinate along a segment.
struct Slope {
  explicit Slope(double of_axis)
      : value(of_axis), inverse(1.0 / of_axis), across(std::abs(of_axis) < kAcross) {}
  double value, inverse;
  bool across;  ///< it does not change
};

AxisPart part_within(const AxisPart& part, double from, double to, const Slope& slope) {
  if (slope.across) return from > 0.0 || to < 0.0 ? AxisPart{0.0, -1.0} : part;
  const double u = from * slope.inverse, v = to * slope.inverse;
  return {std::max(part.begin, std::min(u, v)), std::min(part.end, std::max(u, v))};
}

/// Square of the distance of a coordinate from a cell.
double square_from(double coordinate, double low, double size) {
  const double d = std::max({low - coordinate, 0.0, coordinate - low - size});
  return d * d;
}

}  // namespace

void NearCells::add(const PointCells& cells, std::uint32_t k) {
  const PointCell& cell = cells.cells()[k];
  cell_.push_back(k);
  x_.push_back(cell.middle[0]), y_.push_back(cell.middle[1]), z_.push_back(cell.middle[2]);
  radius_.push_back(cell.radius);
}

/// Lanes behind the last cell meet nothing: they lie nowhere.
void NearCells::pad() {
  const std::size_t full = (cell_.size() + kDoubleLanes - 1) / kDoubleLanes * kDoubleLanes;
  constexpr double kNowhere = std::numeric_limits<double>::quiet_NaN();
  x_.resize(full, kNowhere), y_.resize(full, kNowhere), z_.resize(full, kNowhere);
  radius_.resize(full, kNowhere);
}

void NearCells::collect(const PointCells& cells, const Capsule& capsule) {
  cell_.clear(), x_.clear(), y_.clear(), z_.clear(), radius_.clear();
  if (cells.empty()) return;
  if (capsule.depth == 0.0) {
    collect_ball(cells, capsule.middle, capsule.radius);
  } else {
    collect_capsule(cells, capsule);
  }
  pad();
}

void NearCells::collect_ball(const PointCells& cells, const Double3& middle, double radius) {
  const double size = cells.size(), reach = radius + size * kCellMargin, square = reach * reach;
  const auto range = [&](std::size_t a, double half) {
    return std::array<std::int32_t, 2>{cells.cell_of(middle[a] - half), cells.cell_of(middle[a] + half)};
  };
  const std::array<std::int32_t, 2> xs = cells.columns_within(0, range(0, reach));
  const std::array<std::int32_t, 2> ys = cells.columns_within(1, range(1, reach));
  for (std::int32_t x = xs[0]; x <= xs[1]; ++x) {
    const double left_x = square - square_from(middle[0], x * size, size);
    for (std::int32_t y = ys[0]; y <= ys[1]; ++y) {
      const double left = left_x - square_from(middle[1], y * size, size);
      if (left < 0.0) continue;
      const std::array<std::int32_t, 2> zs = range(2, std::sqrt(left));
      cells.for_column_cells(x, y, zs[0], zs[1], [&](std::uint32_t k) { add(cells, k); });
    }
  }
}

void NearCells::collect_capsule(const PointCells& cells, const Capsule& c) {
  const double size = cells.size(), radius = c.radius + size * kCellMargin;
  const auto range = [&](std::size_t a, const AxisPart& part) {
    const double u = c.middle[a] + part.begin * c.axis[a], v = c.middle[a] + part.end * c.axis[a];
    return std::array<std::int32_t, 2>{cells.cell_of(std::min(u, v) - radius),
                                       cells.cell_of(std::max(u, v) + radius)};
  };
  const std::array<Slope, 2> slopes = {Slope(c.axis[0]), Slope(c.axis[1])};
  const auto within = [&](const AxisPart& part, std::int32_t cell, std::size_t a) {
    const double low = cell * size - c.middle[a];
    return part_within(part, low - radius, low + size + radius, slopes[a]);
  };
  const AxisPart whole = {-c.depth, c.depth};
  const std::array<std::int32_t, 2> xs = cells.columns_within(0, range(0, whole));
  for (std::int32_t x = xs[0]; x <= xs[1]; ++x) {
    const AxisPart slab = within(whole, x, 0);
    if (slab.empty()) continue;
    const std::array<std::int32_t, 2> ys = cells.columns_within(1, range(1, slab));
    for (std::int32_t y = ys[0]; y <= ys[1]; ++y) {
      if (cells.is_empty(x, y)) continue;
      const AxisPart part = within(slab, y, 1);
      if (part.empty()) continue;
      const std::array<std::int32_t, 2> zs = range(2, part);
      cells.for_column_cells(x, y, zs[0], zs[1], [&](std::uint32_t k) { add(cells, k); });
    }
  }
}

}  // namespace tessera
