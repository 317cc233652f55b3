#include "kernels/solid/triangle_windings.h"

#include <algorithm>
#include <cmath>

#include "octree/portable_math.h"

namespace tessera {
namespace {

constexpr std::uint32_t kLeafTriangles = 8;
/// From so many radii on a node counts as far: what its second moments would add is below 0.005 in all.
constexpr double kFarRadii = 5.0;

/// Over 4 pi: the part of all directions that the triangle covers from the origin. Source: Van Oosterom, Strackee, "The Solid Angle
/// of a Plane Triangle", 1983.
double covered_part(const Double3& a, const Double3& b, const Double3& c) {
  const double la = norm(a), lb = norm(b), lc = norm(c);
  const double over = dot(a, cross(b, c));
  const double under = la * lb * lc + dot(a, b) * lc + dot(b, c) * la + dot(c, a) * lb;
  if (over == 0.0) return 0.0;  // in the plane of the triangle, or no triangle
  const double half = angle_between({1.0, 0.0, 0.0}, unit(Double3{under, std::fabs(over), 0.0}));
  return std::copysign(half, over) / (2.0 * kPi);
}

Double3 middle(const Double3& a, const Double3& b, const Double3& c) {
  return (a + b + c) * (1.0 / 3.0);
}

}  // namespace

TriangleWindings::TriangleWindings(std::span<const Double3> position,
                                   std::span<const std::array<std::uint32_t, 3>> faces) {
  triangles_.reserve(faces.size());
  for (const auto& f : faces) triangles_.push_back({position[f[0]], position[f[1]], position[f[2]]});
  if (!triangles_.empty()) build(0, static_cast<std::uint32_t>(triangles_.size()));
}

std::uint32_t TriangleWindings::build(std::uint32_t first, std::uint32_t end) {
  Node node;
  node.first = first;
  node.end = end;
  Double3 low{}, high{}, weighted{}, plain{};
  double area = 0.0;
  for (std::uint32_t t = first; t < end; ++t) {
    const auto& [a, b, c] = triangles_[t];
    const Double3 at = middle(a, b, c), normal = triangle_normal(a, b, c) * 0.5;
    const double size = norm(normal);
    area += size;
    weighted = weighted + at * size;
    plain = plain + at;
    node.dipole = node.dipole + normal;
    for (std::size_t k = 0; k < 3; ++k) {
      low[k] = t == first ? at[k] : std::min(low[k], at[k]);
      high[k] = t == first ? at[k] : std::max(high[k], at[k]);
    }
  }
  node.centre = area > 0.0 ? weighted * (1.0 / area) : plain * (1.0 / static_cast<double>(end - first));
  for (std::uint32_t t = first; t < end; ++t) {
    const auto& [a, b, c] = triangles_[t];
    for (const Double3& corner : {a, b, c}) node.radius = std::max(node.radius, norm(corner - node.centre));
    const Double3 away = middle(a, b, c) - node.centre, normal = triangle_normal(a, b, c) * 0.5;
    for (std::size_t i = 0; i < 3; ++i)
      for (std::size_t j = 0; j < 3; ++j) node.moment[3 * i + j] += normal[i] * away[j];
  }
  const auto here = static_cast<std::uint32_t>(nodes_.size());
  nodes_.push_back(node);
  if (end - first <= kLeafTriangles) return here;
  const Double3 extent = high - low;
  const std::size_t axis = extent[0] >= extent[1] && extent[0] >= extent[2] ? 0
                           : extent[1] >= extent[2]                         ? 1
                                                                            : 2;
  // Stable, so that triangles at one place keep their order, and with it the bits of the sums.
  std::stable_sort(triangles_.begin() + first, triangles_.begin() + end,
                   [&](const Triangle& s, const Triangle& t) {
                     return middle(s.a, s.b, s.c)[axis] < middle(t.a, t.b, t.c)[axis];
                   });
  const std::uint32_t half = first + (end - first) / 2;
  build(first, half);
  const std::uint32_t right = build(half, end);
  nodes_[here].right = right;
  return here;
}

double TriangleWindings::sum(std::uint32_t index, const Double3& p) const {
  const Node& node = nodes_[index];
  const Double3 d = node.centre - p;
  const double square = dot(d, d);
  if (square > kFarRadii * kFarRadii * node.radius * node.radius) {
    const double cube = square * std::sqrt(square);
    const auto& m = node.moment;
    const Double3 md = {m[0] * d[0] + m[1] * d[1] + m[2] * d[2], m[3] * d[0] + m[4] * d[1] + m[5] * d[2],
                        m[6] * d[0] + m[7] * d[1] + m[8] * d[2]};
    return (dot(node.dipole, d) + (m[0] + m[4] + m[8]) - 3.0 * dot(d, md) / square) / (4.0 * kPi * cube);
  }
  if (node.right != 0) {
    const double left = sum(index + 1, p);
    return left + sum(node.right, p);
  }
  double all = 0.0;
  for (std::uint32_t t = node.first; t < node.end; ++t) {
    const auto& [a, b, c] = triangles_[t];
    all += covered_part(a - p, b - p, c - p);
  }
  return all;
}

double TriangleWindings::at(const Double3& p) const {
  return triangles_.empty() ? 0.0 : sum(0, p);
}

}  // namespace tessera
