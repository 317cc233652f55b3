/// \file made_meshes.h
/// Meshes for tests that want something like a scanned body or a part: made here, so that a clone needs nothing beside it.
#pragma once
#include <array>
#include <cmath>
#include <cstdint>
#include <map>
#include <set>
#include <vector>

#include "octree/portable_math.h"
#include "octree/vector.h"
#include "tests/helpers/icosphere.h"
#include "tests/helpers/mesh_files.h"

namespace tessera::test {

inline WholeMesh counted(WholeMesh mesh) {
  mesh.header.vertices = mesh.points.size();
  mesh.header.faces = mesh.faces.size();
  return mesh;
}

/// A closed body of about unit radius with two ears, folds between them and finer waves all over, its triangles uneven.
inline WholeMesh made_body(int level, std::uint64_t seed = 1) {
  const Icosphere sphere = icosphere(level);
  WholeMesh mesh;
  const auto wave = [](double x) { return sin_cos(x).sin; };
  const double step = 0.25 * std::pow(0.5, level);
  for (std::size_t v = 0; v < sphere.positions.size(); ++v) {
    Double3 d = sphere.positions[v];
    for (std::uint64_t k = 0; k < 3; ++k) d[k] += step * (to_unit(random_bits(seed, k, v)) - 0.5);
    d = d * (1.0 / norm(d));
    double r = 1.0 + 0.03 * wave(9.0 * d[0] + 2.0 * d[2]) * wave(7.0 * d[1]) +
               0.01 * wave(31.0 * d[2]) * wave(23.0 * d[0]);
    for (const double side : {-1.0, 1.0}) {
      const Double3 ear = Double3{0.5 * side, 0.1, 0.86} * (1.0 / norm(Double3{0.5, 0.1, 0.86}));
      const Double3 off = d - ear;
      r += 0.8 * std::exp(-12.0 * dot(off, off));
    }
    mesh.points.push_back(d * r);
  }
  for (const auto& f : sphere.faces) mesh.faces.push_back({f[0], f[1], f[2]});
  return counted(mesh);
}

/// The same without its foot: one border, and vertices that no face uses.
inline WholeMesh made_open_body(int level) {
  WholeMesh mesh = made_body(level);
  std::erase_if(mesh.faces, [&](const MeshFace& f) {
    double low = 1.0;
    for (const std::uint64_t v : f) low = std::min(low, mesh.points[v][2]);
    return low < -0.7;
  });
  return counted(mesh);
}

/// The surface of a set of cubes of side `side`, each named by its integer corner, every square n x n x 2 triangles: edges are
/// sharp, convex and concave. Coordinates are multiples of side / n. \pre cubes that touch share a side, not an edge alone
inline WholeMesh made_part(const std::set<std::array<int, 3>>& cubes, int n, double side = 1.0) {
  WholeMesh mesh;
  std::map<std::array<int, 3>, std::uint64_t> number;  // of lattice points, n a side
  const auto at = [&](const std::array<int, 3>& p) {
    const auto [found, fresh] = number.emplace(p, mesh.points.size());
    if (fresh) mesh.points.push_back({p[0] * side / n, p[1] * side / n, p[2] * side / n});
    return found->second;
  };
  for (const auto& cube : cubes)
    for (std::size_t axis = 0; axis < 3; ++axis)
      for (const int sign : {-1, 1}) {
        auto adjacent = cube;
        adjacent[axis] += sign;
        if (cubes.count(adjacent) != 0) continue;
        const std::size_t u = (axis + 1) % 3, v = (axis + 2) % 3;
        const auto corner = [&](int i, int j) {
          std::array<int, 3> p = {cube[0] * n, cube[1] * n, cube[2] * n};
          p[axis] += sign > 0 ? n : 0;
          p[u] += i, p[v] += j;
          return at(p);
        };
        for (int i = 0; i < n; ++i)
          for (int j = 0; j < n; ++j) {
            const std::uint64_t a = corner(i, j), b = corner(i + 1, j), c = corner(i + 1, j + 1),
                                d = corner(i, j + 1);
            if (sign > 0)
              mesh.faces.insert(mesh.faces.end(), {{a, b, c}, {a, c, d}});
            else
              mesh.faces.insert(mesh.faces.end(), {{a, c, b}, {a, d, c}});
          }
      }
  return counted(mesh);
}

/// A bracket of three cubes: 14 squares outside, 17 convex edges and a concave one.
inline WholeMesh made_bracket(int n, double side = 1.0) {
  return made_part({{0, 0, 0}, {1, 0, 0}, {0, 0, 1}}, n, side);
}

/// A cylinder as CAD programs write it: needles from end to end, and fans of needles for its ends.
inline WholeMesh made_cylinder(int sides, double radius, double height) {
  WholeMesh mesh;
  for (int k = 0; k < 2; ++k)
    for (int i = 0; i < sides; ++i) {
      const SinCos a = sin_cos(2.0 * kPi * i / sides);
      mesh.points.push_back({radius * a.cos, radius * a.sin, height * k});
    }
  const auto m = static_cast<std::uint64_t>(sides);
  for (std::uint64_t i = 0; i < m; ++i) {
    const std::uint64_t next = (i + 1) % m;
    mesh.faces.insert(mesh.faces.end(), {{i, next, m + next}, {i, m + next, m + i}});
  }
  for (std::uint64_t i = 1; i + 1 < m; ++i)
    mesh.faces.insert(mesh.faces.end(), {{0, i + 1, i}, {m, m + i, m + i + 1}});
  return counted(mesh);
}

/// Both in one file, the second moved.
inline WholeMesh joined(WholeMesh a, const WholeMesh& b, const Double3& move = {0, 0, 0}) {
  const std::uint64_t first = a.points.size();
  for (const Double3& p : b.points) a.points.push_back(p + move);
  for (const MeshFace& f : b.faces) a.faces.push_back({f[0] + first, f[1] + first, f[2] + first});
  return counted(a);
}

/// Every face with three vertices of its own.
inline WholeMesh torn(const WholeMesh& mesh) {
  WholeMesh out;
  for (const MeshFace& f : mesh.faces) {
    const std::uint64_t first = out.points.size();
    for (const std::uint64_t v : f) out.points.push_back(mesh.points[v]);
    out.faces.push_back({first, first + 1, first + 2});
  }
  return counted(out);
}

}  // namespace tessera::test
