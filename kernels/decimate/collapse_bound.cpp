#include "kernels/decimate/collapse_bound.h"

#include <algorithm>
#include <cmath>

#include "kernels/decimate/collapse_legality.h"
#include "kernels/mesh/mean_ratio.h"
#include "octree/rounding.h"

namespace tessera {
namespace {

/// Adds w, `at` from the centre of the loop, and with it the edge from there on, which lies opposite the corner.
void add_corner(const CollapseMesh& mesh, std::uint32_t w, const Double3& at, std::uint32_t corner,
                LinkLoop& loop) {
  const std::uint64_t bit = std::uint64_t{1} << loop.size;
  if (corner != kNoCorner) {
    if (mesh.border_edge(corner)) loop.borders |= bit;
    if (mesh.crease_edge(corner)) loop.creases |= bit;
  }
  if (mesh.state(w) & (kVertexBorder | kVertexCrease | kVertexFixed)) loop.ends |= bit;
  loop.at[loop.size++] = at;
}

/// The side of the star whose ring runs from place `from` to `to`, counter-clockwise; v at one of them takes over.
void lay_side(const CollapseMesh& mesh, const Star& star, std::uint32_t v, std::size_t from, std::size_t to,
              LinkLoop& loop) {
  const bool v_first = star.ring[from] == v;
  const bool border = (mesh.state(v) & kVertexBorder) != 0 && !star.closed;
  const auto add = [&](std::uint32_t w, std::uint32_t corner) {
    add_corner(mesh, w, mesh.at(w) - mesh.at(v), corner, loop);
  };
  // The loop starts with v; the edge between v and the other end closes it and is the line.
  const auto add_line = [&](std::uint32_t w) {
    (border ? loop.borders : loop.creases) |= std::uint64_t{1} << loop.size;
    add(w, kNoCorner);
  };
  loop.clear();
  if (!v_first) add_line(v);
  for (std::size_t i = from; i != to; i = star.following(i)) add(star.ring[i], star.corner[i]);
  if (v_first) add_line(star.ring[to]);
}

/// The place in the ring where the line through the centre goes on beyond ring[at].
std::size_t other_end_of_line(const CollapseMesh& mesh, bool border, const Star& star, std::size_t at) {
  if (border) return at == 0 ? star.faces : 0;
  std::size_t end = 0;
  for (std::size_t i = 0; i < star.faces; ++i)
    if (i != at && is_crease_spoke(mesh, star, i)) end = i;
  return end;
}

CollapseBound with_bound(const CollapseMesh& mesh, const Star& star, double deviation,
                         const CollapseFoot& foot) {
  return {rounded_up(max_face_bound(mesh, star) + deviation * (1.0 + 1e-12)), foot};
}

/// The line's vertex first moves to its foot on the new edge, then each side for itself.
std::optional<CollapseBound> bound_along_line(const CollapseMesh& mesh, std::uint32_t u, const Star& star,
                                              std::size_t at, LinkSides& sides) {
  const std::uint32_t v = star.ring[at];
  const bool border = (mesh.state(u) & kVertexBorder) != 0;
  const std::size_t end = other_end_of_line(mesh, border, star, at);
  const Double3 edge = mesh.at(star.ring[end]) - mesh.at(v), from = mesh.at(u) - mesh.at(v);
  const double length2 = dot(edge, edge);
  if (!(length2 > 0.0)) return std::nullopt;
  const double t = std::clamp(dot(from, edge) / length2, 0.0, 1.0);
  const Double3 foot = edge * t;
  sides.count = 0;
  if (!border || at == 0) {
    LinkLoop& loop = sides.loop[sides.count];
    lay_side(mesh, star, v, at, end, loop);
    sides.flat_edge[sides.count++] = loop.size - 1;
  }
  if (!border || at != 0) {
    lay_side(mesh, star, v, end, at, sides.loop[sides.count]);
    sides.flat_edge[sides.count++] = 0;
  }
  double deviation = 0.0;
  for (std::size_t s = 0; s < sides.count; ++s) {
    double side = 0.0;
    if (!fan_deviation(sides.loop[s], foot, sides.flat_edge[s], side)) return std::nullopt;
    deviation = std::fmax(deviation, side);
  }
  return with_bound(mesh, star, deviation + norm(from - foot), {star.ring[end], v, v, t, 0.0});
}

}  // namespace

double max_face_bound(const CollapseMesh& mesh, const Star& star) {
  float bound = 0.0f;
  for (std::size_t i = 0; i < star.faces; ++i) bound = std::max(bound, mesh.face(star.corner[i] >> 2).bound);
  return static_cast<double>(bound);
}

void lay_link(const CollapseMesh& mesh, const Star& star, std::size_t at, LinkSides& sides) {
  sides.count = 1;
  sides.flat_edge[0] = kNoFlatEdge;
  LinkLoop& loop = sides.loop[0];
  loop.clear();
  const Double3& centre = mesh.at(star.ring[at]);
  for (std::size_t n = 0, i = at; n < star.faces; ++n, i = i + 1 < star.faces ? i + 1 : 0)
    add_corner(mesh, star.ring[i], mesh.at(star.ring[i]) - centre, star.corner[i], loop);
}

std::optional<CollapseBound> bound_by_sum(const CollapseMesh& mesh, std::uint32_t u, const Star& star,
                                          std::size_t at, LinkSides& sides) {
  if (mesh.state(u) & (kVertexBorder | kVertexCrease)) return bound_along_line(mesh, u, star, at, sides);
  lay_link(mesh, star, at, sides);
  const std::uint32_t v = star.ring[at];
  double deviation = 0.0;
  FanFoot foot;
  if (!fan_deviation(sides.loop[0], mesh.at(u) - mesh.at(v), kNoFlatEdge, deviation, &foot))
    return std::nullopt;
  const auto ring_at = [&](std::size_t i) { return star.ring[(at + i) % star.ring_size()]; };
  return with_bound(mesh, star, deviation,
                    {ring_at(foot.sector), ring_at(foot.sector + 1), v, foot.first, foot.second});
}

bool lay_edge_link(const CollapseMesh& mesh, const Star& star, std::size_t at, const Star& other,
                   const Double3& p, double min_mean_ratio, LinkLoop& loop) {
  if (star.faces + other.faces > kMaxRing) return false;
  loop.clear();
  loop.at[loop.size++] = {0, 0, 0};
  // Around the centre of a star from behind the other end of the edge to before it.
  const auto add = [&](const Star& s, std::size_t end) {
    const Double3 centre = mesh.at(mesh.vertex(s.corner[0]));
    for (std::size_t n = 1; n + 1 < s.faces; ++n) {
      const std::size_t i = (end + n) % s.faces;
      const Double3 a = mesh.at(s.ring[i]), b = mesh.at(s.ring[s.following(i)]);
      const Double3 old_normal = cross(a - centre, b - centre), new_normal = cross(a - p, b - p);
      const double old_area = norm(old_normal), new_area = norm(new_normal);
      if (!(new_area > 0.0) || dot(old_normal, new_normal) < 0.2 * old_area * new_area ||
          mean_ratio(p, a, b) < min_mean_ratio)
        return false;
      add_corner(mesh, s.ring[i], a - p, s.corner[i], loop);
    }
    return true;
  };
  const std::uint32_t u = mesh.vertex(star.corner[0]);
  const auto from_v =
      static_cast<std::size_t>(std::find(other.ring.begin(), other.ring.end(), u) - other.ring.begin());
  return add(star, at) && add(other, from_v);
}

}  // namespace tessera
