#include "kernels/boolean/exact_winding.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace tessera {

ExactWinding::ExactWinding(const PointTable& points, std::span<const std::array<std::uint32_t, 3>> faces)
    : points_(points), faces_(faces) {
  constexpr double kFar = std::numeric_limits<double>::infinity();
  Double3 low = {kFar, kFar, kFar}, high = {-kFar, -kFar, -kFar};
  for (const auto& f : faces)
    for (const std::uint32_t v : f)
      for (std::size_t k = 0; k < 3; ++k) {
        low[k] = std::min(low[k], points.near(v)[k]);
        high[k] = std::max(high[k], points.near(v)[k]);
      }
  if (faces.empty()) return;
  top_ = high[2];
  boxes_ = FaceBoxes(low, high);
  std::vector<FaceBoxes::Box> boxes;
  boxes.reserve(faces.size());
  for (const auto& f : faces)
    boxes.push_back(
        boxes_.box(std::array<Double3, 3>{points.near(f[0]), points.near(f[1]), points.near(f[2])}));
  boxes_.build(boxes, FaceBoxes::Order::kMorton);
}

/// Of the line from a to b the side of the point, seen from above; the point is a little to the right and far less up.
int ExactWinding::side(std::uint32_t a, std::uint32_t b, std::uint32_t point) const {
  const int sign = points_.orient2d(a, b, point, 0, 1);
  if (sign != 0) return sign;
  const Double3 &p = points_.near(a), &q = points_.near(b);
  if (p[1] != q[1]) return p[1] > q[1] ? 1 : -1;
  return q[0] > p[0] ? 1 : q[0] < p[0] ? -1 : 0;
}

int ExactWinding::at(std::uint32_t point, const std::function<bool(std::uint32_t)>& counts) const {
  if (faces_.empty()) return 0;
  const Double3& p = points_.near(point);
  // A point that was rounded lies within the boxes' steps of what it stands for, or nearly: one ulp more.
  Double3 low, high;
  for (std::size_t k = 0; k < 3; ++k) {
    const double off = std::fabs(p[k]) * 0x1p-52;
    low[k] = p[k] - off, high[k] = p[k] + off;
  }
  high[2] = std::max(high[2], top_);
  int winding = 0;
  boxes_.for_meeting(boxes_.box(std::array<Double3, 2>{low, high}), [&](std::uint32_t f) {
    const auto& [a, b, c] = faces_[f];
    const int turn = side(a, b, point);
    if (turn == 0 || side(b, c, point) != turn || side(c, a, point) != turn || !counts(f)) return true;
    if (points_.orient3d(a, b, c, point) == -turn) winding += turn;
    return true;
  });
  return winding;
}

}  // namespace tessera
