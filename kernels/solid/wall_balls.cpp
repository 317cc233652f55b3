#include "kernels/solid/wall_balls.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "octree/box_levels.h"
#include "octree/morton.h"
#include "octree/vector.h"

namespace tessera {
namespace {

constexpr double kNoBall = std::numeric_limits<double>::infinity();
constexpr double kSlack = 1.0 + 1e-9;  ///< boxes are left out only where rounding cannot matter

/// Through the origin and x, its centre on `inward`.
double radius_through(const Double3& x, const Double3& inward) {
  const double ahead = dot(inward, x);
  return ahead > 0.0 ? dot(x, x) / (2.0 * ahead) : kNoBall;
}

/// The smallest over the segment from a to b. Level sets of radius_through are balls, so along a line there is one minimum.
double radius_to_segment(const Double3& a, const Double3& b, const Double3& inward) {
  const Double3 ab = b - a;
  const double length = norm(ab);
  if (!(length > 0.0)) return radius_through(a, inward);
  const Double3 e = ab / length;
  const double aa = dot(a, a), ae = dot(a, e), da = dot(inward, a), de = dot(inward, e);
  // Where the derivative of (aa + 2 ae t + t^2) / (da + de t) vanishes, ahead of the origin.
  const double root = std::sqrt(std::max(0.0, da * da - 2.0 * ae * da * de + de * de * aa));
  double t = 0.0;
  if (da > 0.0) {
    t = (de * aa - 2.0 * ae * da) / (root + da);
  } else if (de != 0.0) {
    t = (root - da) / de;
  }
  return radius_through(a + e * std::clamp(t, 0.0, length), inward);
}

bool holds(const std::array<Double3, 3>& corner, const Double3& normal, const Double3& x) {
  for (std::size_t k = 0; k < 3; ++k)
    if (dot(cross(corner[(k + 1) % 3] - corner[k], x - corner[k]), normal) < 0.0) return false;
  return true;
}

}  // namespace

double wall_ball_radius(const WallSample& s, const std::array<Double3, 3>& corner) {
  const Double3 area = cross(corner[1] - corner[0], corner[2] - corner[0]);
  const double twice = norm(area);
  if (!(twice > 0.0)) return kNoBall;
  const Double3 outward = area / twice;
  const double across = dot(outward, s.inward);
  if (!(across >= kWallCosine)) return kNoBall;
  const std::array<Double3, 3> x = {corner[0] - s.position, corner[1] - s.position, corner[2] - s.position};
  const double height = dot(outward, x[0]);
  if (!(height > 0.0)) return kNoBall;  // it looks at the place from behind
  const double radius = height / (1.0 + across);
  if (holds(x, outward, (s.inward + outward) * radius)) return radius;
  return std::min({radius_to_segment(x[0], x[1], s.inward), radius_to_segment(x[1], x[2], s.inward),
                   radius_to_segment(x[2], x[0], s.inward)});
}

WallFaces::WallFaces(std::vector<std::array<Double3, 3>> faces) {
  Double3 low, high;
  low.fill(kNoBall);
  high.fill(-kNoBall);
  const auto middle = [](const std::array<Double3, 3>& f) { return (f[0] + f[1] + f[2]) / 3.0; };
  for (const auto& f : faces)
    for (std::size_t k = 0; k < 3; ++k)
      low[k] = std::min(low[k], middle(f)[k]), high[k] = std::max(high[k], middle(f)[k]);
  const double widest = std::max({high[0] - low[0], high[1] - low[1], high[2] - low[2]});
  const double scale = widest > 0.0 ? 1e6 / widest : 0.0;
  std::vector<std::pair<std::uint64_t, std::uint32_t>> order(faces.size());
  for (std::size_t f = 0; f < faces.size(); ++f) {
    const Double3 m = (middle(faces[f]) - low) * scale;
    order[f] = {morton_encode(static_cast<std::uint32_t>(m[0]), static_cast<std::uint32_t>(m[1]),
                              static_cast<std::uint32_t>(m[2])),
                static_cast<std::uint32_t>(f)};
  }
  std::sort(order.begin(), order.end());
  faces_.reserve(faces.size());
  for (const auto& [key, f] : order) faces_.push_back(faces[f]);
  std::vector<Box> boxes((faces_.size() + kLeaf - 1) / kLeaf);
  for (std::size_t b = 0; b < boxes.size(); ++b) {
    boxes[b].low = boxes[b].high = faces_[b * kLeaf][0];
    for (std::size_t f = b * kLeaf; f < std::min(faces_.size(), (b + 1) * kLeaf); ++f)
      for (const Double3& p : faces_[f])
        for (std::size_t k = 0; k < 3; ++k) {
          boxes[b].low[k] = std::min(boxes[b].low[k], p[k]);
          boxes[b].high[k] = std::max(boxes[b].high[k], p[k]);
        }
  }
  levels_ = box_levels(std::move(boxes), kChildren);
  bound_normals();
}

/// The side of the wall on which a place lies fills its ball too, as far as the ball is wide; its normals tell it at once.
void WallFaces::bound_normals() {
  const auto add = [](Box& box, const Float3& low, const Float3& high) {
    for (std::size_t k = 0; k < 3; ++k) {
      box.lowest_normal[k] = std::min(box.lowest_normal[k], low[k]);
      box.highest_normal[k] = std::max(box.highest_normal[k], high[k]);
    }
  };
  for (std::vector<Box>& level : levels_)
    for (Box& box : level) box.lowest_normal.fill(2.0f), box.highest_normal.fill(-2.0f);
  for (std::size_t f = 0; f < faces_.size(); ++f) {
    const Double3 area = cross(faces_[f][1] - faces_[f][0], faces_[f][2] - faces_[f][0]);
    const double twice = norm(area);
    if (!(twice > 0.0)) continue;
    const Float3 normal = narrow(area / twice);
    add(levels_[0][f / kLeaf], normal, normal);
  }
  for (std::size_t l = 1; l < levels_.size(); ++l)
    for (std::size_t b = 0; b < levels_[l - 1].size(); ++b)
      add(levels_[l][b / kChildren], levels_[l - 1][b].lowest_normal, levels_[l - 1][b].highest_normal);
}

void WallFaces::shrink(WallSample& s) const {
  const Double3& d = s.inward;
  const auto bound = [&](const Box& box) {
    double across = 0.0;  // no normal of the box has more along d
    for (std::size_t k = 0; k < 3; ++k)
      across += d[k] * static_cast<double>(d[k] > 0.0 ? box.highest_normal[k] : box.lowest_normal[k]);
    if (across < kWallCosine - 1e-5) return kNoBall;
    double ahead = 0.0;  // as far as the box goes
    for (std::size_t k = 0; k < 3; ++k)
      ahead += d[k] * ((d[k] > 0.0 ? box.high[k] : box.low[k]) - s.position[k]);
    if (!(ahead > 0.0)) return kNoBall;
    if (s.radius < kNoBall && square_to_box(box, s.position + d * s.radius) > s.radius * s.radius * kSlack)
      return kNoBall;
    return square_to_box(box, s.position) / (2.0 * ahead);
  };
  visit_nearest_boxes(
      levels_, kChildren, bound, [&](double least) { return least < kNoBall && least <= s.radius * kSlack; },
      [&](std::size_t leaf) {
        for (std::size_t f = leaf * kLeaf; f < std::min(faces_.size(), (leaf + 1) * kLeaf); ++f)
          s.radius = std::min(s.radius, wall_ball_radius(s, faces_[f]));
      });
}

}  // namespace tessera
