#include "kernels/mesh/polygon_triangulation.h"

#include <algorithm>
#include <cassert>
#include <cmath>
#include <limits>

#include "kernels/mesh/flat_faces.h"

namespace tessera {
namespace {

using Triangle = std::array<std::uint32_t, 3>;
using Point = std::array<double, 2>;

constexpr std::uint32_t kNoCorner = 0xffffffffu;
/// A polygon that had to give up so many ears that are none gives up the rest without a search.
constexpr int kMaxForced = 32;
/// A flip must widen the narrower triangle by this much, else rounding could orientation it back and forth.
constexpr double kFlipGain = 1.0 + 1e-9;

double cross2(const Point& a, const Point& b, const Point& c) {
  return (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]);
}
double distance2(const Point& a, const Point& b) {
  return (a[0] - b[0]) * (a[0] - b[0]) + (a[1] - b[1]) * (a[1] - b[1]);
}
/// Altitude over the longest edge, signed; 0 for what is_flat() calls flat.
double shape(const Point& a, const Point& b, const Point& c) {
  const double longest2 = std::max({distance2(a, b), distance2(b, c), distance2(c, a)});
  const double twice = cross2(a, b, c);
  return std::fabs(twice) <= kFlatAltitude * longest2 ? 0.0 : twice / longest2;
}
/// 1 where a, b, c orientation left, -1 where they orientation right, 0 on a line.
int orientation(const Point& a, const Point& b, const Point& c) {
  const double s = shape(a, b, c);
  return s > 0.0 ? 1 : s < 0.0 ? -1 : 0;
}

void append_fan(std::size_t corners, std::vector<Triangle>& triangles) {
  for (std::uint32_t i = 2; i < corners; ++i) triangles.push_back({0, i - 1, i});
}

/// Every triangle of the fan faces along the normal, and together they orientation once around the first corner at most.
bool fan_covers(std::span<const Double3> p, const Double3& normal) {
  const Double3 first = p[1] - p[0];
  bool behind = false;  // the fan has turned by more than half a circle
  for (std::size_t i = 1; i + 1 < p.size(); ++i) {
    const Double3 a = p[i] - p[0], b = p[i + 1] - p[0];
    const double twice = dot(cross(a, b), normal);
    if (!(twice > kFlatAltitude * std::max({dot(a, a), dot(b, b), squared_distance(p[i], p[i + 1])})))
      return false;
    const double from_first = dot(cross(first, b), normal);
    if (behind && from_first >= 0.0) return false;
    behind = behind || from_first < 0.0;
  }
  return true;
}

/// Coordinates in the plane, relative to the first corner and of the order of 1. A normal along an axis of space keeps
/// the other two as they are but for the scale, a power of two.
std::vector<Point> project(std::span<const Double3> p, const Double3& normal) {
  double largest = 0.0;
  for (const Double3& q : p)
    for (std::size_t a = 0; a < 3; ++a) largest = std::max(largest, std::fabs(q[a] - p[0][a]));
  const double scale = std::ldexp(1.0, -std::ilogb(largest));
  std::size_t minimum = 0;
  for (std::size_t a = 1; a < 3; ++a)
    if (std::fabs(normal[a]) < std::fabs(normal[minimum])) minimum = a;
  Double3 u{};
  u[minimum] = 1.0;
  u = unit(u - normal * normal[minimum]);
  const Double3 v = cross(normal, u);
  std::vector<Point> out;
  out.reserve(p.size());
  for (const Double3& q : p) {
    const Double3 d = (q - p[0]) * scale;
    out.push_back({dot(d, u), dot(d, v)});
  }
  return out;
}

/// Corners at which the outline does not orientation left, by the cell of a grid: what can lie in an ear is among them.
class CornerGrid {
 public:
  CornerGrid(const std::vector<Point>& point, const std::vector<std::uint32_t>& corners)
      : cells_(std::clamp<std::size_t>(static_cast<std::size_t>(std::sqrt(corners.size())), 1, 512)) {
    constexpr double kInfinite = std::numeric_limits<double>::infinity();
    Point max = {-kInfinite, -kInfinite};
    min_ = {kInfinite, kInfinite};
    for (const std::uint32_t c : corners)
      for (std::size_t a = 0; a < 2; ++a) {
        min_[a] = std::min(min_[a], point[c][a]);
        max[a] = std::max(max[a], point[c][a]);
      }
    for (std::size_t a = 0; a < 2; ++a)
      step_[a] = max[a] > min_[a] ? static_cast<double>(cells_) / (max[a] - min_[a]) : 0.0;
    first_.assign(cells_ * cells_ + 1, 0);
    for (const std::uint32_t c : corners) ++first_[cell(point[c]) + 1];
    for (std::size_t i = 0; i + 1 < first_.size(); ++i) first_[i + 1] += first_[i];
    corner_.resize(corners.size());
    std::vector<std::uint32_t> next(first_.begin(), first_.end() - 1);
    for (const std::uint32_t c : corners) corner_[next[cell(point[c])]++] = c;
  }

  /// Whether `blocks` says so of any corner in the box.
  template <class Blocks>
  bool any_in(const Point& low, const Point& high, const Blocks& blocks) const {
    if (corner_.empty()) return false;
    const std::size_t x0 = index(low, 0), x1 = index(high, 0), y1 = index(high, 1);
    for (std::size_t y = index(low, 1); y <= y1; ++y)
      for (std::uint32_t i = first_[y * cells_ + x0]; i < first_[y * cells_ + x1 + 1]; ++i)
        if (blocks(corner_[i])) return true;
    return false;
  }

 private:
  std::size_t index(const Point& p, std::size_t axis) const {
    const double at = (p[axis] - min_[axis]) * step_[axis];
    return at > 0.0 ? static_cast<std::size_t>(std::min(at, static_cast<double>(cells_ - 1))) : 0;
  }
  std::size_t cell(const Point& p) const { return index(p, 1) * cells_ + index(p, 0); }

  std::size_t cells_;  ///< along each axis
  Point min_{}, step_{};
  std::vector<std::uint32_t> first_;   ///< per cell, in corner_; one more at the end
  std::vector<std::uint32_t> corner_;  ///< cell by cell
};

class EarClipper {
 public:
  explicit EarClipper(const std::vector<Point>& point)
      : point_(point),
        next_(point.size()),
        previous_(point.size()),
        orientation_(point.size()),
        left_(point.size()) {
    const auto n = static_cast<std::uint32_t>(point.size());
    for (std::uint32_t i = 0; i < n; ++i) {
      next_[i] = i + 1 < n ? i + 1 : 0;
      previous_[i] = i > 0 ? i - 1 : n - 1;
    }
    for (std::uint32_t i = 0; i < n; ++i) look_at(i);
  }

  /// False if an ear had to be clipped that is none: then the outline crosses itself.
  bool clip_all(std::vector<Triangle>& triangles) {
    std::vector<std::uint32_t> inner;
    for (std::uint32_t i = 0; i < point_.size(); ++i)
      if (orientation_[i] <= 0) inner.push_back(i);
    const CornerGrid grid(point_, inner);
    int forced = 0;
    Rule minimum = Rule::kEar, rule = minimum;
    std::size_t misses = 0;
    for (std::uint32_t at = 0; left_ > 3;) {
      if (may_clip(at, rule, grid)) {
        if (rule >= Rule::kConvex && ++forced == kMaxForced) minimum = Rule::kAny;
        const std::uint32_t after = next_[at];
        clip(at, triangles);
        at = next_[after];  // the next corner but one: fewer triangles hang on one corner
        misses = 0;
        rule = minimum;
        continue;
      }
      at = next_[at];
      if (++misses < left_) continue;
      misses = 0;
      rule = static_cast<Rule>(static_cast<int>(rule) + 1);
      start_ = at;
    }
    triangles.push_back({previous_[start_], start_, next_[start_]});
    return forced == 0;
  }

 private:
  /// What is clipped, from the rule to what is left when no corner keeps it: rounding and outlines that touch themselves
  /// need the second to fourth, outlines that cross themselves the last two.
  enum class Rule { kEar, kSpike, kEmpty, kFlat, kConvex, kAny };

  void look_at(std::uint32_t b) {
    orientation_[b] = orientation(point_[previous_[b]], point_[b], point_[next_[b]]);
  }

  /// There and back on one line, or twice the same place.
  bool is_spike(std::uint32_t b) const {
    const Point &o = point_[b], &a = point_[previous_[b]], &c = point_[next_[b]];
    return orientation_[b] == 0 && (a[0] - o[0]) * (c[0] - o[0]) + (a[1] - o[1]) * (c[1] - o[1]) >= 0.0;
  }

  bool may_clip(std::uint32_t b, Rule rule, const CornerGrid& grid) const {
    switch (rule) {
      case Rule::kEar:
        return orientation_[b] > 0 && diagonal_is_inside(b) && is_empty(b, grid, true);
      case Rule::kSpike:
        return is_spike(b);
      case Rule::kEmpty:
        return orientation_[b] > 0 && is_empty(b, grid, false);
      case Rule::kFlat:
        return orientation_[b] == 0;
      case Rule::kConvex:
        return orientation_[b] > 0;
      case Rule::kAny:
        break;
    }
    return true;
  }

  /// The diagonal of ear b leaves both its ends into the polygon, not along or beyond the edge there: holes that bridges
  /// join have two corners at one place, and only one of them sees b.
  bool diagonal_is_inside(std::uint32_t b) const {
    const std::uint32_t a = previous_[b], c = next_[b];
    if (orientation_[a] > 0 ? orientation(point_[a], point_[c], point_[previous_[a]]) <= 0 : is_spike(a))
      return false;
    return orientation_[c] > 0 ? orientation(point_[c], point_[next_[c]], point_[a]) > 0 : !is_spike(c);
  }

  /// No other corner lies in the triangle at b. \param closed  nor on its edges
  bool is_empty(std::uint32_t b, const CornerGrid& grid, bool closed) const {
    const Point &p = point_[previous_[b]], &q = point_[b], &r = point_[next_[b]];
    const Point low = {std::min({p[0], q[0], r[0]}), std::min({p[1], q[1], r[1]})};
    const Point high = {std::max({p[0], q[0], r[0]}), std::max({p[1], q[1], r[1]})};
    const int minimum = closed ? 0 : 1;
    return !grid.any_in(low, high, [&](std::uint32_t v) {
      if (next_[v] == kNoCorner || orientation_[v] > 0) return false;
      const Point& x = point_[v];
      if (x == p || x == q || x == r) return false;
      return orientation(p, q, x) >= minimum && orientation(q, r, x) >= minimum &&
             orientation(r, p, x) >= minimum;
    });
  }

  void clip(std::uint32_t b, std::vector<Triangle>& triangles) {
    const std::uint32_t a = previous_[b], c = next_[b];
    triangles.push_back({a, b, c});
    next_[a] = c;
    previous_[c] = a;
    next_[b] = kNoCorner;
    look_at(a);
    look_at(c);
    start_ = a;
    --left_;
  }

  const std::vector<Point>& point_;
  std::vector<std::uint32_t> next_, previous_;  ///< next_ is kNoCorner where a corner was clipped
  std::vector<int> orientation_;
  std::size_t left_;
  std::uint32_t start_ = 0;  ///< a corner that is left
};

/// Flips diagonals while the narrower of the two triangles at one gets wider. Every flip makes the sorted list of shapes
/// larger, so none comes twice.
class DiagonalFlipper {
 public:
  DiagonalFlipper(const std::vector<Point>& point, std::span<Triangle> triangles)
      : point_(point),
        triangles_(triangles),
        neighbour_(triangles.size(), {kNoCorner, kNoCorner, kNoCorner}) {
    struct Side {
      std::uint32_t from, to, triangle, edge;
    };
    const auto n = static_cast<std::uint32_t>(point.size());
    std::vector<Side> sides;
    for (std::uint32_t t = 0; t < triangles.size(); ++t)
      for (std::uint32_t e = 0; e < 3; ++e) {
        const std::uint32_t a = triangles[t][e], b = triangles[t][(e + 1) % 3];
        if (b == (a + 1) % n) continue;  // an edge of the polygon
        sides.push_back({std::min(a, b), std::max(a, b), t, e});
      }
    std::sort(sides.begin(), sides.end(), [](const Side& a, const Side& b) {
      return std::array{a.from, a.to, a.triangle} < std::array{b.from, b.to, b.triangle};
    });
    for (std::size_t i = 0; i + 1 < sides.size(); i += 2) {
      assert(sides[i].from == sides[i + 1].from && sides[i].to == sides[i + 1].to);
      neighbour_[sides[i].triangle][sides[i].edge] = sides[i + 1].triangle;
      neighbour_[sides[i + 1].triangle][sides[i + 1].edge] = sides[i].triangle;
    }
  }

  void flip_all() {
    std::vector<std::uint32_t> open(triangles_.size());
    for (std::uint32_t t = 0; t < open.size(); ++t) open[t] = static_cast<std::uint32_t>(open.size()) - 1 - t;
    while (!open.empty()) {
      const std::uint32_t t = open.back();
      open.pop_back();
      for (std::uint32_t e = 0; e < 3; ++e) {
        const std::uint32_t other = neighbour_[t][e];
        if (other == kNoCorner || !flip(t, e)) continue;
        open.push_back(other);
        open.push_back(t);
        break;
      }
    }
  }

 private:
  double shape_of(std::uint32_t a, std::uint32_t b, std::uint32_t c) const {
    return shape(point_[a], point_[b], point_[c]);
  }
  std::uint32_t edge_to(std::uint32_t t, std::uint32_t other) const {
    const auto& n = neighbour_[t];
    return n[0] == other ? 0 : n[1] == other ? 1 : 2;
  }

  /// Turns edge e of t, if that is better: (s, r, p) and (r, s, q) become (s, q, p) and (q, r, p).
  bool flip(std::uint32_t t, std::uint32_t e) {
    const std::uint32_t u = neighbour_[t][e];
    const std::uint32_t f = edge_to(u, t);
    const std::uint32_t s = triangles_[t][e], r = triangles_[t][(e + 1) % 3], p = triangles_[t][(e + 2) % 3];
    const std::uint32_t q = triangles_[u][(f + 2) % 3];
    const double after = std::min(shape_of(s, q, p), shape_of(q, r, p));
    const double before = std::min(shape_of(s, r, p), shape_of(r, s, q));
    if (!(after > 0.0 && after > before * kFlipGain)) return false;
    const std::uint32_t beyond_rp = neighbour_[t][(e + 1) % 3], beyond_ps = neighbour_[t][(e + 2) % 3];
    const std::uint32_t beyond_sq = neighbour_[u][(f + 1) % 3], beyond_qr = neighbour_[u][(f + 2) % 3];
    triangles_[t] = {s, q, p};
    neighbour_[t] = {beyond_sq, u, beyond_ps};
    triangles_[u] = {q, r, p};
    neighbour_[u] = {beyond_qr, beyond_rp, t};
    if (beyond_sq != kNoCorner) neighbour_[beyond_sq][edge_to(beyond_sq, u)] = t;
    if (beyond_rp != kNoCorner) neighbour_[beyond_rp][edge_to(beyond_rp, t)] = u;
    return true;
  }

  const std::vector<Point>& point_;
  std::span<Triangle> triangles_;
  /// Across the edge from each corner to the next; kNoCorner at the outline.
  std::vector<Triangle> neighbour_;
};

/// Whether it is more than a line.
bool has_extent(std::span<const Double3> p) {
  for (std::size_t i = 2; i < p.size(); ++i)
    if (!face_extent(p[0], p[i - 1], p[i]).is_flat()) return true;
  return false;
}

}  // namespace

Double3 newell_normal(std::span<const Double3> corners) {
  Double3 sum{};
  for (std::size_t i = 1; i + 1 < corners.size(); ++i)
    sum = sum + cross(corners[i] - corners[0], corners[i + 1] - corners[0]);
  return sum;
}

bool triangulate_polygon(std::span<const Double3> corners, std::vector<Triangle>& triangles) {
  assert(corners.size() >= 3 && corners.size() <= kMaxPolygonCorners);
  double extent2 = 0.0;
  for (const Double3& p : corners) extent2 = std::max(extent2, squared_distance(p, corners[0]));
  const Double3 along = newell_normal(corners);
  const double area = norm(along);
  if (!std::isfinite(area) || !std::isfinite(extent2) || !(area > kFlatAltitude * extent2)) {
    append_fan(corners.size(), triangles);
    return !has_extent(corners);
  }
  const Double3 normal = along / area;
  if (fan_covers(corners, normal)) {
    append_fan(corners.size(), triangles);
    return true;
  }
  const std::vector<Point> point = project(corners, normal);
  const std::size_t first = triangles.size();
  bool covered = EarClipper(point).clip_all(triangles);
  const std::span<Triangle> fresh(triangles.data() + first, corners.size() - 2);
  DiagonalFlipper(point, fresh).flip_all();
  for (const Triangle& t : fresh)
    covered = covered && orientation(point[t[0]], point[t[1]], point[t[2]]) >= 0;
  return covered;
}

}  // namespace tessera
