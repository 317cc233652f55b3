#include "kernels/decimate/collapse_deviation.h"

#include <immintrin.h>

#include <cmath>

#include "octree/lanes.h"

namespace tessera {
namespace {

constexpr double cross_2d(double ax, double ay, double bx, double by) {
  return ax * by - ay * bx;
}

struct Flat {
  double x, y, z;
};

/// Twice the area of a, b, c, seen along the normal.
constexpr double orient2d(const Flat& a, const Flat& b, const Flat& c) {
  return cross_2d(b.x - a.x, b.y - a.y, c.x - a.x, c.y - a.y);
}

/// Adds to `deviation` the height of p over a, b, c. \return false where p lies outside of the triangle
bool height_above(const Flat& p, const Flat& a, const Flat& b, const Flat& c, double rounding,
                  double& deviation) {
  const double wa = orient2d(p, b, c), wb = orient2d(p, c, a), wc = orient2d(p, a, b), sum = wa + wb + wc;
  if (wa < rounding || wb < rounding || wc < rounding || !(sum > 0.0)) return false;
  deviation = std::fmax(deviation, std::fabs((wa * a.z + wb * b.z + wc * c.z) / sum - p.z));
  return true;
}

}  // namespace

bool fan_deviation(const LinkLoop& loop, const Double3& apex, std::size_t flat_edge, double& deviation,
                   FanFoot* foot) {
  deviation = 0.0;
  const std::size_t size = loop.size;
  if (size < 3) return true;  // the side vanishes; its apex already lies on the edge that stays
  Double3 area{0, 0, 0};
  for (std::size_t i = 1; i + 1 < size; ++i) area = area + cross(loop.at[i], loop.at[i + 1]);
  const double length2 = dot(area, area);
  if (!(length2 > 0.0)) return false;
  const Double3 n = area * (1.0 / std::sqrt(length2));
  const Double3 ex = any_orthogonal(n), ey = cross(n, ex);
  alignas(32) std::array<double, kMaxRing + 2 + kDoubleLanes> x, y, z, before;
  for (std::size_t i = 0; i < size; ++i) {
    x[i] = dot(loop.at[i], ex);
    y[i] = dot(loop.at[i], ey);
    z[i] = dot(loop.at[i], n);
  }
  const double ax = dot(apex, ex), ay = dot(apex, ey), az = dot(apex, n);
  for (std::size_t i = 0; i < size; ++i) before[i] = cross_2d(ax, ay, x[i], y[i]);
  // New fan: strictly counter-clockwise, and less than a full turn.
  for (std::size_t i = 1; i + 1 < size; ++i) {
    if (!(cross_2d(x[i], y[i], x[i + 1], y[i + 1]) > 0.0)) return false;
    if (i > 1 && cross_2d(x[i], y[i], x[1], y[1]) > 0.0 && cross_2d(x[1], y[1], x[i + 1], y[i + 1]) > 0.0)
      return false;
  }
  // Old fan: counter-clockwise; faces without area, seen along n, are bounded by their edges.
  const double rounding = -1e-13 * std::sqrt(length2);
  for (std::size_t i = 0; i < size; ++i) {
    const std::size_t j = i + 1 < size ? i + 1 : 0;
    if (i != flat_edge && cross_2d(x[i] - ax, y[i] - ay, x[j] - ax, y[j] - ay) < rounding) return false;
  }
  if (flat_edge == kNoFlatEdge) {
    bool inside = false;
    for (std::size_t i = 1; i + 1 < size; ++i) {
      const double to = -before[i], from = before[i + 1];
      if (to < rounding || from < rounding) continue;
      const double full = cross_2d(x[i], y[i], x[i + 1], y[i + 1]);
      const double height = std::fabs(az - (z[i] * from + z[i + 1] * to) / full);
      deviation = height > deviation ? height : deviation;
      inside = true;
      if (foot) *foot = {i, from / full, to / full};
    }
    if (!inside) return false;
  }
  // Where old spokes cross new ones, those to at[2] .. at[size - 2]: four at once, filled up with some that are
  // parallel to all, whose crossings are not numbers.
  if (size < 4) return true;
  const std::size_t spokes = size - 3;
  alignas(32) std::array<double, kMaxRing + 2 + kDoubleLanes> sx, sy, sz, flipped;
  for (std::size_t j = 0; j < spokes; ++j)
    sx[j] = x[j + 2], sy[j] = y[j + 2], sz[j] = z[j + 2], flipped[j] = -before[j + 2];
  for (std::size_t j = spokes; j < spokes + kDoubleLanes - 1; ++j) sx[j] = sy[j] = sz[j] = flipped[j] = 0.0;
  constexpr double kSlack = 1e-9;
  const __m256d low = _mm256_set1_pd(-kSlack), high = _mm256_set1_pd(1.0 + kSlack);
  const __m256d absolute = _mm256_castsi256_pd(_mm256_set1_epi64x(0x7fffffffffffffff));
  __m256d maximum = _mm256_setzero_pd();
  for (std::size_t i = 1; i < size; ++i) {
    const __m256d dx = _mm256_set1_pd(x[i] - ax), dy = _mm256_set1_pd(y[i] - ay),
                  dz = _mm256_set1_pd(z[i] - az), start = _mm256_set1_pd(az);
    const __m256d side = _mm256_set1_pd(-before[i]);
    for (std::size_t j = 0; j < spokes; j += kDoubleLanes) {
      const __m256d orient2d =
          _mm256_sub_pd(_mm256_mul_pd(dx, _mm256_load_pd(&sy[j])), _mm256_mul_pd(dy, _mm256_load_pd(&sx[j])));
      const __m256d t = _mm256_div_pd(_mm256_load_pd(&flipped[j]), orient2d),
                    s = _mm256_div_pd(side, orient2d);
      const __m256d height =
          _mm256_sub_pd(_mm256_add_pd(start, _mm256_mul_pd(t, dz)), _mm256_mul_pd(s, _mm256_load_pd(&sz[j])));
      __m256d crosses = _mm256_and_pd(_mm256_cmp_pd(t, low, _CMP_GT_OQ), _mm256_cmp_pd(t, high, _CMP_LT_OQ));
      crosses = _mm256_and_pd(
          crosses, _mm256_and_pd(_mm256_cmp_pd(s, low, _CMP_GT_OQ), _mm256_cmp_pd(s, high, _CMP_LT_OQ)));
      if (i >= j + 2 && i < j + 2 + kDoubleLanes) {  // not its own spoke
        const auto own = static_cast<int>(i - j - 2);
        crosses = _mm256_andnot_pd(
            _mm256_castsi256_pd(_mm256_cmpeq_epi64(_mm256_set_epi64x(3, 2, 1, 0), _mm256_set1_epi64x(own))),
            crosses);
      }
      maximum = _mm256_max_pd(maximum, _mm256_and_pd(crosses, _mm256_and_pd(height, absolute)));
    }
  }
  alignas(32) std::array<double, kDoubleLanes> lane;
  _mm256_store_pd(lane.data(), maximum);
  for (const double height : lane) deviation = height > deviation ? height : deviation;
  return true;
}

bool edge_deviation(const LinkLoop& loop, const Double3& u, const Double3& v, std::size_t first,
                    double& deviation) {
  deviation = 0.0;
  const std::size_t size = loop.size;
  const auto after = [&](std::size_t i) { return i + 1 < size ? i + 1 : 1; };
  Double3 area{0, 0, 0};
  for (std::size_t i = 1; i < size; ++i) area = area + cross(loop.at[i], loop.at[after(i)]);
  const double length2 = dot(area, area);
  if (!(length2 > 0.0)) return false;
  const Double3 n = area * (1.0 / std::sqrt(length2));
  const Double3 ex = any_orthogonal(n), ey = cross(n, ex);
  const auto flat = [&](const Double3& p) { return Flat{dot(p, ex), dot(p, ey), dot(p, n)}; };
  std::array<Flat, kMaxRing + 2> link;
  for (std::size_t i = 0; i < size; ++i) link[i] = flat(loop.at[i]);
  const Flat centre[2] = {flat(u), flat(v)}, zero{0.0, 0.0, 0.0};
  const double rounding = -1e-13 * std::sqrt(length2);
  // Both are graphs over the polygon: the new fan once around, the old faces all the same way up.
  int flips = 0;
  for (std::size_t i = 1; i < size; ++i) {
    const std::size_t j = after(i);
    if (!(cross_2d(link[i].x, link[i].y, link[j].x, link[j].y) > 0.0)) return false;
    flips += link[i].y < 0.0 && link[j].y >= 0.0;
    if (orient2d(centre[i > first], link[i], link[j]) < rounding) return false;
  }
  const Flat &left = link[1], &right = link[first + 1];
  if (flips != 1 || orient2d(centre[0], centre[1], left) < rounding ||
      orient2d(centre[0], right, centre[1]) < rounding)
    return false;
  // Old centres over the new fan, the new one over the old faces.
  bool found[3] = {false, false, false};
  for (std::size_t i = 1; i < size; ++i) {
    const std::size_t j = after(i);
    for (std::size_t c = 0; c < 2; ++c)
      found[c] = height_above(centre[c], zero, link[i], link[j], rounding, deviation) || found[c];
    found[2] = height_above(zero, centre[i > first], link[i], link[j], rounding, deviation) || found[2];
  }
  found[2] = height_above(zero, centre[0], centre[1], left, rounding, deviation) || found[2];
  found[2] = height_above(zero, centre[0], right, centre[1], rounding, deviation) || found[2];
  if (!found[0] || !found[1] || !found[2]) return false;
  const auto cross_spokes = [&](const Flat& a, const Flat& b) {
    constexpr double kSlack = 1e-9;
    const double dx = b.x - a.x, dy = b.y - a.y, dz = b.z - a.z, side = cross_2d(a.x, a.y, dx, dy);
    for (std::size_t j = 1; j < size; ++j) {
      const double per = 1.0 / cross_2d(dx, dy, link[j].x, link[j].y);
      const double t = -cross_2d(a.x, a.y, link[j].x, link[j].y) * per, s = -side * per;
      if (t > -kSlack && t < 1.0 + kSlack && s > -kSlack && s < 1.0 + kSlack) {
        const double height = std::fabs(a.z + t * dz - s * link[j].z);
        deviation = height > deviation ? height : deviation;
      }
    }
  };
  cross_spokes(centre[0], centre[1]);
  for (std::size_t i = 1; i <= first + 1; ++i) cross_spokes(centre[0], link[i]);
  for (std::size_t i = first + 1; i < size; ++i) cross_spokes(centre[1], link[i]);
  cross_spokes(centre[1], link[1]);
  return true;
}

}  // namespace tessera
