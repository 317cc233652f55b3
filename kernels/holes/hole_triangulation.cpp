#include "kernels/holes/hole_triangulation.h"

#include <algorithm>
#include <bit>
#include <cmath>

#include "octree/lanes.h"
#include "octree/vector.h"

namespace tessera {
namespace {

constexpr double kForbidden = 1e300;

/// Best triangulations of the polygons from vertex i to vertex j > i, closed by their chord. Entry (i, j) a second time as
/// (j, i), so that what is compared lies side by side; rows end in places that lanes may read.
class Table {
 public:
  explicit Table(std::size_t n)
      : n_(n),
        worst_(n * n + kDoubleLanes),
        area_(worst_.size()),
        normal_{worst_, worst_, worst_},
        apex_(n * n) {}

  /// Largest 1 - cosine between neighbouring faces, the chord left out.
  const double* worst(std::size_t i) const { return &worst_[i * n_]; }
  const double* area(std::size_t i) const { return &area_[i * n_]; }
  /// Of the face at the chord.
  const double* normal(std::size_t i, std::size_t axis) const { return &normal_[axis][i * n_]; }
  Double3 normal_at(std::size_t i, std::size_t j) const {
    return {normal(i, 0)[j], normal(i, 1)[j], normal(i, 2)[j]};
  }
  Double4x3 normals(std::size_t i, std::size_t k) const {
    return {load4(normal(i, 0) + k), load4(normal(i, 1) + k), load4(normal(i, 2) + k)};
  }
  std::uint32_t apex(std::size_t i, std::size_t j) const { return apex_[i * n_ + j]; }

  void set(std::size_t i, std::size_t j, double worst, double area, const Double3& normal,
           std::uint32_t apex) {
    for (const std::size_t at : {i * n_ + j, j * n_ + i}) {
      worst_[at] = worst, area_[at] = area, apex_[at] = apex;
      for (std::size_t a = 0; a < 3; ++a) normal_[a][at] = normal[a];
    }
  }

 private:
  std::size_t n_;
  std::vector<double> worst_, area_;
  std::array<std::vector<double>, 3> normal_;
  std::vector<std::uint32_t> apex_;
};

Double4 larger(Double4 a, Double4 b) {
  return a < b ? b : a;
}

Double4x3 splat(const Double3& v) {
  return {Double4{} + v[0], Double4{} + v[1], Double4{} + v[2]};
}

constexpr double kMinHeight = 1e-4;  ///< twice the area over the square of the longest side

/// \param twice  the area
bool has_area(double twice, const Double3& ab, const Double3& ac, const Double3& bc) {
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
  Table table(n);
  std::array<std::vector<double>, 3> place;  // p, an axis each
  for (std::size_t a = 0; a < 3; ++a) {
    place[a].resize(n + kDoubleLanes);
    for (std::size_t i = 0; i < n; ++i) place[a][i] = p[i][a];
  }
  for (std::size_t i = 0; i + 1 < n; ++i) table.set(i, i + 1, 0.0, 0.0, boundary_normal[i], 0);
  for (std::size_t span = 2; span < n; ++span) {
    const bool closing = span + 1 == n;
    for (std::size_t i = 0; i + span < n; ++i) {
      const std::size_t j = i + span;
      const std::array<std::uint32_t, 2> chord = {static_cast<std::uint32_t>(i),
                                                  static_cast<std::uint32_t>(j)};
      double best = kForbidden, best_area = kForbidden;
      Double3 best_normal{};
      std::uint32_t apex = 0;
      const bool taken = !closing && std::binary_search(loop.taken.begin(), loop.taken.end(), chord);
      const Double4x3 from = splat(p[i]), to = splat(p[j]), side = splat(p[j] - p[i]);
      const Double4 side2 = dot(side, side);
      for (std::size_t k = i + 1; k < j && !taken; k += kDoubleLanes) {
        const unsigned there = j - k < kDoubleLanes ? (1u << (j - k)) - 1 : 0xfu;
        // Neither gets smaller by the face.
        Double4 worst = larger(load4(table.worst(i) + k), load4(table.worst(j) + k));
        const Double4 others = load4(table.area(i) + k) + load4(table.area(j) + k);
        const unsigned hopeful =
            bits_of(worst < best) | (bits_of(worst == best) & bits_of(others < best_area));
        if ((hopeful & there) == 0) continue;
        const Double4x3 at = {load4(&place[0][k]), load4(&place[1][k]), load4(&place[2][k])};
        const Double4x3 first = at - from, second = to - at;
        const Double4x3 normal2 = cross(first, side);
        const Double4 twice = square_root(dot(normal2, normal2));
        const unsigned proper =
            bits_of(twice > kMinHeight * larger(larger(dot(first, first), side2), dot(second, second)));
        const Double4x3 normal = normal2 * (1.0 / twice);
        if (!bends)
          worst = larger(
              worst, larger(1.0 - dot(normal, table.normals(i, k)), 1.0 - dot(normal, table.normals(j, k))));
        if (closing && !bends) worst = larger(worst, 1.0 - dot(normal, splat(boundary_normal[n - 1])));
        const Double4 area = others + twice;
        unsigned better = hopeful & proper & there &
                          (bits_of(worst < best) | (bits_of(worst == best) & bits_of(area < best_area)));
        for (; better != 0; better &= better - 1) {
          const auto l = static_cast<std::size_t>(std::countr_zero(better));
          if (!(worst[l] < best || (worst[l] == best && area[l] < best_area))) continue;
          best = worst[l], best_area = area[l];
          best_normal = {normal[0][l], normal[1][l], normal[2][l]};
          apex = static_cast<std::uint32_t>(k + l);
        }
      }
      table.set(i, j, best, best_area, best_normal, apex);
    }
  }
  HoleTriangulation out;
  if (table.worst(0)[n - 1] == kForbidden) return out;
  double length_sum = 0.0, cosine_sum = 0.0;
  const auto boundary = [&](std::size_t edge, const Double3& normal) {
    const Double3 along = p[(edge + 1) % n] - p[edge];
    const double length = std::sqrt(dot(along, along));
    length_sum += length;
    cosine_sum += length * dot(normal, boundary_normal[edge]);
  };
  std::vector<std::array<std::size_t, 2>> open = {{0, n - 1}};
  boundary(n - 1, table.normal_at(0, n - 1));
  while (!open.empty()) {
    const auto [i, j] = open.back();
    open.pop_back();
    const std::size_t k = table.apex(i, j);
    out.faces.push_back(
        {static_cast<std::uint32_t>(i), static_cast<std::uint32_t>(k), static_cast<std::uint32_t>(j)});
    for (const std::array<std::size_t, 2> side : {std::array<std::size_t, 2>{k, j}, {i, k}}) {
      if (side[1] - side[0] == 1)
        boundary(side[0], table.normal_at(i, j));
      else
        open.push_back(side);
    }
  }
  out.boundary_cosine = length_sum > 0.0 ? cosine_sum / length_sum : 1.0;
  return out;
}

}  // namespace tessera
