#include "kernels/texture/chart_overlap.h"

#include <algorithm>
#include <cmath>

namespace tessera {
namespace {

using PlaneTriangle = std::array<Double2, 3>;

constexpr std::size_t kMaxOverlapCells = 1024;  ///< along an axis
constexpr std::uint32_t kNoEntry = 0xffffffffu;

double twice_plane_area(const PlaneTriangle& t) {
  return (t[1][0] - t[0][0]) * (t[2][1] - t[0][1]) - (t[2][0] - t[0][0]) * (t[1][1] - t[0][1]);
}

/// Whether the direction across an edge of `a` separates the triangles.
bool separated_by_edge(const PlaneTriangle& a, const PlaneTriangle& b, double tolerance) {
  for (std::size_t k = 0; k < 3; ++k) {
    const Double2 &p = a[k], &q = a[(k + 1) % 3];
    const double nx = q[1] - p[1], ny = p[0] - q[0], length = std::sqrt(nx * nx + ny * ny);
    if (!(length > 0.0)) continue;
    const auto along = [&](const Double2& x) { return ((x[0] - p[0]) * nx + (x[1] - p[1]) * ny) / length; };
    double a_low = 0.0, a_high = 0.0, b_low = along(b[0]), b_high = b_low;
    for (std::size_t i = 0; i < 3; ++i) {
      a_low = std::min(a_low, along(a[i])), a_high = std::max(a_high, along(a[i]));
      b_low = std::min(b_low, along(b[i])), b_high = std::max(b_high, along(b[i]));
    }
    if (a_high - b_low <= tolerance || b_high - a_low <= tolerance) return true;
  }
  return false;
}

}  // namespace

bool triangles_overlap(const PlaneTriangle& a, const PlaneTriangle& b, double tolerance) {
  if (twice_plane_area(a) == 0.0 || twice_plane_area(b) == 0.0) return false;
  return !separated_by_edge(a, b, tolerance) && !separated_by_edge(b, a, tolerance);
}

std::vector<std::uint32_t> overlapping_faces(std::span<const Double2> uv,
                                             std::span<const std::array<std::uint32_t, 3>> faces,
                                             double rounding) {
  std::vector<std::uint32_t> out;
  if (faces.size() < 2) return out;
  Double2 low = uv[faces[0][0]], high = low;
  for (const auto& f : faces)
    for (const std::uint32_t v : f)
      for (std::size_t a = 0; a < 2; ++a)
        low[a] = std::min(low[a], uv[v][a]), high[a] = std::max(high[a], uv[v][a]);
  const double extent = std::max(high[0] - low[0], high[1] - low[1]);
  if (!(extent > 0.0)) return out;
  const std::size_t cells = std::clamp<std::size_t>(
      static_cast<std::size_t>(std::sqrt(static_cast<double>(faces.size()))), 1, kMaxOverlapCells);
  const double per_cell = static_cast<double>(cells) / extent * (1.0 - 1e-12);
  struct Entry {
    std::uint32_t face, next;
  };
  std::vector<std::uint32_t> head(cells * cells, kNoEntry), seen(faces.size(), kNoEntry);
  std::vector<Entry> entries;
  const auto corners = [&](std::uint32_t f) {
    return PlaneTriangle{uv[faces[f][0]], uv[faces[f][1]], uv[faces[f][2]]};
  };
  const auto cell = [&](double x, std::size_t a) {
    return std::min(cells - 1, static_cast<std::size_t>((x - low[a]) * per_cell));
  };
  for (std::uint32_t f = 0; f < faces.size(); ++f) {
    const PlaneTriangle t = corners(f);
    if (twice_plane_area(t) == 0.0) continue;
    std::array<std::size_t, 2> from{}, to{};
    for (std::size_t a = 0; a < 2; ++a) {
      from[a] = cell(std::min({t[0][a], t[1][a], t[2][a]}), a);
      to[a] = cell(std::max({t[0][a], t[1][a], t[2][a]}), a);
    }
    bool over = false;
    for (std::size_t y = from[1]; y <= to[1] && !over; ++y)
      for (std::size_t x = from[0]; x <= to[0] && !over; ++x)
        for (std::uint32_t e = head[y * cells + x]; e != kNoEntry && !over; e = entries[e].next) {
          const std::uint32_t other = entries[e].face;
          if (seen[other] == f) continue;
          seen[other] = f;
          over = triangles_overlap(t, corners(other), rounding * extent);
        }
    if (over) {
      out.push_back(f);
      continue;
    }
    for (std::size_t y = from[1]; y <= to[1]; ++y)
      for (std::size_t x = from[0]; x <= to[0]; ++x) {
        entries.push_back({f, head[y * cells + x]});
        head[y * cells + x] = static_cast<std::uint32_t>(entries.size() - 1);
      }
  }
  return out;
}

}  // namespace tessera
