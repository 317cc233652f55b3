#include "kernels/boolean/self_cuts.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <set>
#include <stdexcept>
#include <unordered_map>
#include <utility>

#include "kernels/mesh/orientation_sign.h"

namespace tessera {
namespace {

using CutCorners = std::array<std::uint32_t, 3>;
using FlatAxes = std::array<std::size_t, 2>;

/// What was found in one face.
struct FaceCuts {
  FlatAxes axes{};
  std::set<std::uint32_t> points;  ///< corners too
  std::set<PointPair> segments;    ///< as pairs of faces gave them
  std::vector<std::uint32_t> coplanar;
};

std::size_t hash_of(const Double3& p) {
  std::size_t sum = 0;
  for (const double x : p) sum = sum * 0x9e3779b97f4a7c15ULL + std::hash<double>()(x + 0.0);
  return sum;
}

bool is_same(const ExactPoint& a, const ExactPoint& b) {
  for (std::size_t k = 0; k < 3; ++k)
    if (a.x[k] * b.w != b.x[k] * a.w) return false;
  return true;
}

class SelfCutter {
 public:
  SelfCutter(const SolidMesh& mesh, std::span<const PointPair> pairs) : mesh_(mesh), pairs_(pairs) {
    out_.points = PointTable(mesh.points);
  }

  SelfCuts run() {
    for (const auto& [f, g] : pairs_)
      for (const std::uint32_t face : {f, g}) begin(face);
    for (const auto& [f, g] : pairs_) meet(f, g);
    for (const auto& [face, cuts] : faces_) cross_segments(cuts);
    do spread_edges();
    while (split_segments());
    collect();
    return std::move(out_);
  }

 private:
  const Double3& at(std::uint32_t v) const { return out_.points.near(v); }
  const CutCorners& corners(std::uint32_t f) const { return mesh_.faces[f]; }
  int turn(const FlatAxes& axes, std::uint32_t a, std::uint32_t b, std::uint32_t c) const {
    return out_.points.orient2d(a, b, c, axes[0], axes[1]);
  }

  void begin(std::uint32_t face) {
    const auto [here, fresh] = faces_.try_emplace(face);
    if (!fresh) return;
    here->second.axes = flat_axes(out_.points, corners(face));
    for (const std::uint32_t v : corners(face)) {
      here->second.points.insert(v);
      if (known_vertices_.insert(v).second) by_place_.emplace(hash_of(at(v)), v);
    }
  }

  /// The number of a point, which may be one that is there.
  std::uint32_t number_of(const ExactPoint& p) {
    const std::size_t hash = hash_of(out_.points.grid().rounded(p));
    const auto [begin, end] = by_place_.equal_range(hash);
    for (auto i = begin; i != end; ++i)
      if (is_same(out_.points.exact(i->second), p)) return i->second;
    const std::uint32_t number = out_.points.add(p);
    by_place_.emplace(hash, number);
    return number;
  }

  void add(std::uint32_t point) {
    if (std::find(here_.begin(), here_.end(), point) == here_.end()) here_.push_back(point);
  }

  /// Points that two faces have in common, and the segments between them.
  void meet(std::uint32_t f, std::uint32_t g) {
    const CutCorners &a = corners(f), &b = corners(g);
    FaceCuts &in_f = faces_.at(f), &in_g = faces_.at(g);
    here_.clear();
    std::array<int, 3> of_a, of_b;
    for (std::size_t k = 0; k < 3; ++k) {
      of_a[k] = orient3d_sign(at(b[0]), at(b[1]), at(b[2]), at(a[k]));
      of_b[k] = orient3d_sign(at(a[0]), at(a[1]), at(a[2]), at(b[k]));
    }
    for (std::size_t k = 0; k < 3; ++k) {
      if (of_a[k] == 0 && lies_on_face(out_.points, b, a[k], in_g.axes[0], in_g.axes[1])) add(a[k]);
      if (of_b[k] == 0 && lies_on_face(out_.points, a, b[k], in_f.axes[0], in_f.axes[1])) add(b[k]);
    }
    const bool in_plane = of_a == std::array<int, 3>{0, 0, 0};
    if (in_plane) {
      meet_in_plane(f, g);
    } else {
      for (std::size_t k = 0; k < 3; ++k) {
        const std::size_t next = (k + 1) % 3;
        if (of_a[k] * of_a[next] < 0) pass(a[k], a[next], b);
        if (of_b[k] * of_b[next] < 0) pass(b[k], b[next], a);
      }
      if (here_.size() == 2) add_segment(in_f, in_g, here_[0], here_[1]);
    }
    for (const std::uint32_t p : here_) in_f.points.insert(p), in_g.points.insert(p);
  }

  /// Where an edge with its ends on both sides of a face's plane passes the face.
  void pass(std::uint32_t v, std::uint32_t w, const CutCorners& face) {
    int low = 1, high = -1;
    for (std::size_t k = 0; k < 3; ++k) {
      const int sign = orient3d_sign(at(v), at(w), at(face[k]), at(face[(k + 1) % 3]));
      low = std::min(low, sign), high = std::max(high, sign);
    }
    if (low < 0 && high > 0) return;
    add(number_of(out_.points.grid().on_plane(at(v), at(w), at(face[0]), at(face[1]), at(face[2]))));
  }

  void meet_in_plane(std::uint32_t f, std::uint32_t g) {
    const CutCorners &a = corners(f), &b = corners(g);
    FaceCuts &in_f = faces_.at(f), &in_g = faces_.at(g);
    const FlatAxes axes = in_f.axes;
    for (std::size_t i = 0; i < 3; ++i)
      for (std::size_t j = 0; j < 3; ++j) {
        const std::uint32_t p = a[i], q = a[(i + 1) % 3], r = b[j], s = b[(j + 1) % 3];
        if (turn(axes, p, q, r) * turn(axes, p, q, s) < 0 && turn(axes, r, s, p) * turn(axes, r, s, q) < 0)
          add(number_of(out_.points.grid().on_line(at(p), at(q), at(r), at(s))));
      }
    // What an edge of either has in common with the other face.
    for (const CutCorners& c : {a, b})
      for (std::size_t k = 0; k < 3; ++k) {
        std::vector<std::uint32_t> on;
        for (const std::uint32_t p : here_)
          if (p == c[k] || p == c[(k + 1) % 3] || turn(axes, c[k], c[(k + 1) % 3], p) == 0) on.push_back(p);
        sort_along(on);
        for (std::size_t i = 1; i < on.size(); ++i) add_segment(in_f, in_g, on[i - 1], on[i]);
      }
    if (here_.size() < 3) return;
    ++out_.coplanar_pairs;
    in_f.coplanar.push_back(g);
    in_g.coplanar.push_back(f);
  }

  void add_segment(FaceCuts& in_f, FaceCuts& in_g, std::uint32_t p, std::uint32_t q) {
    const PointPair segment = std::minmax(p, q);
    in_f.segments.insert(segment);
    in_g.segments.insert(segment);
    on_segment_.try_emplace(segment);
  }

  /// By coordinates, exactly.
  bool is_before(std::uint32_t p, std::uint32_t q) const {
    for (std::size_t k = 0; k < 3; ++k) {
      if (at(p)[k] != at(q)[k]) return at(p)[k] < at(q)[k];
      if (out_.points.is_given(p) && out_.points.is_given(q)) continue;
      const ExactPoint a = out_.points.exact(p), b = out_.points.exact(q);
      const BigInt left = a.x[k] * b.w, right = b.x[k] * a.w;
      if (left != right) return left < right;
    }
    return false;
  }
  void sort_along(std::vector<std::uint32_t>& line) const {
    std::sort(line.begin(), line.end(), [&](std::uint32_t p, std::uint32_t q) { return is_before(p, q); });
  }
  bool is_within(std::uint32_t p, const PointPair& s) const {
    return is_before(s.first, s.second) ? is_before(s.first, p) && is_before(p, s.second)
                                        : is_before(s.second, p) && is_before(p, s.first);
  }

  bool may_meet(const PointPair& s, const PointPair& t) const {
    for (std::size_t k = 0; k < 3; ++k)
      if (std::max(at(s.first)[k], at(s.second)[k]) < std::min(at(t.first)[k], at(t.second)[k]) ||
          std::max(at(t.first)[k], at(t.second)[k]) < std::min(at(s.first)[k], at(s.second)[k]))
        return false;
    return true;
  }

  /// Points in which segments of a face pass each other.
  void cross_segments(const FaceCuts& cuts) {
    const FlatAxes& axes = cuts.axes;
    for (auto s = cuts.segments.begin(); s != cuts.segments.end(); ++s)
      for (auto t = std::next(s); t != cuts.segments.end(); ++t) {
        if (!may_meet(*s, *t)) continue;
        const auto [a, b] = *s;
        const auto [c, d] = *t;
        if (a == c || a == d || b == c || b == d) continue;
        if (turn(axes, a, b, c) * turn(axes, a, b, d) >= 0) continue;
        if (turn(axes, c, d, a) * turn(axes, c, d, b) >= 0) continue;
        const std::uint32_t p = number_of(crossing_of(axes, *s, *t));
        on_segment_[*s].insert(p);
        on_segment_[*t].insert(p);
      }
  }

  /// a + t (b - a) with t = [a c d] / ([a c d] - [b c d]), in homogeneous coordinates.
  ExactPoint crossing_of(const FlatAxes& axes, const PointPair& s, const PointPair& t) const {
    const ExactPoint a = out_.points.exact(s.first), b = out_.points.exact(s.second);
    const ExactPoint c = out_.points.exact(t.first), d = out_.points.exact(t.second);
    const auto determinant = [&](const ExactPoint& p) {
      const auto [u, v] = axes;
      return BigInt(p.x[u] * BigInt(c.x[v] * d.w - d.x[v] * c.w) -
                    p.x[v] * BigInt(c.x[u] * d.w - d.x[u] * c.w) +
                    p.w * BigInt(c.x[u] * d.x[v] - d.x[u] * c.x[v]));
    };
    const BigInt of_a = determinant(a), of_b = determinant(b);
    ExactPoint p;
    p.w = of_a * b.w - of_b * a.w;
    BigInt common = p.w;
    for (std::size_t k = 0; k < 3; ++k) {
      p.x[k] = of_a * b.x[k] - of_b * a.x[k];
      common = boost::multiprecision::gcd(common, p.x[k]);
    }
    if (p.w < 0) common = -common;
    for (BigInt& x : p.x) x /= common;
    p.w /= common;
    return p;
  }

  /// Points on an edge are points of all faces at it.
  void spread_edges() {
    std::map<PointPair, std::set<std::uint32_t>> on_edge;
    for (const auto& [face, cuts] : faces_) {
      const CutCorners& c = corners(face);
      for (std::size_t k = 0; k < 3; ++k) {
        const std::uint32_t v = c[k], w = c[(k + 1) % 3];
        for (const std::uint32_t p : cuts.points)
          if (p != c[0] && p != c[1] && p != c[2] && turn(cuts.axes, v, w, p) == 0)
            on_edge[std::minmax(v, w)].insert(p);
      }
    }
    if (on_edge.empty()) return;
    for (std::uint32_t f = 0; f < mesh_.faces.size(); ++f)
      for (std::size_t k = 0; k < 3; ++k) {
        const auto found = on_edge.find(std::minmax(corners(f)[k], corners(f)[(k + 1) % 3]));
        if (found == on_edge.end()) continue;
        begin(f);
        faces_.at(f).points.insert(found->second.begin(), found->second.end());
      }
  }

  /// Points on a segment are points of all faces that it is in. \returns whether any face got one
  bool split_segments() {
    for (const auto& [face, cuts] : faces_)
      for (const PointPair& s : cuts.segments)
        for (const std::uint32_t p : cuts.points)
          if (p != s.first && p != s.second && may_meet(s, {p, p}) &&
              turn(cuts.axes, s.first, s.second, p) == 0 && is_within(p, s))
            on_segment_[s].insert(p);
    bool grown = false;
    for (auto& [face, cuts] : faces_)
      for (const PointPair& s : cuts.segments)
        for (const std::uint32_t p : on_segment_.at(s)) grown = cuts.points.insert(p).second || grown;
    return grown;
  }

  void collect() {
    for (const auto& [face, cuts] : faces_) {
      MeshCuts::CutFace out;
      out.face = face;
      const CutCorners& c = corners(face);
      for (const std::uint32_t p : cuts.points)
        if (p != c[0] && p != c[1] && p != c[2]) out.inner.push_back(p);
      for (const PointPair& s : cuts.segments) {
        std::vector<std::uint32_t> line = {s.first, s.second};
        const std::set<std::uint32_t>& within = on_segment_.at(s);
        line.insert(line.end(), within.begin(), within.end());
        sort_along(line);
        for (std::size_t i = 1; i < line.size(); ++i)
          out.segments.push_back(std::minmax(line[i - 1], line[i]));
      }
      std::sort(out.segments.begin(), out.segments.end());
      out.segments.erase(std::unique(out.segments.begin(), out.segments.end()), out.segments.end());
      out_.segments.insert(out_.segments.end(), out.segments.begin(), out.segments.end());
      out.coplanar = cuts.coplanar;
      std::sort(out.coplanar.begin(), out.coplanar.end());
      out_.cut.push_back(std::move(out));
    }
    std::sort(out_.segments.begin(), out_.segments.end());
    out_.segments.erase(std::unique(out_.segments.begin(), out_.segments.end()), out_.segments.end());
  }

  const SolidMesh& mesh_;
  std::span<const PointPair> pairs_;
  SelfCuts out_;
  std::map<std::uint32_t, FaceCuts> faces_;
  std::map<PointPair, std::set<std::uint32_t>> on_segment_;  ///< points within the segments that pairs gave
  std::set<std::uint32_t> known_vertices_;
  std::unordered_multimap<std::size_t, std::uint32_t> by_place_;
  std::vector<std::uint32_t> here_;  ///< points of the two faces at hand
};

}  // namespace

std::array<std::size_t, 2> flat_axes(const PointTable& points, const std::array<std::uint32_t, 3>& face) {
  const Double3& a = points.near(face[0]);
  const Double3 n = cross(points.near(face[1]) - a, points.near(face[2]) - a);
  std::array<std::size_t, 3> by_size = {0, 1, 2};
  std::stable_sort(by_size.begin(), by_size.end(),
                   [&](std::size_t i, std::size_t j) { return std::fabs(n[i]) > std::fabs(n[j]); });
  for (const std::size_t k : by_size) {
    const std::size_t u = (k + 1) % 3, v = (k + 2) % 3;
    const int turn = points.orient2d(face[0], face[1], face[2], u, v);
    if (turn != 0) return turn > 0 ? std::array{u, v} : std::array{v, u};
  }
  throw std::logic_error("a face without area was to be cut");
}

bool lies_on_face(const PointTable& points, const std::array<std::uint32_t, 3>& face, std::uint32_t point,
                  std::size_t u, std::size_t v) {
  for (std::size_t k = 0; k < 3; ++k)
    if (points.orient2d(face[k], face[(k + 1) % 3], point, u, v) < 0) return false;
  return true;
}

SelfCuts find_self_cuts(const SolidMesh& mesh, std::span<const PointPair> pairs) {
  return SelfCutter(mesh, pairs).run();
}

}  // namespace tessera
