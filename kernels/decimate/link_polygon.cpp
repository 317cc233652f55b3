#include "kernels/decimate/link_polygon.h"

#include <algorithm>
#include <cmath>

namespace tessera {
namespace {

template <class T>
constexpr T cross_xy(T ax, T ay, T bx, T by) {
  return ax * by - ay * bx;
}
float cross_xy(const Float3& a, const Float3& b) {
  return cross_xy(a[0], a[1], b[0], b[1]);
}
Float3 position_of(const PolygonPoint& p) {
  return {p.x, p.y, p.z};
}

/// Calls `visit(index)` for each bit that is set, lowest first.
template <class Visit>
void for_each_bit(std::uint64_t bits, const Visit& visit) {
  for (; bits != 0; bits &= bits - 1) visit(static_cast<std::size_t>(std::countr_zero(bits)));
}

/// The corners of a loop in the frame of its polygon.
struct FramedLoop {
  std::array<double, LinkPolygon::kPadded> x, y, z;
};

/// Frame and corners. \return false where the loop has no area
bool set_frame(const LinkLoop& loop, LinkPolygon& g, FramedLoop& at) {
  Double3 area{0, 0, 0};
  for (std::size_t i = 1; i < g.size; ++i) area = area + cross(loop.at[i], loop.at[g.following(i)]);
  const double length2 = dot(area, area);
  if (!(length2 > 0.0)) return false;
  const Double3 n = area * (1.0 / std::sqrt(length2));
  g.ex = any_orthogonal(n);
  g.ey = cross(n, g.ex);
  for (std::size_t a = 0; a < 3; ++a) {
    g.frame[4 * a] = static_cast<float>(g.ex[a]);
    g.frame[4 * a + 1] = static_cast<float>(g.ey[a]);
    g.frame[4 * a + 2] = static_cast<float>(n[a]);
  }
  double radius = 0.0;
  for (std::size_t i = 0; i < g.size; ++i) {
    at.x[i] = dot(loop.at[i], g.ex);
    at.y[i] = dot(loop.at[i], g.ey);
    at.z[i] = dot(loop.at[i], n);
    radius = std::max({radius, std::fabs(at.x[i]), std::fabs(at.y[i]), std::fabs(at.z[i])});
  }
  g.radius = static_cast<float>(radius);
  return true;
}

void set_link(const FramedLoop& at, LinkPolygon& g) {
  for (std::size_t i = 0; i < g.size; ++i) {
    const std::size_t j = g.following(i);
    const double dx = at.x[j] - at.x[i], dy = at.y[j] - at.y[i];
    g.x[i] = static_cast<float>(at.x[i]), g.y[i] = static_cast<float>(at.y[i]);
    g.z[i] = static_cast<float>(at.z[i]);
    g.edge_x[i] = static_cast<float>(dx), g.edge_y[i] = static_cast<float>(dy);
    g.edge_z[i] = static_cast<float>(at.z[j] - at.z[i]);
    // A point on the link is outside: what only touches the polygon does not count.
    g.edge_c[i] = static_cast<float>(cross_xy(dx, dy, at.x[i], at.y[i])) +
                  8.0f * 0x1p-24f * g.radius * (std::fabs(g.edge_x[i]) + std::fabs(g.edge_y[i]));
  }
  if (g.first == 1) g.edge_x[0] = g.edge_y[0] = g.edge_z[0] = g.edge_c[0] = 0.0f;  // left of it is everything
}

/// The planes of the faces of the fan. \return false where a closed one does not run once around its centre
bool set_sectors(const FramedLoop& at, LinkPolygon& g) {
  const bool closed = g.first == 1;
  int revolutions = 0;
  for (std::size_t i = 1; i < g.size; ++i) {
    const std::size_t j = g.following(i);
    if (j == 0) continue;
    const double full = cross_xy(at.x[i], at.y[i], at.x[j], at.y[j]);
    if (closed && !(full > 0.0)) return false;
    revolutions += at.y[i] < 0.0 && at.y[j] >= 0.0;
    g.slope_x[i] = static_cast<float>((at.z[i] * at.y[j] - at.z[j] * at.y[i]) / full);
    g.slope_y[i] = static_cast<float>((at.z[j] * at.x[i] - at.z[i] * at.x[j]) / full);
    g.cosine[i] = 1.0f / std::sqrt(1.0f + g.slope_x[i] * g.slope_x[i] + g.slope_y[i] * g.slope_y[i]);
  }
  g.corners = (std::uint64_t{1} << g.size) - 1;
  g.sectors = g.inner_spokes = g.corners & ~std::uint64_t{1};
  if (closed) return revolutions == 1;
  g.sectors &= ~(std::uint64_t{1} << (g.size - 1));
  g.inner_spokes = g.sectors & ~std::uint64_t{2};
  return true;
}

}  // namespace

bool make_polygon(const LinkLoop& loop, bool inner_centre, LinkPolygon& polygon) {
  polygon.size = loop.size;
  polygon.first = inner_centre ? 1 : 0;
  if (loop.size < 3 + polygon.first || loop.size >= LinkPolygon::kPadded) return false;
  FramedLoop at;
  if (!set_frame(loop, polygon, at)) return false;
  set_link(at, polygon);
  return set_sectors(at, polygon);
}

bool is_folded(const LinkPolygon& polygon, const PolygonTriangle& p) {
  const float ax = p[1]->x - p[0]->x, ay = p[1]->y - p[0]->y, bx = p[2]->x - p[0]->x, by = p[2]->y - p[0]->y;
  return cross_xy(ax, ay, bx, by) <
         -polygon.rounding() * (std::fabs(ax) + std::fabs(ay) + std::fabs(bx) + std::fabs(by));
}

bool meets_polygon(const LinkPolygon& g, const PolygonPoint& a, const PolygonPoint& b) {
  bool crosses = false;
  for_each_bit(a.link ^ b.link, [&](std::size_t j) {
    const std::size_t k = g.following(j);
    const float sj = cross_xy(b.x - a.x, b.y - a.y, g.x[j] - a.x, g.y[j] - a.y);
    const float sk = cross_xy(b.x - a.x, b.y - a.y, g.x[k] - a.x, g.y[k] - a.y);
    crosses = crosses || (sj > 0.0f && sk < 0.0f) || (sj < 0.0f && sk > 0.0f);
  });
  if (crosses) return true;
  // From one corner of the polygon to another.
  PolygonPoint middle{.x = 0.5f * (a.x + b.x), .y = 0.5f * (a.y + b.y)};
  classify(g, middle);
  return middle.inside;
}

float crossing_deviation(const LinkPolygon& g, const PolygonPoint& a, const PolygonPoint& b, float own) {
  float deviation = 0.0f;
  const Float3 from = position_of(a), d = position_of(b) - from;
  // from + t d = p + s u
  const auto cross_edge = [&](const Float3& p, const Float3& u) {
    const float full = cross_xy(d, u);
    const float t = cross_xy(p - from, u) / full, s = cross_xy(p - from, d) / full;
    if (s >= 0.0f && s <= 1.0f && t >= 0.0f && t <= 1.0f)
      deviation = std::max(deviation, std::fabs(from[2] + t * d[2] - p[2] - s * u[2]) + own);
  };
  for_each_bit((a.spokes ^ b.spokes) & g.inner_spokes, [&](std::size_t j) { cross_edge({}, g.corner(j)); });
  for_each_bit(a.link ^ b.link, [&](std::size_t j) { cross_edge(g.corner(j), g.edge(j)); });
  return deviation;
}

CornerDeviation corner_deviation(const LinkPolygon& g, const PolygonTriangle& p) {
  CornerDeviation out;
  const Float3 from = position_of(*p[0]), a = position_of(*p[1]) - from, b = position_of(*p[2]) - from;
  const float full = cross_xy(a, b), margin = -1e-5f * std::fabs(full);
  if (!(full > 0.0f)) return out;
  for (std::size_t j = 0; j < g.size; ++j) {
    const Float3 d = g.corner(j) - from;
    const float s = cross_xy(d, b), t = cross_xy(a, d);
    if (s < margin || t < margin || s + t > full - margin) continue;
    out.corners |= std::uint64_t{1} << j;
    out.deviation = std::max(out.deviation, std::fabs(from[2] + (s * a[2] + t * b[2]) / full - g.z[j]));
  }
  return out;
}

std::uint64_t overlapped_sectors(const LinkPolygon& g, const PolygonTriangle& p) {
  constexpr float kDrawnIn = 0.998f;
  const float cx = (p[0]->x + p[1]->x + p[2]->x) / 3.0f, cy = (p[0]->y + p[1]->y + p[2]->y) / 3.0f;
  PolygonPoint q[3];
  for (std::size_t i = 0; i < 3; ++i) {
    q[i].x = cx + kDrawnIn * (p[i]->x - cx), q[i].y = cy + kDrawnIn * (p[i]->y - cy);
    classify(g, q[i]);
  }
  std::uint64_t sectors = 0;
  for (std::size_t i = 0; i < 3; ++i) {
    sectors |= sector_bits(g, q[i]);
    const PolygonPoint &a = q[i], &b = q[i == 2 ? 0 : i + 1];
    for_each_bit((a.spokes ^ b.spokes) & g.inner_spokes, [&](std::size_t j) {
      const float dx = b.x - a.x, dy = b.y - a.y;
      const float s = cross_xy(-a.x, -a.y, dx, dy) / cross_xy(dx, dy, g.x[j], g.y[j]);
      if (s > 0.0f && s < 1.0f) sectors |= std::uint64_t{1} << j | std::uint64_t{1} << g.sector_before(j);
    });
  }
  return sectors & g.sectors;
}

float distance_beyond_lines(const LinkPolygon& g, std::uint64_t lines, const PolygonPoint& p) {
  float nearest = -1.0f;
  for_each_bit(lines & ~p.link, [&](std::size_t j) {
    const Float3 d = position_of(p) - g.corner(j), edge = g.edge(j);
    const float length2 = edge[0] * edge[0] + edge[1] * edge[1];
    const float t = (d[0] * edge[0] + d[1] * edge[1]) / length2;
    if (!(t >= 0.0f && t <= 1.0f)) return;
    const float across = cross_xy(edge, d), up = d[2] - t * edge[2];
    const float distance = std::sqrt(across * across / length2 + up * up);
    nearest = nearest >= 0.0f ? std::min(nearest, distance) : distance;
  });
  return nearest;
}

float distance_to_lines(const LinkPolygon& g, std::uint64_t lines, std::uint64_t ends, const PolygonPoint& p,
                        float far2) {
  float nearest2 = far2;
  for_each_bit(lines, [&](std::size_t j) {
    const Float3 d = position_of(p) - g.corner(j), edge = g.edge(j);
    const float length2 = edge[0] * edge[0] + edge[1] * edge[1];
    float t = (d[0] * edge[0] + d[1] * edge[1]) / length2;
    t = t > 0.0f ? (t < 1.0f ? t : 1.0f) : 0.0f;
    const Float3 off = d - edge * t;
    nearest2 = std::min(nearest2, dot(off, off));
  });
  for_each_bit(ends, [&](std::size_t j) {
    const Float3 off = position_of(p) - g.corner(j);
    nearest2 = std::min(nearest2, dot(off, off));
  });
  return std::sqrt(nearest2);
}

}  // namespace tessera
