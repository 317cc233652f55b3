#include "kernels/collapse_gap.h"

#include <cmath>

namespace tessera {
namespace {

using synth::Vec3;

constexpr double cross2(double ax, double ay, double bx, double by) {
  return ax * by - ay * bx;
}

struct Flat {
  double x, y, z;
};

/// Twice the area of a, b, c, seen along the normal.
constexpr double turn(const Flat& a, const Flat& b, const Flat& c) {
  return cross2(b.x - a.x, b.y - a.y, c.x - a.x, c.y - a.y);
}

/// Adds to `gap` the height of p over a, b, c. \return false where p lies outside of the triangle
bool height_over(const Flat& p, const Flat& a, const Flat& b, const Flat& c, double rounding, double& gap) {
  const double wa = turn(p, b, c), wb = turn(p, c, a), wc = turn(p, a, b), sum = wa + wb + wc;
  if (wa < rounding || wb < rounding || wc < rounding || !(sum > 0.0)) return false;
  gap = std::fmax(gap, std::fabs((wa * a.z + wb * b.z + wc * c.z) / sum - p.z));
  return true;
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

bool edge_gap(const RimLoop& loop, const Vec3& u, const Vec3& v, std::size_t first, double& gap) {
  gap = 0.0;
  const std::size_t size = loop.size;
  const auto after = [&](std::size_t i) { return i + 1 < size ? i + 1 : 1; };
  Vec3 area{0, 0, 0};
  for (std::size_t i = 1; i < size; ++i) area = area + cross(loop.at[i], loop.at[after(i)]);
  const double length2 = dot(area, area);
  if (!(length2 > 0.0)) return false;
  const Vec3 n = area * (1.0 / std::sqrt(length2));
  const Vec3 ex = synth::any_orthogonal(n), ey = cross(n, ex);
  const auto flat = [&](const Vec3& p) { return Flat{dot(p, ex), dot(p, ey), dot(p, n)}; };
  std::array<Flat, kMaxRing + 2> rim;
  for (std::size_t i = 0; i < size; ++i) rim[i] = flat(loop.at[i]);
  const Flat centre[2] = {flat(u), flat(v)}, zero{0.0, 0.0, 0.0};
  const double rounding = -1e-13 * std::sqrt(length2);
  // Both are graphs over the polygon: the new fan once around, the old faces all the same way up.
  int turns = 0;
  for (std::size_t i = 1; i < size; ++i) {
    const std::size_t j = after(i);
    if (!(cross2(rim[i].x, rim[i].y, rim[j].x, rim[j].y) > 0.0)) return false;
    turns += rim[i].y < 0.0 && rim[j].y >= 0.0;
    if (turn(centre[i > first], rim[i], rim[j]) < rounding) return false;
  }
  const Flat &left = rim[1], &right = rim[first + 1];
  if (turns != 1 || turn(centre[0], centre[1], left) < rounding ||
      turn(centre[0], right, centre[1]) < rounding)
    return false;
  // Old centres over the new fan, the new one over the old faces.
  bool found[3] = {false, false, false};
  for (std::size_t i = 1; i < size; ++i) {
    const std::size_t j = after(i);
    for (std::size_t c = 0; c < 2; ++c)
      found[c] = height_over(centre[c], zero, rim[i], rim[j], rounding, gap) || found[c];
    found[2] = height_over(zero, centre[i > first], rim[i], rim[j], rounding, gap) || found[2];
  }
  found[2] = height_over(zero, centre[0], centre[1], left, rounding, gap) || found[2];
  found[2] = height_over(zero, centre[0], right, centre[1], rounding, gap) || found[2];
  if (!found[0] || !found[1] || !found[2]) return false;
  const auto cross_spokes = [&](const Flat& a, const Flat& b) {
    constexpr double kSlack = 1e-9;
    const double dx = b.x - a.x, dy = b.y - a.y, dz = b.z - a.z, side = cross2(a.x, a.y, dx, dy);
    for (std::size_t j = 1; j < size; ++j) {
      const double per = 1.0 / cross2(dx, dy, rim[j].x, rim[j].y);
      const double t = -cross2(a.x, a.y, rim[j].x, rim[j].y) * per, s = -side * per;
      if (t > -kSlack && t < 1.0 + kSlack && s > -kSlack && s < 1.0 + kSlack) {
        const double height = std::fabs(a.z + t * dz - s * rim[j].z);
        gap = height > gap ? height : gap;
      }
    }
  };
  cross_spokes(centre[0], centre[1]);
  for (std::size_t i = 1; i <= first + 1; ++i) cross_spokes(centre[0], rim[i]);
  for (std::size_t i = first + 1; i < size; ++i) cross_spokes(centre[1], rim[i]);
  cross_spokes(centre[1], rim[1]);
  return true;
}

}  // namespace tessera
