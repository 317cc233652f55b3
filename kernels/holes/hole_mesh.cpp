#include "kernels/holes/hole_mesh.h"

#include <algorithm>
#include <cassert>

#include "kernels/holes/hole_triangulation.h"
#include "octree/edge_faces.h"
#include "octree/vector.h"

// Two triangles at an edge, and what their corners are called here:
//
//        c                 t: (a, b, c), its edge e runs a -> b
//       / \                u: (b, a, d), its edge f runs b -> a
//      / t \               split: m in the middle of a b; flip: c d instead of a b
//     a --- b
//      \ u /
//       \ /
//        d

namespace tessera {
namespace {

constexpr int kMaxSplitRounds =
    64;  // the longest edge shrinks by a third a round, so this is never the limit
constexpr int kFlipSweeps = 6;
/// Halves of an edge just too long are no shorter than this half; the mean of all comes to about one.
constexpr double kSplitFrom = 1.7;

std::uint32_t mean_colour(std::uint32_t a, std::uint32_t b) {
  std::uint32_t out = 0;
  for (int s = 0; s < 32; s += 8) out |= (((a >> s & 0xff) + (b >> s & 0xff) + 1) / 2) << s;
  return out;
}

}  // namespace

HoleMesh::HoleMesh(const HoleLoop& loop, const std::vector<std::array<std::uint32_t, 3>>& faces)
    : loop_(&loop),
      boundary_(static_cast<std::uint32_t>(loop.position.size())),
      position_(loop.position),
      rgba_(loop.rgba) {
  for (const std::array<std::uint32_t, 3>& f : faces)
    triangles_.push_back({f, {kBoundary, kBoundary, kBoundary}});
  const std::vector<std::uint32_t> opposite = opposite_half_edges(position_.size(), faces);
  for (std::uint32_t h = 0; h < opposite.size(); ++h)
    if (opposite[h] != kNoHalfEdge) triangles_[h / 3].neighbour[h % 3] = opposite[h] / 3;
}

std::uint32_t HoleMesh::side_of(std::uint32_t triangle, std::uint32_t neighbour) const {
  const auto& n = triangles_[triangle].neighbour;
  return n[0] == neighbour ? 0 : n[1] == neighbour ? 1 : 2;
}

void HoleMesh::replace_neighbour(std::uint32_t triangle, std::uint32_t was, std::uint32_t is) {
  if (triangle != kBoundary) triangles_[triangle].neighbour[side_of(triangle, was)] = is;
}

double HoleMesh::squared_length(const Triangle& t, std::uint32_t e) const {
  const Double3 d = position_[t.vertex[(e + 1) % 3]] - position_[t.vertex[e]];
  return dot(d, d);
}

double HoleMesh::longest_inner() const {
  double longest = 0.0;
  for (const Triangle& t : triangles_)
    for (std::uint32_t e = 0; e < 3; ++e)
      if (t.neighbour[e] != kBoundary) longest = std::max(longest, squared_length(t, e));
  return longest;
}

void HoleMesh::split(std::uint32_t t, std::uint32_t e) {
  const std::uint32_t u = triangles_[t].neighbour[e];
  const std::uint32_t f = side_of(u, t);
  const auto [a, b, c] = std::array{triangles_[t].vertex[e], triangles_[t].vertex[(e + 1) % 3],
                                    triangles_[t].vertex[(e + 2) % 3]};
  const std::uint32_t d = triangles_[u].vertex[(f + 2) % 3];
  const auto m = static_cast<std::uint32_t>(position_.size());
  position_.push_back((position_[a] + position_[b]) * 0.5);
  if (!rgba_.empty()) rgba_.push_back(mean_colour(rgba_[a], rgba_[b]));
  const auto t2 = static_cast<std::uint32_t>(triangles_.size()), u2 = t2 + 1;
  const std::uint32_t bc = triangles_[t].neighbour[(e + 1) % 3], ca = triangles_[t].neighbour[(e + 2) % 3];
  const std::uint32_t ad = triangles_[u].neighbour[(f + 1) % 3], db = triangles_[u].neighbour[(f + 2) % 3];
  triangles_[t] = {{a, m, c}, {u2, t2, ca}};
  triangles_.push_back({{m, b, c}, {u, bc, t}});
  triangles_[u] = {{b, m, d}, {t2, u2, db}};
  triangles_.push_back({{m, a, d}, {t, ad, u}});
  replace_neighbour(bc, t, t2);
  replace_neighbour(ad, u, u2);
}

/// Whether an edge joins the two vertices; `triangle` holds `from`.
bool HoleMesh::joined(std::uint32_t from, std::uint32_t triangle, std::uint32_t to) const {
  if (from < boundary_ && to < boundary_) {
    const std::uint32_t low = std::min(from, to), high = std::max(from, to);
    if (high == low + 1 || (low == 0 && high + 1 == boundary_)) return true;
    if (std::binary_search(loop_->taken.begin(), loop_->taken.end(), std::array{low, high})) return true;
  }
  for (const bool forward : {true, false}) {  // around an inner vertex the first turn sees all
    std::uint32_t t = triangle;
    do {
      const auto& v = triangles_[t].vertex;
      if (v[0] == to || v[1] == to || v[2] == to) return true;
      const std::uint32_t corner = v[0] == from ? 0 : v[1] == from ? 1 : 2;
      t = triangles_[t].neighbour[forward ? (corner + 2) % 3 : corner];
    } while (t != kBoundary && t != triangle);
    if (t == triangle) break;
  }
  return false;
}

bool HoleMesh::wants_flip(std::uint32_t t, std::uint32_t e) const {
  const std::uint32_t u = triangles_[t].neighbour[e];
  if (u == kBoundary) return false;
  const std::uint32_t va = triangles_[t].vertex[e], vb = triangles_[t].vertex[(e + 1) % 3],
                      vc = triangles_[t].vertex[(e + 2) % 3],
                      vd = triangles_[u].vertex[(side_of(u, t) + 2) % 3];
  const Double3 &a = position_[va], &b = position_[vb], &c = position_[vc], &d = position_[vd];
  // sin(angle at c + angle at d) < 0, up to rounding: a point beyond the circle of the others.
  const Double3 ca = a - c, cb = b - c, da = a - d, db = b - d;
  const double cos_c = dot(ca, cb), sin_c = norm(cross(ca, cb));
  const double cos_d = dot(da, db), sin_d = norm(cross(da, db));
  if (!(sin_c * cos_d + cos_c * sin_d < -1e-9 * (dot(ca, ca) + dot(cb, cb)) * (dot(da, da) + dot(db, db))))
    return false;
  if (!has_area(c, d, b) || !has_area(d, c, a)) return false;
  // In space the other diagonal may fold what was flat.
  const Double3 n_t = unit_or_zero(cross(b - a, c - a)), n_u = unit_or_zero(cross(a - b, d - b));
  const Double3 n_1 = unit_or_zero(cross(d - c, b - c)), n_2 = unit_or_zero(cross(c - d, a - d));
  constexpr double kFlat = 0.5;
  if (dot(n_1, n_2) < std::min(kFlat, dot(n_t, n_u))) return false;
  return !joined(vc, t, vd);
}

void HoleMesh::flip(std::uint32_t t, std::uint32_t e) {
  const std::uint32_t u = triangles_[t].neighbour[e];
  const std::uint32_t f = side_of(u, t);
  const auto [a, b, c] = std::array{triangles_[t].vertex[e], triangles_[t].vertex[(e + 1) % 3],
                                    triangles_[t].vertex[(e + 2) % 3]};
  const std::uint32_t d = triangles_[u].vertex[(f + 2) % 3];
  const std::uint32_t bc = triangles_[t].neighbour[(e + 1) % 3], ca = triangles_[t].neighbour[(e + 2) % 3];
  const std::uint32_t ad = triangles_[u].neighbour[(f + 1) % 3], db = triangles_[u].neighbour[(f + 2) % 3];
  triangles_[t] = {{c, d, b}, {u, db, bc}};
  triangles_[u] = {{d, c, a}, {t, ca, ad}};
  replace_neighbour(db, u, t);
  replace_neighbour(ca, t, u);
}

void HoleMesh::flip_all() {
  for (int sweep = 0; sweep < kFlipSweeps; ++sweep) {
    bool any = false;
    for (std::uint32_t t = 0; t < triangles_.size(); ++t)
      for (std::uint32_t e = 0; e < 3; ++e)
        if (wants_flip(t, e)) {
          flip(t, e);
          any = true;
        }
    if (!any) break;
  }
}

void HoleMesh::refine(double edge, std::size_t maximum) {
  const double enough = edge * edge * kSplitFrom * kSplitFrom;
  flip_all();
  for (int round = 0; round < kMaxSplitRounds; ++round) {
    const double longest = longest_inner();
    if (longest <= enough) break;
    const double minimum = std::max(enough, longest * 0.49);
    const auto count = static_cast<std::uint32_t>(triangles_.size());
    for (std::uint32_t t = 0; t < count; ++t)
      for (std::uint32_t e = 0; e < 3; ++e) {
        if (position_.size() - boundary_ >= maximum) return;
        if (triangles_[t].neighbour[e] != kBoundary && squared_length(triangles_[t], e) >= minimum)
          split(t, e);
      }
    flip_all();
  }
}

void HoleMesh::relax(int rounds) {
  std::vector<Double3> sum(position_.size());
  std::vector<double> count(position_.size());
  for (int round = 0; round < rounds; ++round) {
    std::fill(sum.begin(), sum.end(), Double3{});
    std::fill(count.begin(), count.end(), 0.0);
    for (const Triangle& t : triangles_)
      for (std::uint32_t e = 0; e < 3; ++e) {
        const std::uint32_t a = t.vertex[e], b = t.vertex[(e + 1) % 3];
        if (a < boundary_) continue;  // each inner edge comes from both sides, once per end
        sum[a] = sum[a] + position_[b];
        count[a] += 1.0;
      }
    for (std::size_t v = boundary_; v < position_.size(); ++v)
      if (count[v] > 0.0) position_[v] = sum[v] * (1.0 / count[v]);
    flip_all();
  }
}

}  // namespace tessera
