#include "kernels/mesh/prism_volume.h"

#include <algorithm>
#include <cmath>

namespace tessera {
namespace {

double twice_area(const Double2& a, const Double2& b, const Double2& c) {
  return (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]);
}

/// A corner of a piece, with the height of the first surface over the second.
struct Corner {
  Double2 at;
  double difference;
};

/// Volume over a convex piece of which all differences have one sign.
double volume_over(std::span<const Corner> piece) {
  double sum = 0.0;
  for (std::size_t k = 2; k < piece.size(); ++k)
    sum += twice_area(piece[0].at, piece[k - 1].at, piece[k].at) *
           (piece[0].difference + piece[k - 1].difference + piece[k].difference) / 6.0;
  return sum;
}

double ring_area(const std::vector<Double2>& ring) {
  double sum = 0.0;
  for (std::size_t k = 2; k < ring.size(); ++k) sum += twice_area(ring[0], ring[k - 1], ring[k]);
  return 0.5 * sum;
}

}  // namespace

PlanTriangle::PlanTriangle(const Double3& a, const Double3& b, const Double3& c) {
  shadow_ = {{{a[0], a[1]}, {b[0], b[1]}, {c[0], c[1]}}};
  low_ = std::min({a[2], b[2], c[2]}), high_ = std::max({a[2], b[2], c[2]});
  const double area = twice_area(shadow_[0], shadow_[1], shadow_[2]);
  if (area == 0.0) return;
  facing_ = area > 0.0 ? 1 : -1;
  const Double3 u = b - a, v = c - a;
  slope_x_ = (u[2] * v[1] - v[2] * u[1]) / area;
  slope_y_ = (v[2] * u[0] - u[2] * v[0]) / area;
  z_ = a[2];
  if (facing_ < 0) std::swap(shadow_[1], shadow_[2]);
}

double PlanTriangle::height(const Double2& at) const {
  // The planes of faces that stand nearly upright are steep: rounding must not lead out of the face.
  return std::clamp(z_ + slope_x_ * (at[0] - shadow_[0][0]) + slope_y_ * (at[1] - shadow_[0][1]), low_,
                    high_);
}

PlanPiece::PlanPiece(const std::array<Double2, 3>& triangle) {
  std::copy(triangle.begin(), triangle.end(), corners_.begin());
}

void PlanPiece::clip(const std::array<Double2, 3>& triangle) {
  for (std::size_t e = 0; e < 3 && !empty(); ++e) {
    const Double2 &a = triangle[e], &b = triangle[(e + 1) % 3];
    std::array<double, kMaxCorners> side{};
    bool all = true;
    for (std::size_t k = 0; k < size_; ++k)
      side[k] = twice_area(a, b, corners_[k]), all = all && side[k] >= 0.0;
    if (all) continue;
    std::array<Double2, kMaxCorners> kept{};
    std::size_t count = 0;
    for (std::size_t k = 0; k < size_; ++k) {
      const std::size_t next = k + 1 < size_ ? k + 1 : 0;
      const Double2 &from = corners_[k], &to = corners_[next];
      if (side[k] >= 0.0 && count < kMaxCorners) kept[count++] = from;
      if ((side[k] < 0.0) == (side[next] < 0.0) || count == kMaxCorners) continue;
      const double t = side[k] / (side[k] - side[next]);
      kept[count++] = {from[0] + t * (to[0] - from[0]), from[1] + t * (to[1] - from[1])};
    }
    corners_ = kept, size_ = count;
  }
  if (empty()) size_ = 0;
}

double PlanPiece::area() const {
  double sum = 0.0;
  for (std::size_t k = 2; k < size_; ++k) sum += twice_area(corners_[0], corners_[k - 1], corners_[k]);
  return 0.5 * sum;
}

template <class Difference>
CutFill PlanPiece::integrate(Difference&& difference) const {
  if (empty()) return {};
  // A convex piece is cut once, but rounding may see it cut more often.
  std::array<Corner, 2 * kMaxCorners> above{}, below{};
  std::size_t above_count = 0, below_count = 0;
  Corner from = {corners_[size_ - 1], difference(corners_[size_ - 1])};
  for (std::size_t k = 0; k < size_; ++k) {
    const Corner to = {corners_[k], difference(corners_[k])};
    if ((from.difference < 0.0) != (to.difference < 0.0)) {
      const double t = from.difference / (from.difference - to.difference);
      const Corner level = {
          {from.at[0] + t * (to.at[0] - from.at[0]), from.at[1] + t * (to.at[1] - from.at[1])}, 0.0};
      above[above_count++] = level, below[below_count++] = level;
    }
    (to.difference < 0.0 ? below[below_count++] : above[above_count++]) = to;
    from = to;
  }
  return {area(), std::max(0.0, volume_over({above.data(), above_count})),
          std::max(0.0, -volume_over({below.data(), below_count}))};
}

CutFill PlanPiece::between(const PlanTriangle& first, const PlanTriangle& second) const {
  return integrate([&](const Double2& at) { return first.height(at) - second.height(at); });
}

CutFill PlanPiece::above(const PlanTriangle& first, double level) const {
  return integrate([&](const Double2& at) { return first.height(at) - level; });
}

std::vector<SignedTriangle> triangles_of_rings(std::span<const std::vector<Double2>> rings) {
  std::vector<SignedTriangle> triangles;
  for (std::size_t r = 0; r < rings.size(); ++r) {
    const std::vector<Double2>& ring = rings[r];
    if (ring.size() < 3) continue;
    const int wanted = (r == 0 ? 1 : -1) * (ring_area(ring) < 0.0 ? -1 : 1);
    // A fan about a corner: what it covers too much it takes away again.
    for (std::size_t k = 2; k < ring.size(); ++k) {
      SignedTriangle t = {{ring[0], ring[k - 1], ring[k]}, wanted};
      const double area = twice_area(t.corner[0], t.corner[1], t.corner[2]);
      if (area == 0.0) continue;
      if (area < 0.0) std::swap(t.corner[1], t.corner[2]), t.sign = -t.sign;
      triangles.push_back(t);
    }
  }
  return triangles;
}

}  // namespace tessera
