#include "kernels/edit/plane_cells.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "octree/small_matrix.h"

namespace tessera {
namespace {

constexpr int kAxisBits = 21, kMaxLevel = 6;
constexpr double kNormalSteps = 32768.0;
constexpr double kMeanPoints = 8.0, kPlanarShare = 0.5;
/// Of a plane: the spread along its normal against the lesser one in it, squared; that one against the larger one.
constexpr double kMaxThickness = 0.1, kMinBreadth = 0.1;
constexpr std::uint64_t kMinAround = 10;

using Cell = std::array<std::int64_t, 3>;

std::uint64_t key_of(const Cell& c) {
  return static_cast<std::uint64_t>(c[0]) << (2 * kAxisBits) | static_cast<std::uint64_t>(c[1]) << kAxisBits |
         static_cast<std::uint64_t>(c[2]);
}
Cell cell_of(std::uint64_t key) {
  constexpr std::uint64_t kMask = (std::uint64_t{1} << kAxisBits) - 1;
  return {static_cast<std::int64_t>(key >> (2 * kAxisBits)),
          static_cast<std::int64_t>(key >> kAxisBits & kMask), static_cast<std::int64_t>(key & kMask)};
}

struct Pair {
  std::size_t a, b;
};
std::size_t longest_axis(const Double3& v) {
  std::size_t axis = 0;
  for (std::size_t a = 1; a < 3; ++a)
    if (std::fabs(v[a]) > std::fabs(v[axis])) axis = a;
  return axis;
}

constexpr std::array<Pair, 6> kPairs = {{{0, 0}, {0, 1}, {0, 2}, {1, 1}, {1, 2}, {2, 2}}};

}  // namespace

void PlaneCells::Sums::add(const Sums& child, const std::array<std::int64_t, 3>& shift) {
  const auto n = static_cast<std::int64_t>(child.count);
  for (std::size_t k = 0; k < 6; ++k) {
    const auto [a, b] = kPairs[k];
    squares[k] +=
        child.squares[k] + shift[a] * child.sum[b] + shift[b] * child.sum[a] + shift[a] * shift[b] * n;
  }
  for (std::size_t a = 0; a < 3; ++a) {
    sum[a] += child.sum[a] + shift[a] * n;
    normal[a] += child.normal[a];
  }
  count += child.count;
}

PlaneCells::PlaneCells(const Double3& low, const Double3& high, double edge)
    : low_(low), high_(high), step_(edge / static_cast<double>(1 << kStepBits)) {}

void PlaneCells::add(const Double3& p, const Double3& normal) {
  for (std::size_t a = 0; a < 3; ++a)
    if (!(p[a] >= low_[a] && p[a] <= high_[a])) {
      ++outside_;
      return;
    }
  ++points_;
  Sums one;
  Cell cell;
  one.count = 1;
  for (std::size_t a = 0; a < 3; ++a) {
    const auto at = static_cast<std::int64_t>(std::floor((p[a] - low_[a]) / step_ + 0.5));
    cell[a] = at >> bits();
    one.sum[a] = at - (cell[a] << bits());
  }
  for (std::size_t k = 0; k < 6; ++k) one.squares[k] = one.sum[kPairs[k].a] * one.sum[kPairs[k].b];
  const Double3 n = unit_or_zero(normal);
  for (std::size_t a = 0; a < 3; ++a)
    one.normal[a] = static_cast<std::int64_t>(std::floor(n[a] * kNormalSteps + 0.5));
  cells_[key_of(cell)].add(one, {0, 0, 0});
  while (cells_.size() > kMaxCells && level_ < kMaxLevel) coarsen();
}

void PlaneCells::coarsen() {
  Cells coarse;
  for (const auto& [key, sums] : cells_) {
    const Cell c = cell_of(key);
    Cell parent, shift;
    for (std::size_t a = 0; a < 3; ++a) {
      parent[a] = c[a] >> 1;
      shift[a] = (c[a] & 1) << bits();
    }
    coarse[key_of(parent)].add(sums, shift);
  }
  cells_ = std::move(coarse);
  ++level_;
}

std::vector<PlaneCell> PlaneCells::planar() const {
  std::vector<std::uint64_t> keys;
  for (const auto& [key, sums] : cells_) keys.push_back(key);
  std::sort(keys.begin(), keys.end());
  std::vector<PlaneCell> out;
  for (const std::uint64_t key : keys) {
    const Cell c = cell_of(key);
    Sums around;
    for (std::int64_t dz = -1; dz <= 1; ++dz)
      for (std::int64_t dy = -1; dy <= 1; ++dy)
        for (std::int64_t dx = -1; dx <= 1; ++dx) {
          const Cell next = {c[0] + dx, c[1] + dy, c[2] + dz};
          if (next[0] < 0 || next[1] < 0 || next[2] < 0) continue;
          const auto found = cells_.find(key_of(next));
          if (found == cells_.end()) continue;
          const std::int64_t edge = std::int64_t{1} << bits();
          around.add(found->second, {dx * edge, dy * edge, dz * edge});
        }
    if (around.count < kMinAround) continue;
    const auto n = static_cast<double>(around.count);
    std::array<double, 6> covariance;
    for (std::size_t k = 0; k < 6; ++k)
      covariance[k] =
          static_cast<double>(around.squares[k]) / n - static_cast<double>(around.sum[kPairs[k].a]) / n *
                                                           (static_cast<double>(around.sum[kPairs[k].b]) / n);
    const MinEigen3 plane = min_eigen3(covariance);
    const Double3& spread = plane.values;
    if (!(spread[0] <= kMaxThickness * spread[1] && spread[1] >= kMinBreadth * spread[2])) continue;
    // Noise that a side of the cell cuts off would shift its mean: that of the cells above and below it counts.
    const std::size_t axis = longest_axis(plane.vector);
    Sums column;
    for (std::int64_t d = -1; d <= 1; ++d) {
      Cell next = c;
      next[axis] += d;
      if (next[axis] < 0) continue;
      std::array<std::int64_t, 3> shift{};
      shift[axis] = d * (std::int64_t{1} << bits());
      if (const auto found = cells_.find(key_of(next)); found != cells_.end())
        column.add(found->second, shift);
    }
    PlaneCell cell;
    Double3 side{};
    for (std::size_t a = 0; a < 3; ++a) {
      const double corner = static_cast<double>(c[a]) * static_cast<double>(std::int64_t{1} << bits());
      cell.at[a] =
          low_[a] + step_ * (corner + static_cast<double>(column.sum[a]) / static_cast<double>(column.count));
      side[a] = static_cast<double>(around.normal[a]);
    }
    cell.normal = plane.vector;
    const double agreed = dot(side, cell.normal);
    cell.oriented = std::fabs(agreed) > 0.5 * kNormalSteps * n ? 1 : 0;
    if (agreed < 0.0) cell.normal = -cell.normal;
    cell.points = static_cast<std::uint32_t>(
        std::min<std::uint64_t>(cells_.at(key).count, std::numeric_limits<std::uint32_t>::max()));
    out.push_back(cell);
  }
  return out;
}

std::vector<PlaneCell> PlaneCells::finish(PlaneCellReport& report) {
  report.points = points_;
  report.outside = outside_;
  std::vector<PlaneCell> best;
  double best_share = -1.0;
  for (; !cells_.empty(); coarsen()) {
    const auto count = static_cast<double>(cells_.size());
    const bool filled = static_cast<double>(points_) >= kMeanPoints * count;
    if (filled || level_ == kMaxLevel) {
      std::vector<PlaneCell> here = planar();
      const double share = static_cast<double>(here.size()) / count;
      if (share > best_share) {
        best_share = share;
        best = std::move(here);
        report.cells = cells_.size();
        report.edge = step_ * static_cast<double>(std::int64_t{1} << bits());
      }
    }
    if (best_share >= kPlanarShare || level_ == kMaxLevel) break;
  }
  cells_.clear();
  return best;
}

}  // namespace tessera
