#include "kernels/decimate/mean_colours.h"

#include <array>
#include <cmath>

#include "kernels/mesh/closest_face.h"
#include "kernels/mesh/triangle_foot.h"
#include "octree/vector.h"

namespace tessera {
namespace {

struct ColourSum {
  std::array<double, 3> sum{};
  double weight = 0.0;

  void add(const std::array<double, 3>& colour, double w) {
    for (std::size_t c = 0; c < 3; ++c) sum[c] += w * colour[c];
    weight += w;
  }
};

/// Barycentric coordinates of a point of the triangle; of its corners alone where it has no area.
std::array<double, 3> shares_at(const Double3& p, const std::array<Double3, 3>& corner) {
  std::array<double, 3> share{};
  double sum = 0.0;
  for (std::size_t k = 0; k < 3; ++k) {
    share[k] = norm(cross(corner[(k + 1) % 3] - p, corner[(k + 2) % 3] - p));
    sum += share[k];
  }
  for (double& s : share) s = sum > 0.0 ? s / sum : 1.0 / 3.0;
  return share;
}

}  // namespace

std::vector<std::uint32_t> mean_colours(const MeshBlock& coarse, const MeshBlock& fine, double radius) {
  std::vector<std::uint32_t> out = coarse.rgba;
  if (coarse.faces.empty() || fine.faces.empty()) return out;
  const Double3 origin = coarse.position.front();
  const ClosestFaces closest(coarse.position, coarse.faces, origin);
  std::vector<ColourSum> sums(coarse.position.size());
  std::uint32_t hint = ClosestFaces::kNone;
  for (const auto& f : fine.faces) {
    std::array<double, 3> colour{};
    double coloured = 0.0;
    for (const std::uint32_t v : f) {
      if (fine.rgba[v] >> 24 == 0) continue;
      for (std::size_t c = 0; c < 3; ++c) colour[c] += static_cast<double>(fine.rgba[v] >> 8 * c & 0xffu);
      coloured += 1.0;
    }
    if (coloured == 0.0) continue;
    for (double& c : colour) c /= coloured;
    const Double3 a = fine.position[f[0]], b = fine.position[f[1]], c = fine.position[f[2]];
    const double area = norm(cross(b - a, c - a));
    const Double3 centroid = (a + b + c) * (1.0 / 3.0) - origin;
    const ClosestFaces::Hit hit = closest.closest(centroid, radius * radius, hint);
    if (hit.slot == ClosestFaces::kNone) continue;
    hint = hit.slot;
    const auto& target = coarse.faces[closest.face(hit.slot)];
    std::array<Double3, 3> corner;
    for (std::size_t k = 0; k < 3; ++k) corner[k] = coarse.position[target[k]] - origin;
    const Double3 foot = foot_in_triangle(centroid, corner[0], corner[1], corner[2]).at;
    const std::array<double, 3> share = shares_at(foot, corner);
    for (std::size_t k = 0; k < 3; ++k) sums[target[k]].add(colour, area * share[k]);
  }
  for (std::size_t v = 0; v < out.size(); ++v) {
    if (!(sums[v].weight > 0.0)) continue;
    out[v] = 0xff000000u;
    for (std::size_t c = 0; c < 3; ++c)
      out[v] |= static_cast<std::uint32_t>(sums[v].sum[c] / sums[v].weight + 0.5) << 8 * c;
  }
  return out;
}

}  // namespace tessera
