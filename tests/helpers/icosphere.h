/// \file icosphere.h
/// Unit sphere from a subdivided icosahedron: 10 * 4^level + 2 vertices, outward faces.
#pragma once
#include <array>
#include <cmath>
#include <cstdint>
#include <map>
#include <utility>
#include <vector>

#include "octree/vector.h"

namespace tessera::test {

struct Icosphere {
  std::vector<Double3> positions;
  std::vector<std::array<std::uint32_t, 3>> faces;
};

inline Icosphere icosphere(int level) {
  const double t = (1.0 + std::sqrt(5.0)) / 2.0;
  Icosphere s;
  s.positions = {{-1, t, 0},  {1, t, 0},  {-1, -t, 0}, {1, -t, 0}, {0, -1, t},  {0, 1, t},
                 {0, -1, -t}, {0, 1, -t}, {t, 0, -1},  {t, 0, 1},  {-t, 0, -1}, {-t, 0, 1}};
  s.faces = {{0, 11, 5},  {0, 5, 1},  {0, 1, 7},  {0, 7, 10}, {0, 10, 11}, {1, 5, 9}, {5, 11, 4},
             {11, 10, 2}, {10, 7, 6}, {7, 1, 8},  {3, 9, 4},  {3, 4, 2},   {3, 2, 6}, {3, 6, 8},
             {3, 8, 9},   {4, 9, 5},  {2, 4, 11}, {6, 2, 10}, {8, 6, 7},   {9, 8, 1}};
  const auto on_sphere = [](const Double3& p) {
    const double l = norm(p);
    return Double3{p[0] / l, p[1] / l, p[2] / l};
  };
  for (auto& p : s.positions) p = on_sphere(p);
  for (int k = 0; k < level; ++k) {
    std::map<std::pair<std::uint32_t, std::uint32_t>, std::uint32_t> middle;
    const auto between = [&](std::uint32_t a, std::uint32_t b) {
      const auto key = a < b ? std::make_pair(a, b) : std::make_pair(b, a);
      const auto [it, fresh] = middle.try_emplace(key, static_cast<std::uint32_t>(s.positions.size()));
      if (fresh) {
        const auto &p = s.positions[a], &q = s.positions[b];
        s.positions.push_back(on_sphere(p + q));
      }
      return it->second;
    };
    std::vector<std::array<std::uint32_t, 3>> finer;
    for (const auto& f : s.faces) {
      const std::uint32_t a = between(f[0], f[1]), b = between(f[1], f[2]), c = between(f[2], f[0]);
      finer.insert(finer.end(), {{f[0], a, c}, {f[1], b, a}, {f[2], c, b}, {a, b, c}});
    }
    s.faces = std::move(finer);
  }
  return s;
}

}  // namespace tessera::test
