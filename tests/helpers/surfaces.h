/// \file surfaces.h
/// Small surfaces for tests of distances: grids, spheres, soups.
#pragma once
#include <array>
#include <cmath>
#include <cstdint>
#include <map>
#include <span>
#include <utility>
#include <vector>

#include "octree/lattice.h"
#include "octree/vector.h"
#include "tests/helpers/random.h"

namespace tessera::test {

struct Surface {
  std::vector<Double3> position;
  std::vector<std::array<std::uint32_t, 3>> faces;
};

/// cells x cells squares over [0, size]^2, two triangles each, at height z(x, y).
template <class Height>
Surface height_grid(int cells, double size, const Height& z) {
  Surface s;
  for (int j = 0; j <= cells; ++j)
    for (int i = 0; i <= cells; ++i) {
      const double x = size * i / cells, y = size * j / cells;
      s.position.push_back({x, y, z(x, y)});
    }
  const auto at = [&](int i, int j) { return static_cast<std::uint32_t>(j * (cells + 1) + i); };
  for (int j = 0; j < cells; ++j)
    for (int i = 0; i < cells; ++i) {
      s.faces.push_back({at(i, j), at(i + 1, j), at(i + 1, j + 1)});
      s.faces.push_back({at(i, j), at(i + 1, j + 1), at(i, j + 1)});
    }
  return s;
}

/// An octahedron split `levels` times, vertices on the sphere.
inline Surface sphere(int levels, double radius) {
  Surface s;
  s.position = {{radius, 0, 0},  {-radius, 0, 0}, {0, radius, 0},
                {0, -radius, 0}, {0, 0, radius},  {0, 0, -radius}};
  for (const std::uint32_t x : {0u, 1u})
    for (const std::uint32_t y : {2u, 3u})
      for (const std::uint32_t z : {4u, 5u}) {
        if ((x + y + z) % 2 == 0)
          s.faces.push_back({x, y, z});
        else
          s.faces.push_back({x, z, y});
      }
  for (int level = 0; level < levels; ++level) {
    std::map<std::pair<std::uint32_t, std::uint32_t>, std::uint32_t> middle;
    const auto split = [&](std::uint32_t a, std::uint32_t b) {
      const auto [it, fresh] =
          middle.try_emplace({std::min(a, b), std::max(a, b)}, static_cast<std::uint32_t>(s.position.size()));
      if (fresh) {
        Double3 m{};
        double square = 0.0;
        for (std::size_t k = 0; k < 3; ++k) {
          m[k] = s.position[a][k] + s.position[b][k];
          square += m[k] * m[k];
        }
        for (double& c : m) c *= radius / std::sqrt(square);
        s.position.push_back(m);
      }
      return it->second;
    };
    std::vector<std::array<std::uint32_t, 3>> finer;
    for (const auto& [a, b, c] : s.faces) {
      const std::uint32_t ab = split(a, b), bc = split(b, c), ca = split(c, a);
      finer.insert(finer.end(), {{a, ab, ca}, {ab, b, bc}, {ca, bc, c}, {ab, bc, ca}});
    }
    s.faces = std::move(finer);
  }
  return s;
}

/// Triangles anywhere in [0, 1]^3, some of them thin, some degenerate.
inline Surface soup(std::size_t faces, double size, Random& random) {
  Surface s;
  for (std::size_t i = 0; i < faces; ++i) {
    const Double3 at = {random.unit(), random.unit(), random.unit()};
    for (int c = 0; c < 3; ++c) {
      const double extent = c == 1 && i % 5 == 0 ? 0.01 * size : size;
      s.position.push_back({at[0] + random.in(-extent, extent), at[1] + random.in(-extent, extent),
                            at[2] + random.in(-extent, extent)});
    }
    const auto v = static_cast<std::uint32_t>(3 * i);
    if (i % 31 == 7) s.position[v + 2] = s.position[v + 1];
    s.faces.push_back({v, v + 1, v + 2});
  }
  return s;
}

inline Double3 random_point(const Surface& s, std::size_t face, Random& random) {
  double a = random.unit(), b = random.unit();
  if (a + b > 1.0) a = 1.0 - a, b = 1.0 - b;
  const auto& f = s.faces[face];
  Double3 p;
  for (std::size_t k = 0; k < 3; ++k)
    p[k] = s.position[f[0]][k] * (1.0 - a - b) + s.position[f[1]][k] * a + s.position[f[2]][k] * b;
  return p;
}

/// Distance of a point to a triangle, the slow way: nearest of the plane's foot and the three sides.
inline double triangle_distance(const Double3& p, const Double3& a, const Double3& b, const Double3& c) {
  const auto segment = [&](const Double3& s, const Double3& e) {
    const Double3 d = e - s, q = p - s;
    const double dd = dot(d, d), t = dd > 0.0 ? std::min(1.0, std::max(0.0, dot(q, d) / dd)) : 0.0;
    return norm(q - d * t);
  };
  double best = std::min({segment(a, b), segment(b, c), segment(c, a)});
  const Double3 n = cross(b - a, c - a);
  const double nn = dot(n, n);
  if (nn > 0.0 && dot(cross(b - a, p - a), n) >= 0.0 && dot(cross(c - b, p - b), n) >= 0.0 &&
      dot(cross(a - c, p - c), n) >= 0.0)
    best = std::min(best, std::abs(dot(p - a, n)) / std::sqrt(nn));
  return best;
}

inline double surface_distance(const Double3& p, const Surface& s) {
  double best = 1e300;
  for (const auto& f : s.faces)
    best = std::min(best, triangle_distance(p, s.position[f[0]], s.position[f[1]], s.position[f[2]]));
  return best;
}

}  // namespace tessera::test
