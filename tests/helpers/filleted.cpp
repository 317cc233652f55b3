#include "tests/helpers/filleted.h"

#include <algorithm>
#include <cmath>

#include "octree/portable_math.h"
#include "tests/helpers/block_meshes.h"

namespace tessera::test {
namespace {

/// Point, and outward normal, of the profile at an arc length from its middle: x to the right, y up.
struct ProfilePoint {
  double x, y, nx, ny;
};
ProfilePoint profile_at(const Swept& s, double u) {
  const double arc_angle = s.arc_deg * kPi / 180.0, half = 0.5 * arc_angle * s.radius;
  const double sign = s.convex ? 1.0 : -1.0;
  const double inside = std::clamp(u, -half, half);
  const double angle = s.radius > 0.0 ? inside / s.radius : u < 0.0 ? -0.5 * arc_angle : 0.5 * arc_angle;
  const SinCos a = sin_cos(angle);
  const double beyond = u - inside;
  return {s.radius * a.sin + beyond * a.cos, sign * (s.radius * (a.cos - 1.0) - beyond * a.sin), sign * a.sin,
          a.cos};
}

double random_in(std::uint64_t seed, std::uint64_t stream, std::uint64_t index) {
  return 2.0 * to_unit(random_bits(seed, stream, index)) - 1.0;
}

}  // namespace

MeshBlock swept_block(const Swept& s) {
  const double arc_angle = s.arc_deg * kPi / 180.0;
  const double wide = arc_angle * s.radius + 2.0 * s.flank;
  const double length = s.closed ? 2.0 * kPi * s.sweep_radius : s.length;
  const int columns = 2 * static_cast<int>(0.5 * wide / s.edge), rows = static_cast<int>(length / s.edge);
  std::vector<Double3> position;
  for (int j = 0; j <= rows - (s.closed ? 1 : 0); ++j)
    for (int i = 0; i <= columns; ++i) {
      const auto index = static_cast<std::uint64_t>(j * (columns + 1) + i);
      // A sharp edge keeps its vertices, and borders theirs.
      const bool line = i == 0 || i == columns || (!s.closed && (j == 0 || j == rows)) ||
                        (!(s.radius > 0.0) && 2 * i == columns);
      const double move = line ? 0.0 : s.jitter;
      const double u = (i + move * random_in(s.seed, 0, index)) * wide / columns - 0.5 * wide;
      const double v = (j + move * random_in(s.seed, 1, index)) * length / rows;
      const ProfilePoint p = profile_at(s, u);
      const double off =
          s.noise > 0.0 ? s.noise * gaussian(random_bits(s.seed, 2, index), random_bits(s.seed, 3, index))
                        : 0.0;
      const double x = p.x + off * p.nx, z = p.y + off * p.ny;
      if (s.sweep_radius > 0.0) {
        const SinCos a = sin_cos(v / s.sweep_radius);
        // x grows inwards, so that x, z and the way along are right-handed as they are on the straight one.
        position.push_back({(s.sweep_radius - x) * a.cos, (s.sweep_radius - x) * a.sin, z});
      } else {
        position.push_back({x, v, z});
      }
    }
  std::vector<std::array<std::uint32_t, 3>> faces;
  const auto at = [&](int i, int j) {
    return static_cast<std::uint32_t>((s.closed ? j % rows : j) * (columns + 1) + i);
  };
  for (int j = 0; j < rows; ++j)
    for (int i = 0; i < columns; ++i) {
      const auto cell = static_cast<std::uint64_t>(j * columns + i);
      if (random_bits(s.seed, 4, cell) & 1) {
        faces.push_back({at(i, j), at(i + 1, j), at(i + 1, j + 1)});
        faces.push_back({at(i, j), at(i + 1, j + 1), at(i, j + 1)});
      } else {
        faces.push_back({at(i, j), at(i + 1, j), at(i, j + 1)});
        faces.push_back({at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)});
      }
    }
  if (s.sweep_radius > 0.0)
    for (auto& f : faces) std::swap(f[1], f[2]);
  return make_block(position, faces);
}

double off_arc(const Swept& s, const Double3& p) {
  const double sign = s.convex ? 1.0 : -1.0;
  const double x = p[0], z = p[2] + sign * s.radius;
  return sign * (std::sqrt(x * x + z * z) - s.radius);
}

MeshBlock filleted_box(double half, double radius, int n, double jitter, double noise, std::uint64_t seed) {
  MeshBlock block = cube_block(n);
  for (std::size_t v = 0; v < block.position.size(); ++v) {
    Double3& p = block.position[v];
    for (double& c : p) c = (2.0 * c - 1.0) * half;
    for (std::size_t k = 0; k < 3; ++k)
      if (std::fabs(p[k]) < 0.999 * half) p[k] += jitter * 2.0 * half / n * random_in(seed, k, block.key[v]);
    Double3 inner = p;
    for (double& c : inner) c = std::clamp(c, radius - half, half - radius);
    const Double3 out = unit(p - inner);
    const double off =
        noise > 0.0 ? noise * gaussian(random_bits(seed, 5, block.key[v]), random_bits(seed, 6, block.key[v]))
                    : 0.0;
    p = inner + out * (radius + off);
  }
  return block;
}

}  // namespace tessera::test
