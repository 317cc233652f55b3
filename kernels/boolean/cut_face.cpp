#include "kernels/boolean/cut_face.h"

#include <algorithm>
#include <cassert>
#include <cmath>
#include <cstddef>
#include <deque>
#include <stdexcept>

#include "octree/morton.h"

namespace tessera {
namespace {

constexpr std::uint32_t kNoTriangle = ~std::uint32_t{0};

/// Corner k lies across edge k, which runs from corner k + 1 to corner k + 2.
struct CutTriangle {
  std::array<std::uint32_t, 3> corner;
  std::array<std::uint32_t, 3> across;  ///< kNoTriangle at the edges of the face
  std::array<bool, 3> fixed = {false, false, false};
};

constexpr std::size_t after(std::size_t k) {
  return k == 2 ? 0 : k + 1;
}

class CutTriangulation {
 public:
  CutTriangulation(const PointTable& points, const std::array<std::uint32_t, 3>& corner)
      : points_(points), corner_(corner) {
    choose_axes();
    triangles_.push_back({corner, {kNoTriangle, kNoTriangle, kNoTriangle}});
    for (const std::uint32_t c : corner) triangle_at_.emplace_back(c, 0);
    std::sort(triangle_at_.begin(), triangle_at_.end());
  }

  void insert_all(std::span<const std::uint32_t> inner) {
    std::vector<std::uint32_t> order = in_space_order(inner);
    for (const std::uint32_t p : inner) triangle_at_.emplace_back(p, kNoTriangle);
    std::sort(triangle_at_.begin(), triangle_at_.end());
    for (const std::uint32_t p : order) insert(p);
  }

  void fix(std::uint32_t p, std::uint32_t q) {
    std::vector<Edge> crossed;
    if (!crossed_by(p, q, crossed)) return;
    flip_away(p, q, crossed);
  }

  /// Flips what is not Delaunay, segments kept.
  void improve() {
    std::deque<Edge> waiting;
    for (std::uint32_t t = 0; t < triangles_.size(); ++t)
      for (std::size_t k = 0; k < 3; ++k)
        if (triangles_[t].across[k] != kNoTriangle && t < triangles_[t].across[k])
          waiting.push_back(edge(t, k));
    // In doubles two diagonals may each look like the better one: then the last one stays.
    for (std::size_t left = 64 * waiting.size(); left > 0 && !waiting.empty(); --left) {
      const Edge e = waiting.front();
      waiting.pop_front();
      std::uint32_t t;
      std::size_t k;
      if (!find(e, t, k) || triangles_[t].fixed[k] || !wants_flip(t, k) || !may_flip(t, k)) continue;
      const std::uint32_t other = triangles_[t].across[k];
      flip(t, k);
      for (const std::uint32_t s : {t, other})
        for (std::size_t i = 0; i < 3; ++i)
          if (triangles_[s].across[i] != kNoTriangle) waiting.push_back(edge(s, i));
    }
  }

  std::vector<std::array<std::uint32_t, 3>> result() const {
    std::vector<std::array<std::uint32_t, 3>> out;
    for (const CutTriangle& t : triangles_) {
      out.push_back(t.corner);
      std::rotate(out.back().begin(), std::min_element(out.back().begin(), out.back().end()),
                  out.back().end());
    }
    std::sort(out.begin(), out.end());
    return out;
  }

 private:
  struct Edge {
    std::uint32_t from, to;
  };

  void choose_axes() {
    const Double3 n = cross(points_.near(corner_[1]) - points_.near(corner_[0]),
                            points_.near(corner_[2]) - points_.near(corner_[0]));
    std::array<std::size_t, 3> by_size = {0, 1, 2};
    std::stable_sort(by_size.begin(), by_size.end(),
                     [&](std::size_t a, std::size_t b) { return std::fabs(n[a]) > std::fabs(n[b]); });
    for (const std::size_t k : by_size) {
      u_ = after(k), v_ = after(u_);
      const int turn = points_.orient2d(corner_[0], corner_[1], corner_[2], u_, v_);
      if (turn < 0) std::swap(u_, v_);
      if (turn != 0) return;
    }
    throw std::logic_error("a face without area was to be cut");
  }

  int turn(std::uint32_t a, std::uint32_t b, std::uint32_t c) const {
    return points_.orient2d(a, b, c, u_, v_);
  }

  /// Near ones follow each other, so that the walk to the next is short.
  std::vector<std::uint32_t> in_space_order(std::span<const std::uint32_t> inner) const {
    double low_u = points_.near(corner_[0])[u_], high_u = low_u, low_v = points_.near(corner_[0])[v_],
           high_v = low_v;
    for (const std::uint32_t c : corner_) {
      const Double3& p = points_.near(c);
      low_u = std::min(low_u, p[u_]), high_u = std::max(high_u, p[u_]);
      low_v = std::min(low_v, p[v_]), high_v = std::max(high_v, p[v_]);
    }
    const auto cell = [](double x, double low, double high) {
      return static_cast<std::uint32_t>(std::clamp((x - low) / (high - low) * 65535.0, 0.0, 65535.0));
    };
    std::vector<std::pair<std::uint64_t, std::uint32_t>> keyed;
    keyed.reserve(inner.size());
    for (const std::uint32_t i : inner) {
      const Double3& p = points_.near(i);
      keyed.emplace_back(morton_encode(cell(p[u_], low_u, high_u), cell(p[v_], low_v, high_v), 0), i);
    }
    std::sort(keyed.begin(), keyed.end());
    std::vector<std::uint32_t> order;
    order.reserve(keyed.size());
    for (const auto& [key, i] : keyed) order.push_back(i);
    return order;
  }

  std::uint32_t& triangle_at(std::uint32_t p) {
    return std::lower_bound(triangle_at_.begin(), triangle_at_.end(),
                            std::pair<std::uint32_t, std::uint32_t>(p, 0))
        ->second;
  }
  void note(std::uint32_t t) {
    for (const std::uint32_t c : triangles_[t].corner) triangle_at(c) = t;
  }
  static std::size_t slot(const CutTriangle& t, std::uint32_t p) {
    return t.corner[0] == p ? 0 : t.corner[1] == p ? 1 : 2;
  }
  static bool has(const CutTriangle& t, std::uint32_t p) {
    return t.corner[0] == p || t.corner[1] == p || t.corner[2] == p;
  }
  Edge edge(std::uint32_t t, std::size_t k) const {
    return {triangles_[t].corner[after(k)], triangles_[t].corner[after(after(k))]};
  }
  void relink(std::uint32_t t, std::uint32_t from, std::uint32_t to) {
    if (t == kNoTriangle) return;
    for (std::uint32_t& a : triangles_[t].across)
      if (a == from) {
        a = to;
        return;
      }
  }

  /// The triangle that holds p, and on which of its edges p lies: 3, none.
  std::pair<std::uint32_t, std::size_t> locate(std::uint32_t p) const {
    std::uint32_t t = last_;
    for (std::size_t steps = 0; steps < triangles_.size() + 16; ++steps) {
      std::size_t on = 3, beyond = 3;
      for (std::size_t i = 0; i < 3; ++i) {
        // Not always the same edge first: a walk that does may go in circles.
        const std::size_t k = (i + steps) % 3;
        const Edge e = edge(t, k);
        const int side = turn(e.from, e.to, p);
        if (side < 0) {
          beyond = k;
          break;
        }
        if (side == 0) on = k;
      }
      if (beyond == 3) return {t, on};
      t = triangles_[t].across[beyond];
      if (t == kNoTriangle) break;
    }
    for (t = 0; t < triangles_.size(); ++t) {
      std::size_t on = 3;
      bool inside = true;
      for (std::size_t k = 0; k < 3 && inside; ++k) {
        const Edge e = edge(t, k);
        const int side = turn(e.from, e.to, p);
        inside = side >= 0;
        if (side == 0) on = k;
      }
      if (inside) return {t, on};
    }
    throw std::logic_error("a point of a cut lies outside its face");
  }

  void insert(std::uint32_t p) {
    const auto [t, on] = locate(p);
    if (on == 3) {
      split_inside(t, p);
    } else {
      split_edge(t, on, p);
    }
    last_ = triangle_at(p);
  }

  void split_inside(std::uint32_t t, std::uint32_t p) {
    const CutTriangle old = triangles_[t];
    const auto first = static_cast<std::uint32_t>(triangles_.size());
    const std::array<std::uint32_t, 3> made = {t, first, first + 1};
    triangles_.resize(triangles_.size() + 2);
    for (std::size_t k = 0; k < 3; ++k) {
      const std::size_t i = after(k), j = after(i);
      triangles_[made[k]] = {{p, old.corner[i], old.corner[j]}, {old.across[k], made[i], made[j]}};
      relink(old.across[k], t, made[k]);
    }
    for (const std::uint32_t s : made) note(s);
    legalise(p, {made.begin(), made.end()});
  }

  void split_edge(std::uint32_t t, std::size_t k, std::uint32_t p) {
    std::vector<std::uint32_t> made;
    const CutTriangle old = triangles_[t];
    const std::uint32_t other = old.across[k];
    // t keeps the half at the edge's first end.
    const std::uint32_t tip = old.corner[k], a = old.corner[after(k)], b = old.corner[after(after(k))];
    const auto half = static_cast<std::uint32_t>(triangles_.size());
    triangles_.emplace_back();
    const std::uint32_t other_half = other == kNoTriangle ? kNoTriangle : half + 1;
    triangles_[t] = {{p, tip, a}, {old.across[after(after(k))], other_half, half}};
    triangles_[half] = {{p, b, tip}, {old.across[after(k)], t, other}};
    relink(old.across[after(k)], t, half);
    made = {t, half};
    if (other != kNoTriangle) {
      const CutTriangle twin = triangles_[other];
      triangles_.emplace_back();
      std::size_t j = 0;
      while (twin.across[j] != t) ++j;
      // Its edge runs from b to a.
      const std::uint32_t far = twin.corner[j];
      const std::uint32_t beyond_b = twin.across[after(after(j))], beyond_a = twin.across[after(j)];
      triangles_[other] = {{p, far, b}, {beyond_b, half, other_half}};
      triangles_[other_half] = {{p, a, far}, {beyond_a, other, t}};
      relink(beyond_a, other, other_half);
      made.insert(made.end(), {other, other_half});
    }
    for (const std::uint32_t s : made) note(s);
    legalise(p, std::move(made));
  }

  /// Flips edges across from p until none wants it. \param waiting  triangles at p
  void legalise(std::uint32_t p, std::vector<std::uint32_t> waiting) {
    while (!waiting.empty()) {
      const std::uint32_t t = waiting.back();
      waiting.pop_back();
      const std::size_t k = slot(triangles_[t], p);
      const std::uint32_t other = triangles_[t].across[k];
      if (other == kNoTriangle || !wants_flip(t, k) || !may_flip(t, k)) continue;
      flip(t, k);
      waiting.push_back(t);
      waiting.push_back(other);
    }
  }

  /// Whether the far corner lies in the circle around the triangle, by more than rounding.
  bool wants_flip(std::uint32_t t, std::size_t k) const {
    const CutTriangle& here = triangles_[t];
    const CutTriangle& there = triangles_[here.across[k]];
    const Double3& d = points_.near(far_corner(there, t));
    std::array<std::array<double, 2>, 3> m;
    std::array<double, 3> square;
    for (std::size_t i = 0; i < 3; ++i) {
      const Double3& c = points_.near(here.corner[i]);
      m[i] = {c[u_] - d[u_], c[v_] - d[v_]};
      square[i] = m[i][0] * m[i][0] + m[i][1] * m[i][1];
    }
    double determinant = 0.0, size = 0.0;
    for (std::size_t i = 0; i < 3; ++i) {
      const auto &p = m[after(i)], &q = m[after(after(i))];
      determinant += square[i] * (p[0] * q[1] - p[1] * q[0]);
      size += square[i] * (std::fabs(p[0] * q[1]) + std::fabs(p[1] * q[0]));
    }
    return determinant > 1e-12 * size;
  }

  static std::uint32_t far_corner(const CutTriangle& there, std::uint32_t t) {
    return there.corner[there.across[0] == t ? 0 : there.across[1] == t ? 1 : 2];
  }

  bool may_flip(std::uint32_t t, std::size_t k) const {
    const CutTriangle& here = triangles_[t];
    const std::uint32_t p = here.corner[k], a = here.corner[after(k)], b = here.corner[after(after(k))];
    const std::uint32_t q = far_corner(triangles_[here.across[k]], t);
    return turn(p, a, q) > 0 && turn(q, b, p) > 0;
  }

  /// The edge across from corner k of t becomes that from it to the far corner: both triangles keep their numbers.
  void flip(std::uint32_t t, std::size_t k) {
    const std::uint32_t other = triangles_[t].across[k];
    const CutTriangle here = triangles_[t], there = triangles_[other];
    const std::size_t j = there.across[0] == t ? 0 : there.across[1] == t ? 1 : 2;
    const std::uint32_t p = here.corner[k], a = here.corner[after(k)], b = here.corner[after(after(k))],
                        q = there.corner[j];
    // there: q, b, a. across[after(j)] lies beyond the edge from a to q, across[after(after(j))] beyond that from q to b.
    const std::size_t at_b = slot(there, b), at_a = slot(there, a);
    const std::uint32_t beyond_aq = there.across[at_b], beyond_qb = there.across[at_a];
    const std::uint32_t beyond_bp = here.across[after(k)], beyond_pa = here.across[after(after(k))];
    triangles_[t] = {
        {p, a, q}, {beyond_aq, other, beyond_pa}, {there.fixed[at_b], false, here.fixed[after(after(k))]}};
    triangles_[other] = {
        {p, q, b}, {beyond_qb, beyond_bp, t}, {there.fixed[at_a], here.fixed[after(k)], false}};
    relink(beyond_aq, other, t);
    relink(beyond_bp, t, other);
    note(t);
    note(other);
  }

  /// The triangle on the left of an edge. \returns false if there is no such edge
  bool find(const Edge& e, std::uint32_t& t, std::size_t& k) {
    bool found = false;
    around(e.from, [&](std::uint32_t s) {
      const std::size_t i = slot(triangles_[s], e.from);
      if (triangles_[s].corner[after(i)] == e.to) {
        t = s, k = after(after(i));
        found = true;
      }
      return !found;
    });
    if (!found) return false;
    return triangles_[t].across[k] != kNoTriangle;
  }

  /// use(triangle) for those around a point, until it returns false.
  template <class Use>
  void around(std::uint32_t p, const Use& use) {
    const std::uint32_t start = triangle_at(p);
    std::uint32_t t = start;
    do {
      if (!use(t)) return;
      t = triangles_[t].across[after(slot(triangles_[t], p))];
    } while (t != kNoTriangle && t != start);
    if (t == start) return;
    t = triangles_[start].across[after(after(slot(triangles_[start], p)))];
    while (t != kNoTriangle) {
      if (!use(t)) return;
      t = triangles_[t].across[after(after(slot(triangles_[t], p)))];
    }
  }

  void fix_edge(std::uint32_t p, std::uint32_t q) {
    around(p, [&](std::uint32_t t) {
      CutTriangle& here = triangles_[t];
      if (has(here, q)) here.fixed[3 - slot(here, p) - slot(here, q)] = true;
      return true;
    });
  }

  /// Edges that the segment passes, from p on. \returns false where it is an edge already, which then is fixed
  bool crossed_by(std::uint32_t p, std::uint32_t q, std::vector<Edge>& crossed) {
    bool edge_there = false;
    std::uint32_t t = kNoTriangle;
    around(p, [&](std::uint32_t s) {
      const CutTriangle& here = triangles_[s];
      if (has(here, q)) edge_there = true;
      const Edge e = edge(s, slot(here, p));
      if (!edge_there && turn(p, q, e.from) < 0 && turn(p, q, e.to) > 0 && turn(e.from, e.to, q) < 0) t = s;
      return !edge_there;
    });
    if (edge_there) {
      fix_edge(p, q);
      return false;
    }
    if (t == kNoTriangle) throw std::logic_error("a cut passes through a point of its face");
    std::size_t k = slot(triangles_[t], p);
    while (true) {
      const Edge e = edge(t, k);
      crossed.push_back(e);
      const std::uint32_t next = triangles_[t].across[k];
      if (next == kNoTriangle) throw std::logic_error("a cut leaves its face");
      const std::uint32_t tip = far_corner(triangles_[next], t);
      if (tip == q) return true;
      const int side = turn(p, q, tip);
      if (side == 0) throw std::logic_error("a cut passes through a point of its face");
      // The edge that the segment leaves through lies across from the end of e that is not on it.
      k = slot(triangles_[next], side > 0 ? e.to : e.from);
      t = next;
    }
  }

  void flip_away(std::uint32_t p, std::uint32_t q, const std::vector<Edge>& crossed) {
    std::deque<Edge> waiting(crossed.begin(), crossed.end());
    while (!waiting.empty()) {
      const Edge e = waiting.front();
      waiting.pop_front();
      std::uint32_t t;
      std::size_t k;
      if (!find(e, t, k)) throw std::logic_error("an edge across a cut is gone");
      if (!may_flip(t, k)) {
        waiting.push_back(e);
        continue;
      }
      const std::uint32_t c = triangles_[t].corner[k], d = far_corner(triangles_[triangles_[t].across[k]], t);
      flip(t, k);
      if (c == p || c == q || d == p || d == q) continue;
      if (turn(p, q, c) * turn(p, q, d) < 0) waiting.push_back({c, d});
    }
    fix_edge(p, q);
  }

  const PointTable& points_;
  const std::array<std::uint32_t, 3> corner_;
  std::size_t u_ = 0, v_ = 1;
  std::vector<CutTriangle> triangles_;
  std::vector<std::pair<std::uint32_t, std::uint32_t>> triangle_at_;  ///< point, one of its triangles; sorted
  std::uint32_t last_ = 0;
};

}  // namespace

std::vector<std::array<std::uint32_t, 3>> triangulate_cut_face(
    const PointTable& points, const std::array<std::uint32_t, 3>& corner,
    std::span<const std::uint32_t> inner, std::span<const std::pair<std::uint32_t, std::uint32_t>> segments) {
  CutTriangulation work(points, corner);
  work.insert_all(inner);
  std::vector<std::pair<std::uint32_t, std::uint32_t>> sorted;
  for (const auto& [a, b] : segments) sorted.push_back(std::minmax(a, b));
  std::sort(sorted.begin(), sorted.end());
  sorted.erase(std::unique(sorted.begin(), sorted.end()), sorted.end());
  for (const auto& [a, b] : sorted) work.fix(a, b);
  work.improve();
  return work.result();
}

}  // namespace tessera
