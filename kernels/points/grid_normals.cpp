#include "kernels/points/grid_normals.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdlib>
#include <limits>

#include "octree/small_matrix.h"

namespace tessera {
namespace {

constexpr double kAlongRay = 0.96984631039295421;  ///< square of the cosine of ten degrees
constexpr double kJump = 9.0;                      ///< square of how much longer a step is that jumps
constexpr int kMinGridNeighbours = 5;              ///< a plane through fewer is chance
constexpr double kMinLineRatio =
    0.0025;                             ///< of the larger eigenvalues: below it the neighbours lie on a line
constexpr double kFlat = 0.004;         ///< bend up to which the largest window is as good as any
constexpr double kSmaller = 0.5;        ///< a smaller window must be so much flatter
constexpr double kMaxPlaneRatio = 0.2;  ///< from here on there is no plane

constexpr int kWidth = 2 * kGridRadius + 1;

int sign_of(int v) {
  return (v > 0) - (v < 0);
}

/// Samples around the middle one, by line and cell.
class Window {
 public:
  Window(std::span<const GridLine* const, kGridLines> lines, std::int64_t cell) {
    for (int l = -kGridRadius; l <= kGridRadius; ++l)
      for (int c = -kGridRadius; c <= kGridRadius; ++c) {
        const GridLine* line = lines[static_cast<std::size_t>(l + kGridRadius)];
        at(l, c) = line ? line->find(cell + c) : nullptr;
      }
  }
  const Double3*& at(int l, int c) {
    return sample_[static_cast<std::size_t>((l + kGridRadius) * kWidth + c + kGridRadius)];
  }
  const Double3* inside(int l, int c) {
    return std::abs(l) <= kGridRadius && std::abs(c) <= kGridRadius ? at(l, c) : nullptr;
  }
  /// Forgets a cell that is not reached: nothing is reached over it.
  void drop(int l, int c) { at(l, c) = nullptr; }

 private:
  std::array<const Double3*, kGridLines * kGridLines> sample_{};
};

/// \param before, after  samples in front of `from` and behind `to`; null where there is none
bool is_jump(const Double3& from, const Double3& to, const Double3* before, const Double3* after) {
  const Double3 step = to - from;
  const double along = dot(step, from), square = dot(step, step);
  if (along * along < kAlongRay * square * dot(from, from)) return false;
  // Ground seen at a glance lies along the ray too, but so do the steps beside.
  if (!before && !after) return true;
  const Double3 adjacent = before ? from - *before : *after - to;
  return square > kJump * dot(adjacent, adjacent);
}

/// Sums over the neighbours so far.
struct Sums {
  double count = 1.0;  ///< with the middle, which is zero
  Double3 first{};
  std::array<double, 6> second{};  ///< xx xy xz yy yz zz
  void add(const Double3& d) {
    count += 1.0;
    first = first + d;
    second[0] += d[0] * d[0], second[1] += d[0] * d[1], second[2] += d[0] * d[2];
    second[3] += d[1] * d[1], second[4] += d[1] * d[2], second[5] += d[2] * d[2];
  }
};

struct Plane {
  Double3 normal{};
  /// The least eigenvalue against the middle one: strewn samples lie along the rays, and are thick in both others.
  double ratio = std::numeric_limits<double>::infinity();
};

Plane fit(const Sums& s) {
  if (s.count < kMinGridNeighbours + 1) return {};
  const Double3 m = {s.first[0] / s.count, s.first[1] / s.count, s.first[2] / s.count};
  const std::array<double, 6> covariance = {
      s.second[0] / s.count - m[0] * m[0], s.second[1] / s.count - m[0] * m[1],
      s.second[2] / s.count - m[0] * m[2], s.second[3] / s.count - m[1] * m[1],
      s.second[4] / s.count - m[1] * m[2], s.second[5] / s.count - m[2] * m[2]};
  const auto [values, n] = min_eigen3(covariance);
  if (!(values[1] > 0.0) || values[1] < kMinLineRatio * values[2]) return {};
  return {n, std::max(values[0], 0.0) / values[1]};
}

}  // namespace

void GridLine::put(std::int64_t cell, const Double3& sample) {
  constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
  const auto maximum = static_cast<std::int64_t>(kMaxGridCells);
  const auto count = static_cast<std::int64_t>(samples_.size());
  if (count == 0) {
    first_ = cell;
    samples_.push_back(sample);
    return;
  }
  // Differences of far cells do not fit: compare before subtracting.
  if (cell < first_ - maximum || cell > first_ + maximum) return;
  if (cell < first_) {
    if (first_ + count - cell > maximum) return;
    samples_.insert(samples_.begin(), static_cast<std::size_t>(first_ - cell), Double3{kNan, kNan, kNan});
    first_ = cell;
  } else if (cell - first_ >= count) {
    if (cell - first_ >= maximum) return;
    samples_.resize(static_cast<std::size_t>(cell - first_) + 1, Double3{kNan, kNan, kNan});
  }
  Double3& at = samples_[static_cast<std::size_t>(cell - first_)];
  if (at[0] != at[0]) at = sample;
}

Float3 grid_normal(std::span<const GridLine* const, kGridLines> lines, std::int64_t cell) {
  Window window(lines, cell);
  const Double3 p = *window.at(0, 0);
  std::array<Sums, kGridRadius> sums;
  for (int ring = 1; ring <= kGridRadius; ++ring) {
    Sums& s = sums[static_cast<std::size_t>(ring - 1)];
    if (ring > 1) s = sums[static_cast<std::size_t>(ring - 2)];
    for (int l = -ring; l <= ring; ++l)
      for (int c = -ring; c <= ring; c += std::abs(l) == ring ? 1 : 2 * ring) {
        const Double3* q = window.at(l, c);
        if (!q) continue;
        const int dl = std::abs(l) >= std::abs(c) ? sign_of(l) : 0;
        const int dc = std::abs(c) >= std::abs(l) ? sign_of(c) : 0;
        const Double3* from = window.at(l - dl, c - dc);
        if (!from || is_jump(*from, *q, window.inside(l - 2 * dl, c - 2 * dc), window.inside(l + dl, c + dc)))
          window.drop(l, c);
        else
          s.add(*q - p);
      }
  }
  Plane best = fit(sums.back());
  for (int ring = kGridRadius - 1; ring >= 1 && best.ratio > kFlat; --ring)
    if (const Plane smaller = fit(sums[static_cast<std::size_t>(ring - 1)]);
        smaller.ratio < kSmaller * best.ratio)
      best = smaller;
  if (!(best.ratio < kMaxPlaneRatio)) return {0, 0, 0};
  const double side = dot(best.normal, p) > 0.0 ? -1.0 : 1.0;
  return narrow({side * best.normal[0], side * best.normal[1], side * best.normal[2]});
}

}  // namespace tessera
