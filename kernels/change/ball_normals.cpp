#include "kernels/change/ball_normals.h"

#include <immintrin.h>

#include <array>
#include <cmath>

#include "octree/small_matrix.h"

namespace tessera {
namespace {

constexpr double kMinPlanePoints = 3.0;
/// A cell is taken whole, or passed over, where rounding decides nothing.
constexpr double kSure = 1e-9;
/// Of the middle eigenvalue to the largest: below it points lie on a line.
constexpr double kLine = 1e-12;
constexpr double kAcrossDirection = 1e-9;  ///< cosine below which rounding alone would choose the side
constexpr double kUpright = 1e-9;          ///< length of what is left of a unit normal without z

/// Sums over points relative to p: of lanes, and of whole cells.
struct BallSums {
  __m256d n = _mm256_setzero_pd(), x = n, y = n, z = n, xx = n, xy = n, xz = n, yy = n, yz = n, zz = n;
  CellMoments whole;
};

/// Points of a cell that lie in the ball. No fused products: membership is that of plain arithmetic.
void add_points(const PointCells& cells, const PointCell& cell, const PlaceLanes& p, __m256d square,
                BallSums& sums) {
  const __m256d one = _mm256_set1_pd(1.0);
  for_point_lanes(cells, cell.begin, cell.end, p, [&](__m256d x, __m256d y, __m256d z, __m256d there) {
    const __m256d d2 =
        _mm256_add_pd(_mm256_add_pd(_mm256_mul_pd(x, x), _mm256_mul_pd(y, y)), _mm256_mul_pd(z, z));
    const __m256d in = _mm256_and_pd(_mm256_cmp_pd(d2, square, _CMP_LE_OQ), there);
    x = _mm256_and_pd(x, in), y = _mm256_and_pd(y, in), z = _mm256_and_pd(z, in);
    sums.n = _mm256_add_pd(sums.n, _mm256_and_pd(one, in));
    sums.x = _mm256_add_pd(sums.x, x);
    sums.y = _mm256_add_pd(sums.y, y);
    sums.z = _mm256_add_pd(sums.z, z);
    sums.xx = _mm256_fmadd_pd(x, x, sums.xx);
    sums.xy = _mm256_fmadd_pd(x, y, sums.xy);
    sums.xz = _mm256_fmadd_pd(x, z, sums.xz);
    sums.yy = _mm256_fmadd_pd(y, y, sums.yy);
    sums.yz = _mm256_fmadd_pd(y, z, sums.yz);
    sums.zz = _mm256_fmadd_pd(z, z, sums.zz);
  });
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

CellMoments ball_sums(const PointCells& cells, const NearCells& near, const Double3& p, double radius) {
  const PlaceLanes at(p);
  const __m256d square = _mm256_set1_pd(radius * radius), reach = _mm256_set1_pd(radius);
  const __m256d sure = _mm256_set1_pd(1.0 + kSure);
  BallSums sums;
  near.for_meeting(
      [&](__m256d x, __m256d y, __m256d z, __m256d r) {
        x = _mm256_sub_pd(x, at.x), y = _mm256_sub_pd(y, at.y), z = _mm256_sub_pd(z, at.z);
        const __m256d d2 =
            _mm256_add_pd(_mm256_add_pd(_mm256_mul_pd(x, x), _mm256_mul_pd(y, y)), _mm256_mul_pd(z, z));
        const __m256d outer = _mm256_add_pd(reach, r);
        return _mm256_cmp_pd(d2, _mm256_mul_pd(_mm256_mul_pd(outer, outer), sure), _CMP_LE_OQ);
      },
      [&](std::uint32_t k) {
        const PointCell& cell = cells.cells()[k];
        const double inner = radius - cell.radius;
        if (inner > 0.0 && squared_distance(cell.middle, p) < inner * inner * (1.0 - kSure)) {
          add_cell(cells.moments(k), cell.centre - p, sums.whole);
        } else {
          add_points(cells, cell, at, square, sums);
        }
      });
  CellMoments out = sums.whole;
  out.count += lane_sum(sums.n);
  out.sum = out.sum + Double3{lane_sum(sums.x), lane_sum(sums.y), lane_sum(sums.z)};
  out.xx += lane_sum(sums.xx), out.xy += lane_sum(sums.xy), out.xz += lane_sum(sums.xz);
  out.yy += lane_sum(sums.yy), out.yz += lane_sum(sums.yz), out.zz += lane_sum(sums.zz);
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
  const Double3 towards = rule.viewpoint ? *rule.viewpoint - p : rule.direction;
  double side = dot(n, towards);
  if (std::abs(side) <= kAcrossDirection * norm(towards)) side = 0.0;
  const bool first_negative = n[0] != 0.0 ? n[0] < 0.0 : n[1] != 0.0 ? n[1] < 0.0 : n[2] < 0.0;
  if (side < 0.0 || (side == 0.0 && first_negative)) n = -n;
  return n + Double3{};  // no negative zeros
}

std::optional<Double3> ball_normal(const PointCells& cells, const NearCells& near, const Double3& p,
                                   double radius, const NormalRule& rule) {
  if (rule.kind == NormalRule::Kind::kVertical) return ruled_normal({0.0, 0.0, 1.0}, p, rule);
  const CellMoments s = ball_sums(cells, near, p, radius);
  if (s.count < kMinPlanePoints) return std::nullopt;
  const Double3 m = s.sum / s.count;
  const MinEigen3 plane =
      min_eigen3({s.xx / s.count - m[0] * m[0], s.xy / s.count - m[0] * m[1], s.xz / s.count - m[0] * m[2],
                  s.yy / s.count - m[1] * m[1], s.yz / s.count - m[1] * m[2], s.zz / s.count - m[2] * m[2]});
  if (!(plane.values[2] > 0.0) || !(plane.values[1] > kLine * plane.values[2])) return std::nullopt;
  return ruled_normal(plane.vector, p, rule);
}

}  // namespace tessera
