#include "kernels/decimate/star_lanes.h"

#include <array>
#include <cmath>

namespace tessera {
namespace {

constexpr std::size_t kMinFaces = 4, kLanes = 8;
/// Of the largest coordinate, in units: eighth powers of these still are ordinary floats.
constexpr float kMinSize = 0x1p-10f, kMaxSize = 0x1p+12f;
constexpr float kUnsure = 0x1p-18f;  ///< of the polygon's area: what is smaller may be rounding
constexpr float kSlack = 0x1p-20f;
/// Of the largest coordinate: what is flatter is flat to doubles, perhaps.
constexpr float kMinDeviation = 0x1p-14f;

struct alignas(32) LaneTables {
  std::uint8_t rotated[kLanes + 1][kLanes][kLanes]{};  ///< [size][at]: at, at + 1, ... around the ring
  std::uint8_t next[kLanes + 1][kLanes]{};
};
constexpr LaneTables make_tables() {
  LaneTables t;
  for (std::size_t size = 1; size <= kLanes; ++size)
    for (std::size_t lane = 0; lane < kLanes; ++lane) {
      t.next[size][lane] = static_cast<std::uint8_t>(lane + 1 < size ? lane + 1 : 0);
      for (std::size_t at = 0; at < kLanes; ++at)
        t.rotated[size][at][lane] = static_cast<std::uint8_t>(lane < size ? (at + lane) % size : at % size);
    }
  return t;
}
constexpr LaneTables kTables = make_tables();

__m256i indices(const std::uint8_t* table) {
  return _mm256_cvtepu8_epi32(_mm_loadl_epi64(reinterpret_cast<const __m128i*>(table)));
}
__m256 permuted(__m256 a, __m256i index) {
  return _mm256_permutevar8x32_ps(a, index);
}
__m256 absolute(__m256 a) {
  return _mm256_and_ps(a, _mm256_castsi256_ps(_mm256_set1_epi32(0x7fffffff)));
}
/// In a fixed order.
float sum_of(__m256 a) {
  __m128 s = _mm_add_ps(_mm256_castps256_ps128(a), _mm256_extractf128_ps(a, 1));
  s = _mm_add_ps(s, _mm_movehl_ps(s, s));
  return _mm_cvtss_f32(_mm_add_ss(s, _mm_movehdup_ps(s)));
}
float largest_of(__m256 a) {
  __m128 s = _mm_max_ps(_mm256_castps256_ps128(a), _mm256_extractf128_ps(a, 1));
  s = _mm_max_ps(s, _mm_movehl_ps(s, s));
  return _mm_cvtss_f32(_mm_max_ss(s, _mm_movehdup_ps(s)));
}

struct Lanes3 {
  __m256 x, y, z;
};
Lanes3 minus(const Lanes3& a, const Lanes3& b) {
  return {_mm256_sub_ps(a.x, b.x), _mm256_sub_ps(a.y, b.y), _mm256_sub_ps(a.z, b.z)};
}
Lanes3 cross(const Lanes3& a, const Lanes3& b) {
  return {_mm256_sub_ps(_mm256_mul_ps(a.y, b.z), _mm256_mul_ps(a.z, b.y)),
          _mm256_sub_ps(_mm256_mul_ps(a.z, b.x), _mm256_mul_ps(a.x, b.z)),
          _mm256_sub_ps(_mm256_mul_ps(a.x, b.y), _mm256_mul_ps(a.y, b.x))};
}
__m256 dot(const Lanes3& a, const Lanes3& b) {
  return _mm256_add_ps(_mm256_add_ps(_mm256_mul_ps(a.x, b.x), _mm256_mul_ps(a.y, b.y)),
                       _mm256_mul_ps(a.z, b.z));
}
__m256 cross_lanes(__m256 ax, __m256 ay, __m256 bx, __m256 by) {
  return _mm256_sub_ps(_mm256_mul_ps(ax, by), _mm256_mul_ps(ay, bx));
}
int bits_of(__m256 mask) {
  return _mm256_movemask_ps(mask);
}

}  // namespace

StarLanes::StarLanes(double unit, double min_mean_ratio)
    : unit_(unit),
      per_unit_(static_cast<float>(1.0 / unit)),
      min_(static_cast<float>(min_mean_ratio * min_mean_ratio / 12.0)),
      unit4_(unit * unit * unit * unit) {}

bool StarLanes::load(const CollapseMesh& mesh, std::uint32_t u, const Star& star) {
  if (!star.closed || star.faces < kMinFaces || star.faces > kLanes) return false;
  size_ = star.faces;
  // A vertex is its place and its error: four doubles side by side.
  const __m256d centre = _mm256_blend_pd(_mm256_load_pd(&mesh.node(u).at[0]), _mm256_setzero_pd(), 8);
  __m128 row[kLanes];
  for (std::size_t i = 0; i < size_; ++i)
    row[i] = _mm256_cvtpd_ps(_mm256_sub_pd(_mm256_load_pd(&mesh.node(star.ring[i]).at[0]), centre));
  for (std::size_t i = size_; i < kLanes; ++i) row[i] = row[0];
  _MM_TRANSPOSE4_PS(row[0], row[1], row[2], row[3]);
  _MM_TRANSPOSE4_PS(row[4], row[5], row[6], row[7]);
  const __m256 per = _mm256_set1_ps(per_unit_);
  x_ = _mm256_mul_ps(_mm256_set_m128(row[4], row[0]), per);
  y_ = _mm256_mul_ps(_mm256_set_m128(row[5], row[1]), per);
  z_ = _mm256_mul_ps(_mm256_set_m128(row[6], row[2]), per);
  const __m256 per2 = _mm256_mul_ps(per, per);
  error_ = _mm256_mul_ps(_mm256_mul_ps(_mm256_set_m128(row[7], row[3]), per2), per2);
  largest_ = largest_of(_mm256_max_ps(_mm256_max_ps(absolute(x_), absolute(y_)), absolute(z_)));
  return largest_ > kMinSize && largest_ < kMaxSize;
}

/// In fourth powers of the unit.
__m256 StarLanes::cost_lanes(const Quadric& q, const Double3& from) const {
  // The quadric around the centre: its large terms cancel here, in doubles.
  const double bx = q.bx - (q.xx * from[0] + q.xy * from[1] + q.xz * from[2]);
  const double by = q.by - (q.xy * from[0] + q.yy * from[1] + q.yz * from[2]);
  const double bz = q.bz - (q.xz * from[0] + q.yz * from[1] + q.zz * from[2]);
  const double c = q(from[0], from[1], from[2]);
  const double per = 1.0 / unit_, per2 = per * per, per3 = per2 * per;
  const auto lanes = [](double value) { return _mm256_set1_ps(static_cast<float>(value)); };
  const __m256 two_y = lanes(2.0 * per2 * q.xy), two_xz = lanes(2.0 * per2 * q.xz),
               two_yz = lanes(2.0 * per2 * q.yz);
  const __m256 ax =
      _mm256_add_ps(_mm256_add_ps(_mm256_mul_ps(lanes(per2 * q.xx), x_), _mm256_mul_ps(two_y, y_)),
                    _mm256_sub_ps(_mm256_mul_ps(two_xz, z_), lanes(2.0 * per3 * bx)));
  const __m256 ay = _mm256_add_ps(_mm256_mul_ps(lanes(per2 * q.yy), y_),
                                  _mm256_sub_ps(_mm256_mul_ps(two_yz, z_), lanes(2.0 * per3 * by)));
  const __m256 az = _mm256_sub_ps(_mm256_mul_ps(lanes(per2 * q.zz), z_), lanes(2.0 * per3 * bz));
  const __m256 error = _mm256_add_ps(_mm256_add_ps(_mm256_mul_ps(ax, x_), _mm256_mul_ps(ay, y_)),
                                     _mm256_add_ps(_mm256_mul_ps(az, z_), lanes(per2 * per2 * c)));
  const __m256 edge2 = dot({x_, y_, z_}, {x_, y_, z_});
  const __m256 tie = _mm256_mul_ps(_mm256_set1_ps(1e-8f), _mm256_mul_ps(edge2, edge2));
  return _mm256_add_ps(_mm256_add_ps(_mm256_max_ps(error, _mm256_setzero_ps()), error_), tie);
}

void StarLanes::costs(const Quadric& q, const Double3& from, std::array<double, 8>& cost) const {
  alignas(32) std::array<float, 8> lane;
  _mm256_store_ps(lane.data(), cost_lanes(q, from));
  for (std::size_t i = 0; i < size_; ++i) cost[i] = static_cast<double>(lane[i]) * unit4_;
}

StarLanes::Cheapest StarLanes::cheapest(const Quadric& q, const Double3& from) const {
  const __m256 cost = cost_lanes(q, from);
  // Lanes without a vertex of their own repeat the first.
  __m256 minimum = _mm256_min_ps(cost, _mm256_permute2f128_ps(cost, cost, 1));
  minimum = _mm256_min_ps(minimum, _mm256_permute_ps(minimum, 0x4e));
  minimum = _mm256_min_ps(minimum, _mm256_permute_ps(minimum, 0xb1));
  const unsigned found = static_cast<unsigned>(bits_of(_mm256_cmp_ps(cost, minimum, _CMP_EQ_OQ)));
  return {static_cast<double>(_mm256_cvtss_f32(minimum)) * unit4_,
          found == 0 ? 0 : static_cast<std::size_t>(__builtin_ctz(found))};
}

StarLanes::Answer StarLanes::judge(std::size_t at, double& deviation) const {
  const std::size_t k = size_;
  const int all = (1 << k) - 1, fresh = (all >> 1) & ~1;  // old faces; new ones: 1 to k - 2
  const __m256i rotated = indices(kTables.rotated[k][at]), next = indices(kTables.next[k]);
  const Lanes3 a = {permuted(x_, rotated), permuted(y_, rotated), permuted(z_, rotated)};
  const Lanes3 b = {permuted(a.x, next), permuted(a.y, next), permuted(a.z, next)};
  const __m256i first = _mm256_setzero_si256();
  const Lanes3 v = {permuted(a.x, first), permuted(a.y, first), permuted(a.z, first)};
  const __m256 zero = _mm256_setzero_ps();

  // Faces before and after, as check_new_faces() judges them.
  const Lanes3 link_edge = minus(b, a), to_v = minus(v, a), last = minus(v, b);
  const Lanes3 before = cross(a, b), after = cross(link_edge, to_v);
  const __m256 along = dot(before, after), before2 = dot(before, before), after2 = dot(after, after);
  const __m256 min_along2 = _mm256_mul_ps(_mm256_set1_ps(0.04f), _mm256_mul_ps(before2, after2));
  const int folds = bits_of(_mm256_cmp_ps(along, zero, _CMP_NGE_UQ)) |
                    bits_of(_mm256_cmp_ps(after2, zero, _CMP_NGT_UQ)) |
                    bits_of(_mm256_cmp_ps(_mm256_mul_ps(along, along), min_along2, _CMP_LT_OQ));
  if ((folds & fresh) != 0) return Answer::kRefused;
  const __m256 edges =
      _mm256_add_ps(_mm256_add_ps(dot(link_edge, link_edge), dot(to_v, to_v)), dot(last, last));
  const __m256 thin = _mm256_mul_ps(_mm256_set1_ps(min_), _mm256_mul_ps(edges, edges));
  if ((bits_of(_mm256_cmp_ps(after2, thin, _CMP_LT_OQ)) & fresh) != 0) return Answer::kDoubt;

  // The plane of the link's polygon.
  const __m256 used = _mm256_castsi256_ps(
      _mm256_cmpgt_epi32(_mm256_set1_epi32(static_cast<int>(k)), _mm256_set_epi32(7, 6, 5, 4, 3, 2, 1, 0)));
  float nx = sum_of(_mm256_and_ps(before.x, used)), ny = sum_of(_mm256_and_ps(before.y, used)),
        nz = sum_of(_mm256_and_ps(before.z, used));
  const float area = std::sqrt(nx * nx + ny * ny + nz * nz);
  if (!(area > 0.0f)) return Answer::kDoubt;
  nx /= area, ny /= area, nz /= area;
  // Any two axes of one length at right angles: only signs and ratios of areas in the plane are asked for.
  const float sx = std::fabs(nx), sy = std::fabs(ny), sz = std::fabs(nz);
  float ex = 0.0f, ey = nz, ez = -ny;
  if (!(sx <= sy && sx <= sz)) {
    if (sy <= sz)
      ex = -nz, ey = 0.0f, ez = nx;
    else
      ex = ny, ey = -nx, ez = 0.0f;
  }
  const float fx = ny * ez - nz * ey, fy = nz * ex - nx * ez, fz = nx * ey - ny * ex;
  const auto lanes = [](float value) { return _mm256_set1_ps(value); };
  const Lanes3 r = minus(a, v), e = {lanes(ex), lanes(ey), lanes(ez)}, f = {lanes(fx), lanes(fy), lanes(fz)},
               n = {lanes(nx), lanes(ny), lanes(nz)};
  const __m256 x = dot(r, e), y = dot(r, f), z = dot(r, n);
  const __m256 ax = _mm256_sub_ps(zero, dot(v, e)), ay = _mm256_sub_ps(zero, dot(v, f)),
               az = _mm256_sub_ps(zero, dot(v, n));
  const __m256 unsure = lanes(kUnsure * area);
  // Old fan: counter-clockwise, or a face without area, seen along the normal.
  if ((bits_of(_mm256_cmp_ps(dot(before, n), _mm256_sub_ps(zero, unsure), _CMP_LT_OQ)) & all) != 0)
    return Answer::kRefused;
  // New fan: strictly counter-clockwise, and less than a full turn.
  const __m256 xn = permuted(x, next), yn = permuted(y, next), zn = permuted(z, next);
  const __m256 full = cross_lanes(x, y, xn, yn);
  if ((bits_of(_mm256_cmp_ps(full, unsure, _CMP_NGT_UQ)) & fresh) != 0)
    return (bits_of(_mm256_cmp_ps(full, _mm256_sub_ps(zero, unsure), _CMP_LT_OQ)) & fresh) != 0
               ? Answer::kRefused
               : Answer::kDoubt;
  const __m256i second = _mm256_set1_epi32(1);
  const __m256 x1 = permuted(x, second), y1 = permuted(y, second);
  const int round = bits_of(_mm256_cmp_ps(cross_lanes(x, y, x1, y1), zero, _CMP_GT_OQ)) &
                    bits_of(_mm256_cmp_ps(cross_lanes(x1, y1, xn, yn), zero, _CMP_GT_OQ));
  if ((round & fresh & ~2) != 0) return Answer::kRefused;
  // The centre over the new face below it.
  const __m256 side = cross_lanes(ax, ay, x, y), side_n = permuted(side, next),
               low = _mm256_sub_ps(zero, unsure);
  const __m256 height = _mm256_sub_ps(
      az, _mm256_div_ps(_mm256_sub_ps(_mm256_mul_ps(z, side_n), _mm256_mul_ps(zn, side)), full));
  const __m256 covers = _mm256_and_ps(_mm256_cmp_ps(_mm256_sub_ps(zero, side), low, _CMP_GE_OQ),
                                      _mm256_cmp_ps(side_n, low, _CMP_GE_OQ));
  const __m256i lane = _mm256_set_epi32(7, 6, 5, 4, 3, 2, 1, 0);
  const __m256i size = _mm256_set1_epi32(static_cast<int>(k));
  const __m256 is_fresh = _mm256_castsi256_ps(_mm256_and_si256(
      _mm256_cmpgt_epi32(lane, first), _mm256_cmpgt_epi32(_mm256_sub_epi32(size, second), lane)));
  const __m256 below = _mm256_and_ps(covers, is_fresh);
  if (bits_of(below) == 0) return Answer::kDoubt;
  __m256 maximum = _mm256_and_ps(absolute(height), below);
  // Where old spokes cross new ones, those to 2 .. k - 2.
  const __m256 dx = _mm256_sub_ps(x, ax), dy = _mm256_sub_ps(y, ay), dz = _mm256_sub_ps(z, az);
  const __m256 min_share = lanes(-kSlack), max_share = lanes(1.0f + kSlack), one = lanes(1.0f);
  const __m256 spoke =
      _mm256_castsi256_ps(_mm256_and_si256(_mm256_cmpgt_epi32(lane, first), _mm256_cmpgt_epi32(size, lane)));
  for (std::size_t j = 2; j + 1 < k; ++j) {
    const __m256i to = _mm256_set1_epi32(static_cast<int>(j));
    const __m256 per = _mm256_div_ps(one, cross_lanes(dx, dy, permuted(x, to), permuted(y, to)));
    const __m256 t = _mm256_sub_ps(zero, _mm256_mul_ps(permuted(side, to), per)),
                 s = _mm256_sub_ps(zero, _mm256_mul_ps(side, per));
    const __m256 up =
        _mm256_sub_ps(_mm256_add_ps(az, _mm256_mul_ps(t, dz)), _mm256_mul_ps(s, permuted(z, to)));
    __m256 meet =
        _mm256_and_ps(_mm256_cmp_ps(t, min_share, _CMP_GT_OQ), _mm256_cmp_ps(t, max_share, _CMP_LT_OQ));
    meet = _mm256_and_ps(meet, _mm256_and_ps(_mm256_cmp_ps(s, min_share, _CMP_GT_OQ),
                                             _mm256_cmp_ps(s, max_share, _CMP_LT_OQ)));
    meet = _mm256_andnot_ps(_mm256_castsi256_ps(_mm256_cmpeq_epi32(lane, to)), _mm256_and_ps(meet, spoke));
    maximum = _mm256_max_ps(maximum, _mm256_and_ps(meet, absolute(up)));
  }
  const float highest = largest_of(maximum);
  if (highest < kMinDeviation * largest_) return Answer::kDoubt;
  deviation =
      (static_cast<double>(highest) * (1.0 + 0x1p-20) + 0x1p-19 * static_cast<double>(largest_)) * unit_;
  return Answer::kGood;
}

}  // namespace tessera
