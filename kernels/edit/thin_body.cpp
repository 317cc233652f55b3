#include "kernels/edit/thin_body.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include "octree/morton.h"

namespace tessera {
namespace {

/// Of the area: what normals sum up to at the most where both sides lie in a cell.
constexpr double kCancelled = 0.5;
constexpr double kMaxCells = 2097151.0;

struct Sample {
  std::uint64_t cell;
  Double3 normal;  ///< times the area
  double area;
};

}  // namespace

double thin_body_share(std::span<const Double3> position, std::span<const std::array<std::uint32_t, 3>> faces,
                       double width) {
  if (faces.empty()) return 0.0;
  Double3 low = position[faces[0][0]], high = low;
  for (const auto& f : faces)
    for (const std::uint32_t v : f)
      for (std::size_t c = 0; c < 3; ++c) {
        low[c] = std::min(low[c], position[v][c]);
        high[c] = std::max(high[c], position[v][c]);
      }
  double size = width;
  for (std::size_t c = 0; c < 3; ++c) size = std::max(size, (high[c] - low[c]) / kMaxCells);
  std::vector<Sample> samples;
  for (const auto& f : faces) {
    // Along the longest side, and up from it.
    std::size_t first = 0;
    double longest = -1.0;
    for (std::size_t k = 0; k < 3; ++k)
      if (const double d = squared_distance(position[f[k]], position[f[(k + 1) % 3]]); d > longest)
        longest = d, first = k;
    const Double3 &a = position[f[first]], &b = position[f[(first + 1) % 3]],
                  &c = position[f[(first + 2) % 3]];
    const Double3 normal = triangle_normal(a, b, c) * 0.5;
    const double area = norm(normal), length = std::sqrt(longest);
    if (!(area > 0.0)) continue;
    const double along = std::ceil(2.0 * length / size), up = std::ceil(4.0 * area / (length * size));
    for (double j = 0.5; j < up; j += 1.0)
      for (double i = 0.5; i < along; i += 1.0) {
        const double t = j / up, share = 2.0 * (1.0 - t) / (along * up);
        const Double3 p = (a + (b - a) * (i / along)) * (1.0 - t) + c * t;
        std::array<std::uint32_t, 3> cell{};
        for (std::size_t k = 0; k < 3; ++k) cell[k] = static_cast<std::uint32_t>((p[k] - low[k]) / size);
        samples.push_back({morton_encode(cell[0], cell[1], cell[2]), normal * share, area * share});
      }
  }
  std::stable_sort(samples.begin(), samples.end(),
                   [](const Sample& x, const Sample& y) { return x.cell < y.cell; });
  double all = 0.0, thin = 0.0;
  for (std::size_t i = 0; i < samples.size();) {
    Double3 sum = {0, 0, 0};
    double area = 0.0;
    const std::uint64_t cell = samples[i].cell;
    for (; i < samples.size() && samples[i].cell == cell; ++i) {
      sum = sum + samples[i].normal;
      area += samples[i].area;
    }
    all += area;
    if (dot(sum, sum) < kCancelled * kCancelled * area * area) thin += area;
  }
  return all > 0.0 ? thin / all : 0.0;
}

}  // namespace tessera
