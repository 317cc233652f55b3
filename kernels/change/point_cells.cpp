#include "kernels/change/point_cells.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

namespace tessera {
namespace {

/// Of a ball around points: rounding of its centre leaves none outside.
constexpr double kRoundUp = 1.0 + 1e-12;

struct SortedPoint {
  std::int32_t z = 0;
  std::uint32_t source = 0;
  Double3 p{};
};

bool stands_before(const SortedPoint& a, const SortedPoint& b) {
  if (a.z != b.z) return a.z < b.z;
  if (a.p[0] != b.p[0]) return a.p[0] < b.p[0];
  if (a.p[1] != b.p[1]) return a.p[1] < b.p[1];
  if (a.p[2] != b.p[2]) return a.p[2] < b.p[2];
  return a.source < b.source;
}

}  // namespace

PointCells::PointCells(std::span<const Double3> points, double size, bool moments)
    : size_(size), per_unit_(1.0 / size) {
  sort_points(points);
  make_cells();
  if (moments) add_moments();
}

std::int32_t PointCells::cell_of(double coordinate) const {
  constexpr double kFarthest = 0x1p30;
  return static_cast<std::int32_t>(std::clamp(std::floor(coordinate * per_unit_), -kFarthest, kFarthest));
}

/// A counting sort by column, then each column by itself.
void PointCells::sort_points(std::span<const Double3> points) {
  column_begin_.assign(1, 0);
  if (points.empty()) return;
  constexpr std::int32_t kLast = std::numeric_limits<std::int32_t>::max();
  std::array<std::int32_t, 2> low = {kLast, kLast}, high = {-kLast, -kLast};
  for (const Double3& p : points)
    for (std::size_t a = 0; a < 2; ++a) {
      const std::int32_t cell = cell_of(p[a]);
      low[a] = std::min(low[a], cell), high[a] = std::max(high[a], cell);
    }
  first_ = low, columns_ = {high[0] - low[0] + 1, high[1] - low[1] + 1};
  const std::size_t columns = static_cast<std::size_t>(columns_[0]) * static_cast<std::size_t>(columns_[1]);
  column_begin_.assign(columns + 1, 0);
  const auto column = [&](const Double3& p) { return column_of(cell_of(p[0]), cell_of(p[1])); };
  for (const Double3& p : points) ++column_begin_[column(p) + 1];
  for (std::size_t k = 1; k <= columns; ++k) column_begin_[k] += column_begin_[k - 1];
  std::vector<SortedPoint> sorted(points.size());
  for (std::size_t i = 0; i < points.size(); ++i)
    sorted[column_begin_[column(points[i])]++] = {cell_of(points[i][2]), static_cast<std::uint32_t>(i),
                                                  points[i]};
  std::uint32_t begin = 0;
  for (std::size_t k = 0; k < columns; ++k) {  // each begin has become its column's end
    std::sort(sorted.begin() + begin, sorted.begin() + column_begin_[k], stands_before);
    begin = std::exchange(column_begin_[k], begin);
  }
  x_.resize(points.size()), y_.resize(points.size()), z_.resize(points.size()), source_.resize(points.size());
  for (std::size_t i = 0; i < points.size(); ++i) {
    x_[i] = sorted[i].p[0], y_[i] = sorted[i].p[1], z_[i] = sorted[i].p[2];
    source_[i] = sorted[i].source;
  }
}

void PointCells::make_cells() {
  std::size_t count = 0;
  for (std::size_t k = 0; k + 1 < column_begin_.size(); ++k)
    for (std::uint32_t i = column_begin_[k]; i < column_begin_[k + 1]; ++i)
      count += i == column_begin_[k] || cell_of(z_[i]) != cell_of(z_[i - 1]) ? 1 : 0;
  cells_.reserve(count);
  for (std::size_t k = 0; k + 1 < column_begin_.size(); ++k) {
    const std::uint32_t begin = column_begin_[k], end = column_begin_[k + 1];
    column_begin_[k] = static_cast<std::uint32_t>(cells_.size());
    for (std::uint32_t i = begin; i < end;) {
      PointCell cell;
      cell.z = cell_of(z_[i]), cell.begin = i;
      Double3 low = position(i), high = low;
      for (; i < end && cell_of(z_[i]) == cell.z; ++i) {
        const Double3 p = position(i);
        for (std::size_t a = 0; a < 3; ++a)
          low[a] = std::min(low[a], p[a]), high[a] = std::max(high[a], p[a]);
      }
      cell.end = i;
      cell.middle = (low + high) * 0.5;
      const Double3 reach = high - cell.middle, other = cell.middle - low;
      double square = 0.0;
      for (std::size_t a = 0; a < 3; ++a) {
        const double r = std::max(reach[a], other[a]);
        square += r * r;
      }
      cell.radius = std::sqrt(square) * kRoundUp;
      for (std::size_t a = 0; a < 3; ++a)
        cell.centre[a] = (static_cast<double>(cell_of(low[a])) + 0.5) * size_;
      cells_.push_back(cell);
    }
  }
  column_begin_.back() = static_cast<std::uint32_t>(cells_.size());
}

void PointCells::add_moments() {
  moments_.resize(cells_.size());
  for (std::size_t k = 0; k < cells_.size(); ++k) {
    CellMoments& m = moments_[k];
    for (std::uint32_t i = cells_[k].begin; i < cells_[k].end; ++i) {
      const Double3 d = position(i) - cells_[k].centre;
      m.count += 1.0, m.sum = m.sum + d;
      m.xx += d[0] * d[0], m.xy += d[0] * d[1], m.xz += d[0] * d[2];
      m.yy += d[1] * d[1], m.yz += d[1] * d[2], m.zz += d[2] * d[2];
    }
  }
}

std::uint64_t PointCells::bytes(std::uint64_t points, std::uint64_t columns, bool moments) {
  // Every point may have a cell of its own.
  const std::uint64_t cell = sizeof(PointCell) + (moments ? sizeof(CellMoments) : 0);
  return points * (sizeof(SortedPoint) + 3 * sizeof(double) + sizeof(std::uint32_t) + cell) +
         (columns + 1) * sizeof(std::uint32_t);
}

}  // namespace tessera
