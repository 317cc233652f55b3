#include "kernels/change/ball_normals.h"

#include <immintrin.h>

#include <algorithm>
#include <array>
#include <cmath>

#include "octree/small_matrix.h"

namespace tessera {
namespace {

constexpr std::size_t kLanes = 4;
constexpr double kMinPlanePoints = 3.0;
/// A cell is taken whole, or passed over, where rounding decides nothing.
constexpr double kSure = 1e-9;
/// Of the middle eigenvalue to the largest: below it points lie on a line.
constexpr double kLine = 1e-12;
constexpr double kUpright = 1e-9;  ///< length of what is left of a unit normal without z

/// Sums over points relative to p: of lanes, and of whole cells.
struct BallSums {
  __m256d n = _mm256_setzero_pd(), x = n, y = n, z = n, xx = n, xy = n, xz = n, yy = n, yz = n, zz = n;
  CellMoments whole;
};

double lanes_added(__m256d v) {
  alignas(32) std::array<double, kLanes> lane{};
  _mm256_store_pd(lane.data(), v);
  return (lane[0] + lane[2]) + (lane[1] + lane[3]);
}

/// All ones in the first `count` lanes.
__m256i first_lanes(std::size_t count) {
  alignas(32) static constexpr std::array<std::int64_t, 8> kMask = {-1, -1, -1, -1, 0, 0, 0, 0};
  return _mm256_loadu_si256(reinterpret_cast<const __m256i*>(kMask.data() + (kLanes - count)));
}

/// Points of a cell that lie in the ball. No fused products: membership is that of plain arithmetic.
void add_points(const PointCells& cells, const PointCell& cell, const Double3& p, double square,
                BallSums& sums) {
  const __m256d px = _mm256_set1_pd(p[0]), py = _mm256_set1_pd(p[1]), pz = _mm256_set1_pd(p[2]);
  const __m256d limit = _mm256_set1_pd(square), one = _mm256_set1_pd(1.0);
  for (std::size_t i = cell.begin; i < cell.end; i += kLanes) {
    const __m256i there = first_lanes(std::min<std::size_t>(kLanes, cell.end - i));
    __m256d x = _mm256_sub_pd(_mm256_maskload_pd(cells.x().data() + i, there), px);
    __m256d y = _mm256_sub_pd(_mm256_maskload_pd(cells.y().data() + i, there), py);
    __m256d z = _mm256_sub_pd(_mm256_maskload_pd(cells.z().data() + i, there), pz);
    const __m256d xx = _mm256_mul_pd(x, x), yy = _mm256_mul_pd(y, y), zz = _mm256_mul_pd(z, z);
    const __m256d d2 = _mm256_add_pd(_mm256_add_pd(xx, yy), zz);
    const __m256d in = _mm256_and_pd(_mm256_cmp_pd(d2, limit, _CMP_LE_OQ), _mm256_castsi256_pd(there));
    x = _mm256_and_pd(x, in), y = _mm256_and_pd(y, in), z = _mm256_and_pd(z, in);
    sums.n = _mm256_add_pd(sums.n, _mm256_and_pd(one, in));
    sums.x = _mm256_add_pd(sums.x, x);
    sums.y = _mm256_add_pd(sums.y, y);
    sums.z = _mm256_add_pd(sums.z, z);
    sums.xx = _mm256_add_pd(sums.xx, _mm256_mul_pd(x, x));
    sums.xy = _mm256_add_pd(sums.xy, _mm256_mul_pd(x, y));
    sums.xz = _mm256_add_pd(sums.xz, _mm256_mul_pd(x, z));
    sums.yy = _mm256_add_pd(sums.yy, _mm256_mul_pd(y, y));
    sums.yz = _mm256_add_pd(sums.yz, _mm256_mul_pd(y, z));
    sums.zz = _mm256_add_pd(sums.zz, _mm256_mul_pd(z, z));
  }
}

/// A cell whose points all lie in the ball: its moments, moved to p.
void add_cell(const CellMoments& m, const Double3& t, CellMoments& sums) {
  const double sx = m.sum[0], sy = m.sum[1], sz = m.sum[2];
  const Double3 nt = t * m.count;
  sums.count += m.count;
  sums.sum = sums.sum + (m.sum + nt);
  sums.xx += m.xx + t[0] * (2.0 * sx + nt[0]);
  sums.xy += m.xy + t[0] * sy + t[1] * (sx + nt[0]);
  sums.xz += m.xz + t[0] * sz + t[2] * (sx + nt[0]);
  sums.yy += m.yy + t[1] * (2.0 * sy + nt[1]);
  sums.yz += m.yz + t[1] * sz + t[2] * (sy + nt[1]);
  sums.zz += m.zz + t[2] * (2.0 * sz + nt[2]);
}

CellMoments ball_sums(const PointCells& cells, const Double3& p, double radius) {
  const double square = radius * radius;
  BallSums sums;
  std::array<std::int32_t, 3> low{}, high{};
  for (std::size_t a = 0; a < 3; ++a)
    low[a] = cells.cell_of(p[a] - radius), high[a] = cells.cell_of(p[a] + radius);
  const std::span<const PointCell> all = cells.cells();
  cells.for_cells(low, high, [&](std::uint32_t k) {
    const PointCell& cell = all[k];
    const double d2 = squared_distance(cell.middle, p);
    const double outer = radius + cell.radius, inner = radius - cell.radius;
    if (d2 > outer * outer * (1.0 + kSure)) return;
    if (inner > 0.0 && d2 < inner * inner * (1.0 - kSure)) {
      add_cell(cells.moments(k), cell.centre - p, sums.whole);
    } else {
      add_points(cells, cell, p, square, sums);
    }
  });
  CellMoments out = sums.whole;
  out.count += lanes_added(sums.n);
  out.sum = out.sum + Double3{lanes_added(sums.x), lanes_added(sums.y), lanes_added(sums.z)};
  out.xx += lanes_added(sums.xx), out.xy += lanes_added(sums.xy), out.xz += lanes_added(sums.xz);
  out.yy += lanes_added(sums.yy), out.yz += lanes_added(sums.yz), out.zz += lanes_added(sums.zz);
  return out;
}

}  // namespace

std::optional<Double3> ruled_normal(const Double3& normal, const Double3& p, const NormalRule& rule) {
  Double3 n = normal;
  if (rule.kind == NormalRule::Kind::kHorizontal) {
    n[2] = 0.0;
    const double length = norm(n);
    if (!(length > kUpright)) return std::nullopt;
    n = n * (1.0 / length);
  }
  const double side = dot(n, rule.viewpoint ? *rule.viewpoint - p : rule.direction);
  const bool first_negative = n[0] != 0.0 ? n[0] < 0.0 : n[1] != 0.0 ? n[1] < 0.0 : n[2] < 0.0;
  if (side < 0.0 || (side == 0.0 && first_negative)) n = -n;
  return n + Double3{};  // no negative zeros
}

std::optional<Double3> ball_normal(const PointCells& cells, const Double3& p, double radius,
                                   const NormalRule& rule) {
  if (rule.kind == NormalRule::Kind::kVertical) return ruled_normal({0.0, 0.0, 1.0}, p, rule);
  const CellMoments s = ball_sums(cells, p, radius);
  if (s.count < kMinPlanePoints) return std::nullopt;
  const Double3 m = s.sum / s.count;
  const MinEigen3 plane =
      min_eigen3({s.xx / s.count - m[0] * m[0], s.xy / s.count - m[0] * m[1], s.xz / s.count - m[0] * m[2],
                  s.yy / s.count - m[1] * m[1], s.yz / s.count - m[1] * m[2], s.zz / s.count - m[2] * m[2]});
  if (!(plane.values[2] > 0.0) || !(plane.values[1] > kLine * plane.values[2])) return std::nullopt;
  return ruled_normal(plane.vector, p, rule);
}

}  // namespace tessera
