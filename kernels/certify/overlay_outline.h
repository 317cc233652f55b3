/// \file overlay_outline.h
/// What an overlay proof (overlay_proof.h) is made of: how the edges of a surface cancel, and a convex outline
/// in the plane of a face.
#pragma once
#include <algorithm>
#include <array>
#include <cstdint>
#include <vector>

#include "kernels/certify/certificate.h"
#include "octree/vector.h"

namespace tessera {

inline constexpr std::uint32_t kNoPair = 0xffffffffu;
using Across = std::array<std::uint32_t, 3>;

/// Per face and edge (corner i to the next) the edge 4 f + i that it is paired with, in the opposite
/// direction. Where more than two faces meet any pairing will do: it only says which edges cancel in the
/// boundary of a chain.
[[nodiscard]] inline std::vector<Across> pair_edges(const SurfaceFaces& s) {
  const std::size_t m = s.faces.size();
  std::vector<Across> across(m, {kNoPair, kNoPair, kNoPair});
  std::vector<std::uint32_t> head(s.position.size(), kNoPair);
  std::vector<Across> next(m);
  for (std::uint32_t f = 0; f < m; ++f)
    for (std::uint32_t i = 0; i < 3; ++i) {
      const std::uint32_t a = s.faces[f][i], b = s.faces[f][i == 2 ? 0 : i + 1];
      const std::uint32_t low = std::min(a, b);
      std::uint32_t* link = &head[low];
      while (*link != kNoPair) {
        const std::uint32_t g = *link >> 2, j = *link & 3u;
        if (s.faces[g][j] == b && s.faces[g][j == 2 ? 0 : j + 1] == a) break;
        link = &next[g][j];
      }
      if (*link == kNoPair) {
        next[f][i] = head[low];
        head[low] = 4 * f + i;
        continue;
      }
      const std::uint32_t other = *link;
      *link = next[other >> 2][other & 3u];
      across[f][i] = other;
      across[other >> 2][other & 3u] = 4 * f + i;
    }
  return across;
}

struct Flat {
  double x, y;
};
/// Twice the area of a, b, c.
[[nodiscard]] inline double orient2d(const Flat& a, const Flat& b, const Flat& c) {
  return (b.x - a.x) * (c.y - a.y) - (b.y - a.y) * (c.x - a.x);
}

inline constexpr int kMaxSides = 12;
inline constexpr unsigned kCutSide = 3;  ///< tag of a side that is no edge of the face

/// A convex polygon in the plane of a coarse face, counter-clockwise; side i runs from corner i to the next.
struct Outline {
  int corners = 0;
  std::array<Flat, kMaxSides> at;
  std::array<unsigned, kMaxSides> tag;  ///< which edge of the coarse face, or kCutSide

  /// Keeps where value >= 0.
  template <class Value>
  void clip(const Value& value) {
    Outline out;
    for (int i = 0; i < corners; ++i) {
      const int j = i + 1 == corners ? 0 : i + 1;
      const double p = value(at[i]), q = value(at[j]);
      if (p >= 0.0) out.add(at[i], q >= 0.0 || p > 0.0 ? tag[i] : kCutSide);
      if ((p > 0.0 && q < 0.0) || (p < 0.0 && q > 0.0)) {
        const double t = p / (p - q);
        out.add({at[i].x + t * (at[j].x - at[i].x), at[i].y + t * (at[j].y - at[i].y)},
                p < 0.0 ? tag[i] : kCutSide);
      }
    }
    *this = out;
  }
  void add(const Flat& p, unsigned side) {
    if (corners == kMaxSides) return;
    at[corners] = p;
    tag[corners++] = side;
  }
  double area() const {
    double sum = 0.0;
    for (int i = 1; i + 1 < corners; ++i) sum += orient2d(at[0], at[i], at[i + 1]);
    return 0.5 * sum;
  }
};

/// Of the part of a face that lies in a box. \param p  its corners, relative to the origin
[[nodiscard]] inline double area_in_box(const Double3* p, const Box3& box, const Double3& origin) {
  std::array<Double3, 9> polygon = {p[0], p[1], p[2]}, clipped;
  std::size_t corners = 3;
  for (std::size_t k = 0; k < 3; ++k)
    for (const double sign : {1.0, -1.0}) {
      const double limit = sign > 0.0 ? box.high[k] - origin[k] : origin[k] - box.low[k];
      std::size_t count = 0;
      for (std::size_t i = 0; i < corners; ++i) {
        const Double3 &a = polygon[i], &b = polygon[i + 1 == corners ? 0 : i + 1];
        const double u = limit - sign * a[k], v = limit - sign * b[k];
        if (u >= 0.0) clipped[count++] = a;
        if ((u > 0.0 && v < 0.0) || (u < 0.0 && v > 0.0)) clipped[count++] = a + (b - a) * (u / (u - v));
      }
      corners = count;
      std::swap(polygon, clipped);
    }
  Double3 sum{};
  for (std::size_t i = 1; i + 1 < corners; ++i)
    sum = sum + cross(polygon[i] - polygon[0], polygon[i + 1] - polygon[0]);
  return 0.5 * norm(sum);
}

}  // namespace tessera
