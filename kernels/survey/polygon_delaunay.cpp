#include "kernels/survey/polygon_delaunay.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>

#include "kernels/mesh/orientation_sign.h"
#include "kernels/mesh/polygon_triangulation.h"

namespace tessera {
namespace {

using Triangle = std::array<std::uint32_t, 3>;
constexpr std::uint32_t kNoTriangle = 0xffffffffU;
/// Areas of triangles and rings may differ by so much, relative to the box.
constexpr double kAreaError = 1e-9;

/// Whether d lies within the circle around a, b, c (counter-clockwise) beyond doubt: what rounding leaves open counts as no.
bool in_circle(const Double2& a, const Double2& b, const Double2& c, const Double2& d) {
  using Long = long double;
  const Long ax = a[0] - d[0], ay = a[1] - d[1], bx = b[0] - d[0], by = b[1] - d[1], cx = c[0] - d[0],
             cy = c[1] - d[1];
  const Long a2 = ax * ax + ay * ay, b2 = bx * bx + by * by, c2 = cx * cx + cy * cy;
  const Long sum = a2 * (bx * cy - by * cx) + b2 * (cx * ay - cy * ax) + c2 * (ax * by - ay * bx);
  const Long size = a2 * (std::fabs(bx * cy) + std::fabs(by * cx)) +
                    b2 * (std::fabs(cx * ay) + std::fabs(cy * ax)) +
                    c2 * (std::fabs(ax * by) + std::fabs(ay * bx));
  // Differences are rounded to doubles, all else to 64 bits: 2^-50 is more than all of that.
  return sum > size * 0x1p-50L;
}

/// Corners of rings, the outline counter-clockwise and holes clockwise, as one outline that bridges join.
class JoinedRings {
 public:
  explicit JoinedRings(std::span<const std::vector<Double2>> rings) {
    std::uint32_t first = 0;
    for (std::size_t r = 0; r < rings.size(); ++r) {
      std::vector<std::uint32_t> ring(rings[r].size());
      std::iota(ring.begin(), ring.end(), first);
      if ((signed_area(rings[r]) < 0.0) == (r == 0)) std::reverse(ring.begin(), ring.end());
      point_.insert(point_.end(), rings[r].begin(), rings[r].end());
      first = static_cast<std::uint32_t>(point_.size());
      (r == 0 ? outline_ : holes_.emplace_back()) = std::move(ring);
    }
    // From the east: what lies east of a hole is joined before it.
    const auto east = [&](const std::vector<std::uint32_t>& ring) {
      return *std::max_element(ring.begin(), ring.end(), [&](std::uint32_t a, std::uint32_t b) {
        return point_[a] != point_[b] ? point_[a] < point_[b] : a < b;
      });
    };
    std::sort(holes_.begin(), holes_.end(),
              [&](const auto& a, const auto& b) { return point_[east(a)] > point_[east(b)]; });
    for (auto& hole : holes_)
      std::rotate(hole.begin(), std::find(hole.begin(), hole.end(), east(hole)), hole.end());
  }

  /// False where a hole sees no corner of the outline.
  bool join() {
    for (std::size_t h = 0; h < holes_.size(); ++h)
      if (!join_hole(h)) return false;
    return true;
  }
  const std::vector<std::uint32_t>& outline() const { return outline_; }
  const std::vector<Double2>& points() const { return point_; }

 private:
  bool join_hole(std::size_t h) {
    const std::vector<std::uint32_t>& hole = holes_[h];
    const Double2& from = point_[hole[0]];
    std::vector<std::uint32_t> order(outline_.size());
    std::iota(order.begin(), order.end(), 0U);
    const auto far = [&](std::uint32_t k) {
      const Double2& p = point_[outline_[k]];
      return (p[0] - from[0]) * (p[0] - from[0]) + (p[1] - from[1]) * (p[1] - from[1]);
    };
    std::sort(order.begin(), order.end(), [&](std::uint32_t a, std::uint32_t b) {
      const double x = far(a), y = far(b);
      return x != y ? x < y : a < b;
    });
    for (const std::uint32_t k : order) {
      if (!opens_towards(k, from) || is_blocked(h, outline_[k])) continue;
      std::vector<std::uint32_t> bridge(hole.begin(), hole.end());
      bridge.push_back(hole[0]), bridge.push_back(outline_[k]);
      outline_.insert(outline_.begin() + k + 1, bridge.begin(), bridge.end());
      return true;
    }
    return false;
  }

  /// Whether a line from corner k of the outline to this point begins inside.
  bool opens_towards(std::uint32_t k, const Double2& to) const {
    const std::size_t n = outline_.size();
    const Double2 &before = point_[outline_[(k + n - 1) % n]], &at = point_[outline_[k]],
                  &after = point_[outline_[(k + 1) % n]];
    const bool left_of_in = orient2d_sign(before, at, to) > 0, left_of_out = orient2d_sign(at, after, to) > 0;
    return orient2d_sign(before, at, after) >= 0 ? left_of_in && left_of_out : left_of_in || left_of_out;
  }

  bool is_blocked(std::size_t h, std::uint32_t to) const {
    if (blocks(outline_, holes_[h][0], to)) return true;
    for (std::size_t k = h; k < holes_.size(); ++k)
      if (blocks(holes_[k], holes_[h][0], to)) return true;
    return false;
  }
  /// Whether an edge of the ring meets the line between two corners but at its ends.
  bool blocks(const std::vector<std::uint32_t>& ring, std::uint32_t from, std::uint32_t to) const {
    const Double2 &a = point_[from], &b = point_[to];
    const Double2 low = {std::min(a[0], b[0]), std::min(a[1], b[1])},
                  high = {std::max(a[0], b[0]), std::max(a[1], b[1])};
    for (std::size_t k = 0; k < ring.size(); ++k) {
      const std::uint32_t u = ring[k], v = ring[k + 1 < ring.size() ? k + 1 : 0];
      const Double2 &p = point_[u], &q = point_[v];
      if (std::max(p[0], q[0]) < low[0] || std::min(p[0], q[0]) > high[0] || std::max(p[1], q[1]) < low[1] ||
          std::min(p[1], q[1]) > high[1])
        continue;
      const bool u_end = u == from || u == to, v_end = v == from || v == to;
      if (u_end || v_end) {
        const Double2& other = u_end ? q : p;
        if (!(u_end && v_end) && orient2d_sign(a, b, other) == 0 && within(low, high, other)) return true;
        continue;
      }
      if (orient2d_sign(a, b, p) * orient2d_sign(a, b, q) <= 0 &&
          orient2d_sign(p, q, a) * orient2d_sign(p, q, b) <= 0)
        return true;
    }
    return false;
  }
  static bool within(const Double2& low, const Double2& high, const Double2& p) {
    return p[0] >= low[0] && p[0] <= high[0] && p[1] >= low[1] && p[1] <= high[1];
  }

  std::vector<Double2> point_;
  std::vector<std::uint32_t> outline_;
  std::vector<std::vector<std::uint32_t>> holes_;
};

/// Flips edges until all are Delaunay. An edge with one triangle is one of the polygon's.
class DelaunayFlips {
 public:
  DelaunayFlips(const std::vector<Double2>& point, std::vector<Triangle>& triangles)
      : point_(point),
        triangles_(triangles),
        across_(triangles.size(), {kNoTriangle, kNoTriangle, kNoTriangle}) {
    struct Side {
      std::uint32_t low, high, triangle, edge;
    };
    std::vector<Side> sides;
    sides.reserve(3 * triangles.size());
    for (std::uint32_t t = 0; t < triangles.size(); ++t)
      for (std::uint32_t e = 0; e < 3; ++e) {
        const std::uint32_t a = triangles[t][e], b = triangles[t][(e + 1) % 3];
        sides.push_back({std::min(a, b), std::max(a, b), t, e});
      }
    std::sort(sides.begin(), sides.end(), [](const Side& a, const Side& b) {
      return std::array{a.low, a.high, a.triangle} < std::array{b.low, b.high, b.triangle};
    });
    for (std::size_t i = 0; i + 1 < sides.size(); ++i) {
      const Side &a = sides[i], &b = sides[i + 1];
      if (a.low != b.low || a.high != b.high) continue;
      across_[a.triangle][a.edge] = b.triangle, across_[b.triangle][b.edge] = a.triangle;
      ++i;
    }
  }

  void run() {
    std::vector<std::uint32_t> open(triangles_.size());
    for (std::uint32_t t = 0; t < open.size(); ++t) open[t] = static_cast<std::uint32_t>(open.size()) - 1 - t;
    while (!open.empty()) {
      const std::uint32_t t = open.back();
      open.pop_back();
      for (std::uint32_t e = 0; e < 3; ++e) {
        const std::uint32_t u = across_[t][e];
        if (u == kNoTriangle || !flip(t, e)) continue;
        open.push_back(u), open.push_back(t);
        break;
      }
    }
  }

 private:
  int side(std::uint32_t a, std::uint32_t b, std::uint32_t c) const {
    return orient2d_sign(point_[a], point_[b], point_[c]);
  }
  std::uint32_t edge_to(std::uint32_t t, std::uint32_t other) const {
    return across_[t][0] == other ? 0 : across_[t][1] == other ? 1 : 2;
  }
  void redirect(std::uint32_t triangle, std::uint32_t from, std::uint32_t to) {
    if (triangle != kNoTriangle) across_[triangle][edge_to(triangle, from)] = to;
  }

  /// (s, r, p) and (r, s, q) become (s, q, p) and (q, r, p).
  bool flip(std::uint32_t t, std::uint32_t e) {
    const std::uint32_t u = across_[t][e], f = edge_to(u, t);
    const std::uint32_t s = triangles_[t][e], r = triangles_[t][(e + 1) % 3], p = triangles_[t][(e + 2) % 3],
                        q = triangles_[u][(f + 2) % 3];
    if (p == q || side(s, q, p) <= 0 || side(q, r, p) <= 0) return false;
    const bool flat = side(s, r, p) <= 0 || side(r, s, q) <= 0;
    if (!flat && !in_circle(point_[s], point_[r], point_[p], point_[q])) return false;
    const std::uint32_t beyond_rp = across_[t][(e + 1) % 3], beyond_ps = across_[t][(e + 2) % 3],
                        beyond_sq = across_[u][(f + 1) % 3], beyond_qr = across_[u][(f + 2) % 3];
    triangles_[t] = {s, q, p}, across_[t] = {beyond_sq, u, beyond_ps};
    triangles_[u] = {q, r, p}, across_[u] = {beyond_qr, beyond_rp, t};
    redirect(beyond_sq, u, t), redirect(beyond_rp, t, u);
    return true;
  }

  const std::vector<Double2>& point_;
  std::vector<Triangle>& triangles_;
  std::vector<Triangle> across_;  ///< the edge from each corner to the next; kNoTriangle at the outline
};

double half_cross(const Double2& a, const Double2& b, const Double2& c) {
  return 0.5 * ((b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]));
}

/// The least number first, sorted: whatever the flips began with.
void put_in_order(std::vector<Triangle>& triangles) {
  for (Triangle& t : triangles) std::rotate(t.begin(), std::min_element(t.begin(), t.end()), t.end());
  std::sort(triangles.begin(), triangles.end());
}

}  // namespace

double signed_area(std::span<const Double2> ring) {
  double sum = 0.0;
  for (std::size_t k = 2; k < ring.size(); ++k) sum += half_cross(ring[0], ring[k - 1], ring[k]);
  return sum;
}

std::optional<std::vector<Triangle>> polygon_delaunay(std::span<const std::vector<Double2>> rings) {
  JoinedRings joined(rings);
  if (!joined.join()) return std::nullopt;
  const std::vector<Double2>& point = joined.points();
  std::vector<Double3> corners;
  corners.reserve(joined.outline().size());
  for (const std::uint32_t v : joined.outline()) corners.push_back({point[v][0], point[v][1], 0.0});
  std::vector<Triangle> triangles;
  if (!triangulate_polygon(corners, triangles)) return std::nullopt;
  for (Triangle& t : triangles)
    for (std::uint32_t& v : t) v = joined.outline()[v];
  // A bridge that was clipped there and back.
  std::erase_if(triangles, [](const Triangle& t) { return t[0] == t[1] || t[1] == t[2] || t[2] == t[0]; });
  DelaunayFlips(point, triangles).run();
  double wanted = 0.0, covered = 0.0, size = 0.0;
  for (std::size_t r = 0; r < rings.size(); ++r)
    wanted += (r == 0 ? 1.0 : -1.0) * std::abs(signed_area(rings[r]));
  for (const Triangle& t : triangles) covered += std::abs(half_cross(point[t[0]], point[t[1]], point[t[2]]));
  for (const Double2& p : point)
    size = std::max({size, std::abs(p[0] - point[0][0]), std::abs(p[1] - point[0][1])});
  if (!(std::abs(covered - wanted) <= kAreaError * size * size)) return std::nullopt;
  std::erase_if(triangles,
                [&](const Triangle& t) { return orient2d_sign(point[t[0]], point[t[1]], point[t[2]]) <= 0; });
  put_in_order(triangles);
  return triangles;
}

}  // namespace tessera
