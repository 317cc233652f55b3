#include "kernels/collapse_gap.h"

#include <cmath>

namespace tessera {
namespace {

using synth::Vec3;

constexpr double cross2(double ax, double ay, double bx, double by) {
  return ax * by - ay * bx;
}

}  // namespace

bool fan_gap(const RimLoop& loop, const Vec3& apex, std::size_t flat_edge, double& gap, FanFoot* foot) {
  gap = 0.0;
  const std::size_t size = loop.size;
  if (size < 3) return true;  // the side vanishes; its apex already lies on the edge that stays
  Vec3 area{0, 0, 0};
  for (std::size_t i = 1; i + 1 < size; ++i) area = area + cross(loop.at[i], loop.at[i + 1]);
  const double length2 = dot(area, area);
  if (!(length2 > 0.0)) return false;
  const Vec3 n = area * (1.0 / std::sqrt(length2));
  const Vec3 ex = synth::any_orthogonal(n), ey = cross(n, ex);
  std::array<double, kMaxRing + 2> x, y, z;
  for (std::size_t i = 0; i < size; ++i) {
    x[i] = dot(loop.at[i], ex);
    y[i] = dot(loop.at[i], ey);
    z[i] = dot(loop.at[i], n);
  }
  const double ax = dot(apex, ex), ay = dot(apex, ey), az = dot(apex, n);
  // New fan: strictly counter-clockwise, and less than a full turn.
  for (std::size_t i = 1; i + 1 < size; ++i) {
    if (!(cross2(x[i], y[i], x[i + 1], y[i + 1]) > 0.0)) return false;
    if (i > 1 && cross2(x[i], y[i], x[1], y[1]) > 0.0 && cross2(x[1], y[1], x[i + 1], y[i + 1]) > 0.0)
      return false;
  }
  // Old fan: counter-clockwise; faces without area, seen along n, are bounded by their edges.
  const double rounding = -1e-13 * std::sqrt(length2);
  for (std::size_t i = 0; i < size; ++i) {
    const std::size_t j = i + 1 < size ? i + 1 : 0;
    if (i != flat_edge && cross2(x[i] - ax, y[i] - ay, x[j] - ax, y[j] - ay) < rounding) return false;
  }
  if (flat_edge == kNoFlatEdge) {
    bool inside = false;
    for (std::size_t i = 1; i + 1 < size; ++i) {
      const double before = cross2(x[i], y[i], ax, ay), after = cross2(ax, ay, x[i + 1], y[i + 1]);
      if (before < rounding || after < rounding) continue;
      const double full = cross2(x[i], y[i], x[i + 1], y[i + 1]);
      const double height = (z[i] * after + z[i + 1] * before) / full;
      gap = std::fmax(gap, std::fabs(az - height));
      inside = true;
      if (foot) *foot = {i, after / full, before / full};
    }
    if (!inside) return false;
  }
  constexpr double kSlack = 1e-9;
  for (std::size_t i = 1; i < size; ++i) {
    const double dx = x[i] - ax, dy = y[i] - ay, dz = z[i] - az, side = cross2(ax, ay, dx, dy);
    for (std::size_t j = 2; j + 1 < size; ++j) {
      if (j == i) continue;
      const double turn = cross2(dx, dy, x[j], y[j]);
      const double t = -cross2(ax, ay, x[j], y[j]) / turn, s = -side / turn;
      // Not a number where the edges are parallel: no crossing.
      if (t > -kSlack && t < 1.0 + kSlack && s > -kSlack && s < 1.0 + kSlack)
        gap = std::fmax(gap, std::fabs(az + t * dz - s * z[j]));
    }
  }
  return true;
}

}  // namespace tessera
