#include "kernels/solid/border_winding.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "kernels/solid/ribbon_angles.h"
#include "octree/portable_math.h"

namespace tessera {
namespace {

constexpr double kFarShare = 0.1;     ///< radius over distance from which moments stand for edges
constexpr double kFarChange = 0.2;    ///< the same for bounds, which hold whatever it is
constexpr double kFarGradient = 0.1;  ///< the same where only the first moment does

constexpr std::array<std::array<std::size_t, 2>, 6> kPairs = {
    {{0, 0}, {1, 1}, {2, 2}, {0, 1}, {0, 2}, {1, 2}}};

Double3 in_cells(const Long3& q) {
  return {static_cast<double>(q[0]) * kCellsPerQuantum, static_cast<double>(q[1]) * kCellsPerQuantum,
          static_cast<double>(q[2]) * kCellsPerQuantum};
}

float to_float(double x) {
  return static_cast<float>(x);
}

/// A float that is no less. \pre x >= 0
float above(double x) {
  return std::nextafter(static_cast<float>(x), std::numeric_limits<float>::max());
}

std::uint64_t morton_of(const BorderEdge& e) {
  std::array<std::uint32_t, 3> cell{};
  for (std::size_t k = 0; k < 3; ++k)
    cell[k] =
        static_cast<std::uint32_t>(std::max<std::int64_t>(0, (e.a[k] + e.b[k]) >> (kSolidQuantumBits + 1)));
  return morton_encode(cell[0], cell[1], cell[2]);
}

}  // namespace

BorderWinding::BorderWinding(std::vector<BorderEdge> edges) : edges_(std::move(edges)) {
  if (edges_.empty()) return;
  std::sort(edges_.begin(), edges_.end(), [](const BorderEdge& l, const BorderEdge& r) {
    const std::uint64_t p = morton_of(l), q = morton_of(r);
    return p != q ? p < q : l.a != r.a ? l.a < r.a : l.b < r.b;
  });
  clusters_.reserve(1 + 4 * edges_.size() / kClusterEdges);
  clusters_.emplace_back().end = static_cast<std::uint32_t>(edges_.size());
  for (std::uint32_t c = 0; c < clusters_.size(); ++c) split(c);
}

void BorderWinding::split(std::uint32_t cluster) {
  sum_up(clusters_[cluster]);
  const std::uint32_t first = clusters_[cluster].first, end = clusters_[cluster].end;
  if (end - first <= kClusterEdges) return;
  const std::uint32_t middle = first + (end - first) / 2;
  clusters_[cluster].left = static_cast<std::uint32_t>(clusters_.size());
  BorderCluster& left = clusters_.emplace_back();
  left.first = first, left.end = middle;
  BorderCluster& right = clusters_.emplace_back();
  right.first = middle, right.end = end;
}

void BorderWinding::sum_up(BorderCluster& c) const {
  constexpr double kAny = std::numeric_limits<double>::max();
  Double3 low = {kAny, kAny, kAny}, high = {-kAny, -kAny, -kAny};
  for (std::uint32_t e = c.first; e < c.end; ++e)
    for (const Long3* q : {&edges_[e].a, &edges_[e].b}) {
      const Double3 p = in_cells(*q);
      for (std::size_t k = 0; k < 3; ++k) low[k] = std::min(low[k], p[k]), high[k] = std::max(high[k], p[k]);
    }
  // What floats cannot hold is taken into account: places count from the centre as it is kept.
  c.centre = narrow((low + high) * 0.5);
  const Double3 centre = wide(c.centre);
  c.radius = above(std::max(norm(high - centre), norm(centre - low)));
  Double3 sum{};
  std::array<double, 9> moment{};
  std::array<std::array<double, 6>, 2> second{};
  double length = 0.0;
  for (std::uint32_t e = c.first; e < c.end; ++e) {
    const Double3 a = in_cells(edges_[e].a), b = in_cells(edges_[e].b);
    const auto count = static_cast<double>(edges_[e].count);
    const Double3 edge = (b - a) * count, from = (a + b) * 0.5 - centre;
    sum = sum + edge;
    for (std::size_t i = 0; i < 3; ++i)
      for (std::size_t j = 0; j < 3; ++j) moment[3 * i + j] += edge[i] * from[j];
    const Double3 self = b - a;
    for (std::size_t i = 0; i < 2; ++i)
      for (std::size_t m = 0; m < 6; ++m) {
        const std::size_t j = kPairs[m][0], k = kPairs[m][1];
        second[i][m] += 0.5 * edge[i + 1] * (from[j] * from[k] + self[j] * self[k] / 12.0);
      }
    length += norm(edge);
  }
  c.sum = narrow(sum);
  std::transform(moment.begin(), moment.end(), c.moment.begin(), to_float);
  for (std::size_t i = 0; i < 2; ++i)
    std::transform(second[i].begin(), second[i].end(), c.second[i].begin(), to_float);
  c.length = above(length);
}

double BorderWinding::at(const Int3& node) const {
  if (clusters_.empty()) return 0.0;
  const Double3 x = {static_cast<double>(node[0]), static_cast<double>(node[1]),
                     static_cast<double>(node[2])};
  Long3 quanta;
  for (std::size_t k = 0; k < 3; ++k) quanta[k] = node[k] * kSolidQuanta;
  double sum = 0.0;
  AngleSum half;
  std::array<std::uint32_t, kStack> stack;
  std::size_t top = 0;
  stack[top++] = 0;
  while (top > 0) {
    const BorderCluster& c = clusters_[stack[--top]];
    const Double3 r = wide(c.centre) - x;
    const double s = norm(r), q = r[0];
    // Ribbons that pass near the node are seen from near, however far their edges are.
    const double near = q < 0.0 ? std::sqrt(r[1] * r[1] + r[2] * r[2]) : s;
    if (c.radius < kFarShare * near) {
      // The form g (e_x x r) . dl with g = 1 / (s (s + q)), to first order about the centre.
      const double d = s * (s + q), g = 1.0 / d;
      const Double3 v = {0.0, -r[2], r[1]};
      const Double3 slope = ((r / s) * (2.0 * s + q) + Double3{s, 0.0, 0.0}) * (-g * g);
      double winding = g * dot(v, wide(c.sum));
      winding += g * (c.moment[3 * 2 + 1] - c.moment[3 * 1 + 2]);
      for (std::size_t i = 0; i < 3; ++i)
        for (std::size_t j = 0; j < 3; ++j) winding += v[i] * c.moment[3 * i + j] * slope[j];
      sum += winding;
    } else if (c.left != 0) {
      stack[top++] = c.left + 1;
      stack[top++] = c.left;
    } else {
      for (std::uint32_t e = c.first; e < c.end; ++e) add_boundary_strip(edges_[e], quanta, half);
    }
  }
  return (sum + 2.0 * half.value()) / (4.0 * kPi);
}

Double3 BorderWinding::gradient(const Double3& x) const {
  Double3 sum = {0, 0, 0};
  if (clusters_.empty()) return sum;
  std::array<std::uint32_t, kStack> stack;
  std::size_t top = 0;
  stack[top++] = 0;
  while (top > 0) {
    const BorderCluster& c = clusters_[stack[--top]];
    const Double3 r = wide(c.centre) - x;
    const double s = norm(r);
    if (c.radius < kFarGradient * s) {
      sum = sum + cross(r, wide(c.sum)) / (s * s * s);
    } else if (c.left != 0) {
      stack[top++] = c.left + 1;
      stack[top++] = c.left;
    } else {
      for (std::uint32_t e = c.first; e < c.end; ++e) {  // Biot and Savart
        const Double3 a = in_cells(edges_[e].a) - x, b = in_cells(edges_[e].b) - x;
        const double la = norm(a), lb = norm(b), d = la * lb * (la * lb + dot(a, b));
        if (!(d > 0.0)) continue;
        sum = sum + cross(a, b) * ((la + lb) / d * static_cast<double>(edges_[e].count));
      }
    }
  }
  return sum / (-4.0 * kPi);
}

double BorderWinding::change(const Double3& x, double radius) const {
  if (clusters_.empty()) return 0.0;
  // An edge of length l at distance d: first derivatives up to l / d^2, second ones up to 2 l / d^3, over 4 pi.
  double first = 0.0, second = 0.0, left_out = 0.0;
  Double3 slope = {0, 0, 0};
  std::array<std::uint32_t, kStack> stack;
  std::size_t top = 0;
  stack[top++] = 0;
  while (top > 0) {
    const BorderCluster& c = clusters_[stack[--top]];
    const Double3 r = wide(c.centre) - x;
    const double s = norm(r), free = s - c.radius - radius;
    if (c.left != 0 && (free <= 0.0 || c.radius > kFarChange * s)) {
      stack[top++] = c.left + 1;
      stack[top++] = c.left;
      continue;
    }
    if (free <= 0.0) return std::numeric_limits<double>::infinity();
    const double second_bound = 2.0 * c.length / (free * free * free);
    first += c.length / (free * free);
    second += second_bound;
    left_out += second_bound * c.radius + c.length * 0x1p-22 / (s * s);  // what floats round off the sum, too
    slope = slope + cross(r, wide(c.sum)) / (s * s * s);
  }
  const double by_first = 2.0 * radius * first;
  const double by_second = 2.0 * radius * (norm(slope) + left_out + 0.5 * radius * second);
  return std::min(by_first, by_second) / (4.0 * kPi);
}

}  // namespace tessera
