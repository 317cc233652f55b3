#include "kernels/texture/point_means.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <vector>

#include "kernels/texture/point_colours.h"
#include "octree/portable_math.h"

namespace tessera {
namespace {

constexpr double kWideEdge = 2.0;  ///< in spacings
/// R2: reciprocals of the plastic number and of its square.
constexpr double kFirstStep = 0.7548776662466927, kSecondStep = 0.5698402909980532;

/// 0 where unknown; else one more than twice the axis that it is nearest to, and one more where it looks down it.
std::uint32_t side_of(const Double3& n) {
  if (n == Double3{}) return 0;
  std::size_t axis = 0;
  for (std::size_t a = 1; a < 3; ++a)
    if (std::fabs(n[a]) > std::fabs(n[axis])) axis = a;
  return static_cast<std::uint32_t>(1 + 2 * axis + (n[axis] < 0.0 ? 1 : 0));
}

double fraction(double x) {
  return x - std::floor(x);
}

}  // namespace

void mean_points(std::span<const Float3> position, std::span<const std::uint32_t> rgba,
                 std::span<const std::uint32_t> normal, double edge, const ColouredPointSink& sink) {
  struct Member {
    std::array<std::int32_t, 3> cube;
    std::uint32_t side, point;
    auto operator<=>(const Member&) const = default;
  };
  std::vector<Member> members(position.size());
  for (std::uint32_t i = 0; i < members.size(); ++i) {
    for (std::size_t a = 0; a < 3; ++a)
      members[i].cube[a] = static_cast<std::int32_t>(std::floor(static_cast<double>(position[i][a]) / edge));
    members[i].side = normal.empty() ? 0 : side_of(unpack_normal(normal[i]));
    members[i].point = i;
  }
  std::sort(members.begin(), members.end());
  for (std::size_t first = 0; first < members.size();) {
    Double3 at{}, looks{};
    std::array<std::uint64_t, 3> colour{};
    std::size_t end = first;
    for (; end < members.size() && members[end].cube == members[first].cube &&
           members[end].side == members[first].side;
         ++end) {
      const std::uint32_t p = members[end].point;
      at = at + wide(position[p]);
      if (!normal.empty()) looks = looks + unpack_normal(normal[p]);
      for (std::size_t c = 0; c < 3; ++c) colour[c] += rgba[p] >> (8 * c) & 255u;
    }
    const std::uint64_t count = end - first;
    std::uint32_t mean = 0;
    for (std::size_t c = 0; c < 3; ++c)
      mean |= static_cast<std::uint32_t>((colour[c] + count / 2) / count) << (8 * c);
    sink(at / static_cast<double>(count), mean, unit_or_zero(looks));
    first = end;
  }
}

void sample_wide_faces(const MeshBlock& block, double spacing, const ColouredPointSink& sink) {
  const double longest = kWideEdge * spacing;
  for (const auto& f : block.faces) {
    const Double3 &a = block.position[f[0]], &b = block.position[f[1]], &c = block.position[f[2]];
    if (squared_distance(a, b) <= longest * longest && squared_distance(b, c) <= longest * longest &&
        squared_distance(c, a) <= longest * longest)
      continue;
    const std::uint64_t seed = mix(block.key[f[0]] ^ mix(block.key[f[1]] ^ mix(block.key[f[2]])));
    const double share = to_unit(seed), u0 = to_unit(mix(seed)), v0 = to_unit(mix(mix(seed)));
    const Double3 n = triangle_normal(a, b, c);
    const double wanted = 0.5 * norm(n) / (spacing * spacing) + share;
    const Double3 unit = unit_or_zero(n);
    for (double i = 1.0; i <= wanted; i += 1.0) {
      double u = fraction(u0 + i * kFirstStep), v = fraction(v0 + i * kSecondStep);
      if (u + v > 1.0) u = 1.0 - u, v = 1.0 - v;
      const Double3 weights = {1.0 - u - v, u, v};
      std::uint32_t rgba = 0;
      for (std::size_t k = 0; k < 3; ++k) {
        double sum = 0.0;
        for (std::size_t j = 0; j < 3; ++j) sum += weights[j] * (block.rgba[f[j]] >> (8 * k) & 255u);
        rgba |= static_cast<std::uint32_t>(std::floor(std::clamp(sum, 0.0, 255.0) + 0.5)) << (8 * k);
      }
      sink(a * weights[0] + b * weights[1] + c * weights[2], rgba, unit);
    }
  }
}

}  // namespace tessera
