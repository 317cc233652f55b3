#include "kernels/remesh/sizing_field.h"

#include <algorithm>
#include <cmath>
#include <queue>
#include <utility>

#include "octree/lists.h"
#include "octree/vector.h"

namespace tessera {
namespace {

constexpr int kNormalRounds = 2;

double length_for(double curvature, double tolerance, const SizingOptions& o) {
  const double square =
      curvature > 0.0 ? 6.0 * tolerance / curvature - 3.0 * tolerance * tolerance : o.longest * o.longest;
  return std::clamp(std::sqrt(std::max(square, 0.0)), o.shortest, o.longest);
}

/// What the bend of the surface and of its lines allows.
void bound_by_curvature(const MeshBlock& reference, std::span<const std::uint8_t> on_line,
                        std::span<const std::array<std::uint32_t, 3>> lines,
                        const Lists<std::uint32_t>& around, const SizingOptions& options,
                        std::vector<float>& length) {
  const std::size_t n = reference.position.size();
  const auto& at = reference.position;
  std::vector<Double3> normal(n, Double3{});
  for (const auto& f : reference.faces) {
    const Double3 face = triangle_normal(at[f[0]], at[f[1]], at[f[2]]);
    for (const std::uint32_t v : f)
      if (!on_line[v]) normal[v] = normal[v] + face;
  }
  for (Double3& v : normal) v = unit_or_zero(v);
  for (int round = 0; round < kNormalRounds; ++round) {
    std::vector<Double3> next(n, Double3{});
    for (std::size_t v = 0; v < n; ++v) {
      if (on_line[v]) continue;
      Double3 sum = normal[v] * 2.0;
      for (const std::uint32_t w : around[v]) sum = sum + normal[w];
      next[v] = unit_or_zero(sum);
    }
    normal.swap(next);
  }
  for (std::size_t v = 0; v < n; ++v) {
    if (on_line[v]) continue;
    double maximum = 0.0;
    for (const std::uint32_t w : around[v]) {
      const double distance = norm(at[w] - at[v]);
      if (!on_line[w] && distance > 0.0) maximum = std::max(maximum, norm(normal[w] - normal[v]) / distance);
    }
    length[v] = static_cast<float>(length_for(maximum, options.tolerance, options));
  }
  for (const auto& [a, v, b] : lines) {
    const Double3 in = at[v] - at[a], out = at[b] - at[v];
    const double distance = 0.5 * (norm(in) + norm(out));
    if (distance > 0.0)
      length[v] = std::min(
          length[v], static_cast<float>(length_for(norm(unit_or_zero(out) - unit_or_zero(in)) / distance,
                                                   0.5 * options.tolerance, options)));
  }
}

}  // namespace

std::vector<float> sizing_field(const MeshBlock& reference, std::span<const std::uint8_t> on_line,
                                std::span<const std::array<std::uint32_t, 3>> lines,
                                std::span<const float> at_lines, const SizingOptions& options) {
  const std::size_t n = reference.position.size();
  std::vector<float> length(n, static_cast<float>(options.longest));
  if (!(options.tolerance > 0.0) && at_lines.empty()) return length;
  const auto& at = reference.position;
  // Inner edges come twice, which costs time only.
  const Lists<std::uint32_t> around = make_lists<std::uint32_t>(n, [&](const auto& put) {
    for (const auto& f : reference.faces)
      for (std::size_t k = 0; k < 3; ++k) {
        put(f[k], f[(k + 1) % 3]);
        put(f[(k + 1) % 3], f[k]);
      }
  });
  if (options.tolerance > 0.0) bound_by_curvature(reference, on_line, lines, around, options, length);
  for (std::size_t v = 0; v < at_lines.size(); ++v) length[v] = std::min(length[v], at_lines[v]);
  const double growth = options.tolerance > 0.0 ? kSizingGrowth : kLineGrowth;
  using Entry = std::pair<float, std::uint32_t>;
  std::priority_queue<Entry, std::vector<Entry>, std::greater<>> queue;
  for (std::uint32_t v = 0; v < n; ++v)
    if (length[v] < static_cast<float>(options.longest)) queue.emplace(length[v], v);
  while (!queue.empty()) {
    const auto [here, v] = queue.top();
    queue.pop();
    if (here > length[v]) continue;
    for (const std::uint32_t w : around[v]) {
      const float there = here + static_cast<float>(growth * norm(at[w] - at[v]));
      if (there >= length[w]) continue;
      length[w] = there;
      queue.emplace(there, w);
    }
  }
  return length;
}

}  // namespace tessera
