#include "kernels/mesh/face_contact.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <optional>
#include <utility>

#include "kernels/mesh/orientation_sign.h"

namespace tessera {
namespace {

using Corners = std::array<Double3, 3>;
using Signs = std::array<int, 3>;

bool all_beyond(const Signs& s) {
  return (s[0] > 0 && s[1] > 0 && s[2] > 0) || (s[0] < 0 && s[1] < 0 && s[2] < 0);
}
bool on_both_sides(const Signs& s) {
  return std::max({s[0], s[1], s[2]}) > 0 && std::min({s[0], s[1], s[2]}) < 0;
}

Signs sides(const Corners& plane, const Corners& of) {
  Signs s;
  for (std::size_t k = 0; k < 3; ++k) s[k] = orient3d_sign(plane[0], plane[1], plane[2], of[k]);
  return s;
}

/// Rotates to the front the corner whose two edges meet the other plane: one alone on its side of it. In the end it lies on
/// the upper side, or in the plane and the others below: for that the other triangle is reversed where need be.
/// \pre neither all corners on one side nor all in the plane
void lone_corner_first(Corners& t, const Signs& s, Corners& other, Signs& of_other) {
  const auto alone = [&](std::size_t k, int side) {
    const int m = side * s[(k + 1) % 3], n = side * s[(k + 2) % 3];
    return side * s[k] > 0 ? m <= 0 && n <= 0 : s[k] == 0 && m < 0 && n < 0;
  };
  for (const int side : {1, -1})
    for (std::size_t k = 0; k < 3; ++k)
      if (alone(k, side)) {
        std::rotate(t.begin(), t.begin() + static_cast<std::ptrdiff_t>(k), t.end());
        if (side < 0) std::swap(other[1], other[2]), std::swap(of_other[1], of_other[2]);
        return;
      }
}

/// The stretches of the line of both planes that lie in the triangles: 1 if they have a stretch in common, 0 if a point, -1
/// if nothing.
int common_stretch(Corners a, Signs sa, Corners b, Signs sb) {
  lone_corner_first(a, sa, b, sb);
  lone_corner_first(b, sb, a, sa);
  const int one = orient3d_sign(a[0], a[1], b[0], b[1]), two = orient3d_sign(a[0], a[2], b[2], b[0]);
  return std::max(one, two) > 0 ? -1 : std::max(one, two) < 0 ? 1 : 0;
}

using Flat3 = std::array<Double2, 3>;

/// Counter-clockwise, along axes k and k + 1: the first two in whose plane they have an area.
/// \param at_p,at_q  of corners of a and b: afterwards, where p and q hold them
void flatten(const Corners& a, const Corners& b, Flat3& p, Flat3& q, std::size_t& at_p, std::size_t& at_q) {
  const auto reverse = [](Flat3& t, std::size_t& at) {
    std::swap(t[1], t[2]);
    if (at != 0) at = 3 - at;
  };
  for (std::size_t k = 0;; ++k) {
    const std::size_t l = (k + 1) % 3;
    for (std::size_t i = 0; i < 3; ++i) p[i] = {a[i][k], a[i][l]}, q[i] = {b[i][k], b[i][l]};
    const int turn = orient2d_sign(p[0], p[1], p[2]);
    if (turn == 0 && k < 2) continue;
    if (turn < 0) reverse(p, at_p);
    if (orient2d_sign(q[0], q[1], q[2]) < 0) reverse(q, at_q);
    return;
  }
}

/// By an edge of p. 1: q lies strictly beyond it, 0: beyond it or on it, -1: no edge has all of q beyond.
int separated(const Flat3& p, const Flat3& q) {
  int best = -1;
  for (std::size_t k = 0; k < 3; ++k) {
    int nearest = -1;
    for (const Double2& c : q) nearest = std::max(nearest, orient2d_sign(p[k], p[(k + 1) % 3], c));
    best = std::max(best, -nearest);
  }
  return best;
}

/// Whether the edges from a common corner to x and to y leave it in one direction.
bool same_ray(const Double2& corner, const Double2& x, const Double2& y) {
  if (orient2d_sign(corner, x, y) != 0) return false;
  for (std::size_t k = 0; k < 2; ++k)
    if (x[k] != corner[k]) return (x[k] > corner[k]) == (y[k] > corner[k]) && y[k] != corner[k];
  return false;
}

/// \param shared  the corner of each that they have in common, if they share one
FaceContact coplanar_contact(const ContactFace& a, const ContactFace& b,
                             std::optional<std::pair<std::size_t, std::size_t>> shared) {
  Flat3 p, q;
  auto [i, j] = shared.value_or(std::pair<std::size_t, std::size_t>{0, 0});
  flatten(a.corner, b.corner, p, q, i, j);
  const int apart = std::max(separated(p, q), separated(q, p));
  if (apart < 0) return FaceContact::kOverlap;
  if (apart > 0) return FaceContact::kNone;
  if (!shared) return FaceContact::kTouch;
  // Beside the corner that they share, only along edges that leave it together.
  for (std::size_t m = 1; m < 3; ++m)
    for (std::size_t n = 1; n < 3; ++n)
      if (same_ray(p[i], p[(i + m) % 3], q[(j + n) % 3])) return FaceContact::kTouch;
  return FaceContact::kNone;
}

/// Whether rounding leaves no doubt that the faces on edge a, b with tips c and d do not fold back: seen along the edge the
/// tips lie in directions less than 90 degrees off opposite ones.
bool opens(const Double3& a, const Double3& b, const Double3& c, const Double3& d) {
  const Double3 edge = b - a, u = c - a, v = d - a, m = cross(edge, u), n = cross(edge, v);
  return dot(m, n) < -1e-13 * dot(edge, edge) * norm(u) * norm(v);
}

/// Whether rounding leaves no doubt that a face lies beyond one of the two sides of another at the corner that they share, seen
/// along that one's normal: then they meet in the corner alone. So it is with most faces around a vertex.
/// \param u,v  from the corner along the sides; p, q: along those of the face that is asked about
bool beyond_a_side(const Double3& u, const Double3& v, const Double3& p, const Double3& q) {
  // Inward normals of the sides are cross(n, u) and -cross(n, v), n = cross(u, v): with (u . v) and squares they need no n.
  const double uu = dot(u, u), vv = dot(v, v), uv = dot(u, v);
  const double up = dot(u, p), vp = dot(v, p), uq = dot(u, q), vq = dot(v, q);
  const double lengths = std::sqrt(std::max(dot(p, p), dot(q, q)));
  // cross(cross(u, v), u) . x = (u . u)(v . x) - (u . v)(u . x), each term at most u^2 v x long.
  const double in_u = 1e-13 * uu * std::sqrt(vv) * lengths, in_v = 1e-13 * vv * std::sqrt(uu) * lengths;
  return (uu * vp - uv * up < -in_u && uu * vq - uv * uq < -in_u) ||
         (vv * up - uv * vp < -in_v && vv * uq - uv * vq < -in_v);
}

}  // namespace

FaceContact face_contact(const ContactFace& a, const ContactFace& b) {
  std::array<std::size_t, 3> in_a{}, in_b{};
  std::size_t shared = 0;
  for (std::size_t i = 0; i < 3; ++i)
    for (std::size_t j = 0; j < 3; ++j)
      if (a.vertex[i] == b.vertex[j]) in_a[shared] = i, in_b[shared] = j, ++shared;
  if (shared == 3) return FaceContact::kOverlap;
  if (shared == 2) {
    const Double3 &p = a.corner[in_a[0]], &q = a.corner[in_a[1]];
    const Double3 &tip = a.corner[3 - in_a[0] - in_a[1]], &other = b.corner[3 - in_b[0] - in_b[1]];
    if (opens(p, q, tip, other) || orient3d_sign(p, q, tip, other) != 0) return FaceContact::kNone;
    return coplanar_contact(a, b, std::nullopt) == FaceContact::kOverlap ? FaceContact::kOverlap
                                                                         : FaceContact::kNone;
  }
  Signs of_b{}, of_a{};
  if (shared == 1) {
    const auto side = [](const ContactFace& f, std::size_t corner, std::size_t k) {
      return f.corner[(corner + k) % 3] - f.corner[corner];
    };
    const Double3 u = side(a, in_a[0], 1), v = side(a, in_a[0], 2), p = side(b, in_b[0], 1),
                  q = side(b, in_b[0], 2);
    if (beyond_a_side(u, v, p, q) || beyond_a_side(p, q, u, v)) return FaceContact::kNone;
    // What they share lies in both planes.
    for (std::size_t k = 1; k < 3; ++k) {
      const std::size_t i = (in_b[0] + k) % 3;
      of_b[i] = orient3d_sign(a.corner[0], a.corner[1], a.corner[2], b.corner[i]);
    }
    if (of_b[(in_b[0] + 1) % 3] * of_b[(in_b[0] + 2) % 3] > 0) return FaceContact::kNone;
  } else {
    of_b = sides(a.corner, b.corner);
    if (all_beyond(of_b)) return FaceContact::kNone;
  }
  if (of_b == Signs{0, 0, 0})
    return coplanar_contact(a, b, shared == 1 ? std::optional(std::pair(in_a[0], in_b[0])) : std::nullopt);
  if (shared == 1) {
    for (std::size_t k = 1; k < 3; ++k) {
      const std::size_t i = (in_a[0] + k) % 3;
      of_a[i] = orient3d_sign(b.corner[0], b.corner[1], b.corner[2], a.corner[i]);
    }
    if (of_a[(in_a[0] + 1) % 3] * of_a[(in_a[0] + 2) % 3] > 0) return FaceContact::kNone;
  } else {
    of_a = sides(b.corner, a.corner);
    if (all_beyond(of_a)) return FaceContact::kNone;
  }
  const int common = common_stretch(a.corner, of_a, b.corner, of_b);
  if (common < 0 || (common == 0 && shared == 1)) return FaceContact::kNone;
  return common > 0 && on_both_sides(of_a) && on_both_sides(of_b) ? FaceContact::kCross : FaceContact::kTouch;
}

bool meet_in_copies(const ContactFace& a, ContactFace b) {
  bool any = false;
  for (std::size_t j = 0; j < 3; ++j)
    for (std::size_t i = 0; i < 3; ++i)
      if (b.corner[j] == a.corner[i] && b.vertex[j] != a.vertex[i]) b.vertex[j] = a.vertex[i], any = true;
  return any && face_contact(a, b) == FaceContact::kNone;
}

}  // namespace tessera
