#include "kernels/holes/hole_triangulation.h"

#include <algorithm>
#include <cmath>

#include "octree/vector.h"

namespace tessera {
namespace {

constexpr double kForbidden = 1e300;

/// Best triangulation of the polygon from vertex i to vertex j > i, closed by their chord.
struct Cell {
  double dihedral = 0.0;  ///< largest 1 - cosine between neighbouring faces, the chord left out
  double area = 0.0;
  Double3 normal{};  ///< of the face at the chord
  std::uint32_t apex = 0;
};

double dihedral_between(const Double3& a, const Double3& b) {
  return 1.0 - dot(a, b);
}

/// \param twice  the area
bool has_area(double twice, const Double3& ab, const Double3& ac, const Double3& bc) {
  constexpr double kMinHeight = 1e-4;  // twice the area over the square of the longest side
  return twice > kMinHeight * std::max({dot(ab, ab), dot(ac, ac), dot(bc, bc)});
}

}  // namespace

bool has_area(const Double3& a, const Double3& b, const Double3& c) {
  const Double3 ab = b - a, ac = c - a, bc = c - b;
  return has_area(norm(cross(ab, ac)), ab, ac, bc);
}

std::vector<Double3> boundary_normals(const HoleLoop& loop) {
  const std::size_t n = loop.position.size();
  std::vector<Double3> face(n), out(n);
  for (std::size_t i = 0; i < n; ++i) {
    const Double3& p = loop.position[i];
    face[i] = cross(p - loop.position[(i + 1) % n], loop.opposite[i] - loop.position[(i + 1) % n]);
  }
  constexpr std::size_t kHalfWidth = 2;
  for (std::size_t i = 0; i < n; ++i) {
    Double3 sum{};
    for (std::size_t k = 0; k <= 2 * kHalfWidth; ++k)
      sum = sum + face[(i + n * kHalfWidth + k - kHalfWidth) % n];
    out[i] = unit_or_zero(sum);
  }
  return out;
}

HoleTriangulation triangulate_hole(const HoleLoop& loop, const std::vector<Double3>& boundary_normal,
                                   TriangulationGoal goal) {
  const bool bends = goal == TriangulationGoal::kLeastArea;
  const std::size_t n = loop.position.size();
  const std::vector<Double3>& p = loop.position;
  // Cell (i, j) a second time as (j, i), so that what is compared lies side by side.
  std::vector<Cell> cells(n * n);
  const auto at = [&](std::size_t i, std::size_t j) -> Cell& { return cells[i * n + j]; };
  for (std::size_t i = 0; i + 1 < n; ++i) at(i, i + 1).normal = at(i + 1, i).normal = boundary_normal[i];
  for (std::size_t span = 2; span < n; ++span) {
    for (std::size_t i = 0; i + span < n; ++i) {
      const std::size_t j = i + span;
      Cell best;
      best.dihedral = best.area = kForbidden;
      const std::array<std::uint32_t, 2> chord = {static_cast<std::uint32_t>(i),
                                                  static_cast<std::uint32_t>(j)};
      const bool closing = span + 1 == n;
      const bool taken = !closing && std::binary_search(loop.taken.begin(), loop.taken.end(), chord);
      const Cell *const row = &cells[i * n], *const column = &cells[j * n];
      const Double3 side = p[j] - p[i];
      for (std::size_t k = i + 1; k < j && !taken; ++k) {
        const Cell &left = row[k], &right = column[k];
        double dihedral = std::max(left.dihedral, right.dihedral);
        if (dihedral > best.dihedral || dihedral == kForbidden) continue;
        // Neither gets smaller by the face.
        const double others = left.area + right.area;
        if (dihedral == best.dihedral && !(others < best.area)) continue;
        const Double3 first = p[k] - p[i];
        const Double3 normal2 = cross(first, side);
        const double twice = norm(normal2);
        if (!has_area(twice, first, side, p[j] - p[k])) continue;
        const Double3 normal = normal2 * (1.0 / twice);
        if (!bends)
          dihedral = std::max(
              {dihedral, dihedral_between(normal, left.normal), dihedral_between(normal, right.normal)});
        if (closing && !bends)
          dihedral = std::max(dihedral, dihedral_between(normal, boundary_normal[n - 1]));
        const double area = others + twice;
        if (dihedral < best.dihedral || (dihedral == best.dihedral && area < best.area))
          best = {dihedral, area, normal, static_cast<std::uint32_t>(k)};
      }
      at(i, j) = at(j, i) = best;
    }
  }
  HoleTriangulation out;
  if (at(0, n - 1).dihedral == kForbidden) return out;
  double length_sum = 0.0, cosine_sum = 0.0;
  const auto boundary = [&](std::size_t edge, const Double3& normal) {
    const Double3 along = p[(edge + 1) % n] - p[edge];
    const double length = std::sqrt(dot(along, along));
    length_sum += length;
    cosine_sum += length * dot(normal, boundary_normal[edge]);
  };
  std::vector<std::array<std::size_t, 2>> open = {{0, n - 1}};
  boundary(n - 1, at(0, n - 1).normal);
  while (!open.empty()) {
    const auto [i, j] = open.back();
    open.pop_back();
    const std::size_t k = at(i, j).apex;
    out.faces.push_back(
        {static_cast<std::uint32_t>(i), static_cast<std::uint32_t>(k), static_cast<std::uint32_t>(j)});
    for (const std::array<std::size_t, 2> side : {std::array<std::size_t, 2>{k, j}, {i, k}}) {
      if (side[1] - side[0] == 1)
        boundary(side[0], at(i, j).normal);
      else
        open.push_back(side);
    }
  }
  out.boundary_cosine = length_sum > 0.0 ? cosine_sum / length_sum : 1.0;
  return out;
}

}  // namespace tessera
