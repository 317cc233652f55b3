#include "kernels/decimate/star_lanes.h"

#include <array>
#include <cmath>

namespace tessera {
namespace {

constexpr std::size_t kMinFaces = 4;
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

Int8 indices(const std::uint8_t* table) {
  return reinterpret_cast<Int8>(
      _mm256_cvtepu8_epi32(_mm_loadl_epi64(reinterpret_cast<const __m128i*>(table))));
}
Float8x3 permuted(const Float8x3& v, Int8 index) {
  return {tessera::permuted(v[0], index), tessera::permuted(v[1], index), tessera::permuted(v[2], index)};
}
Float8 cross_in_plane(Float8 ax, Float8 ay, Float8 bx, Float8 by) {
  return ax * by - ay * bx;
}
/// Zero where the mask does not hold.
Float8 where(Mask8 mask, Float8 v) {
  return _mm256_and_ps(reinterpret_cast<__m256>(mask), v);
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
  ring_ = {_mm256_set_m128(row[4], row[0]) * per_unit_, _mm256_set_m128(row[5], row[1]) * per_unit_,
           _mm256_set_m128(row[6], row[2]) * per_unit_};
  const float per2 = per_unit_ * per_unit_;
  error_ = _mm256_set_m128(row[7], row[3]) * per2 * per2;
  largest_ = lane_max(larger(larger(absolute(ring_[0]), absolute(ring_[1])), absolute(ring_[2])));
  return largest_ > kMinSize && largest_ < kMaxSize;
}

/// In fourth powers of the unit.
Float8 StarLanes::cost_lanes(const Quadric& q, const Double3& from) const {
  // The quadric around the centre: its large terms cancel here, in doubles.
  const double bx = q.bx - (q.xx * from[0] + q.xy * from[1] + q.xz * from[2]);
  const double by = q.by - (q.xy * from[0] + q.yy * from[1] + q.yz * from[2]);
  const double bz = q.bz - (q.xz * from[0] + q.yz * from[1] + q.zz * from[2]);
  const double c = q(from[0], from[1], from[2]);
  const double per = 1.0 / unit_, per2 = per * per, per3 = per2 * per;
  const auto single = [](double value) { return static_cast<float>(value); };
  const auto& [x, y, z] = ring_;
  const float two_xy = single(2.0 * per2 * q.xy), two_xz = single(2.0 * per2 * q.xz),
              two_yz = single(2.0 * per2 * q.yz);
  const Float8 ax = (single(per2 * q.xx) * x + two_xy * y) + (two_xz * z - single(2.0 * per3 * bx));
  const Float8 ay = single(per2 * q.yy) * y + (two_yz * z - single(2.0 * per3 * by));
  const Float8 az = single(per2 * q.zz) * z - single(2.0 * per3 * bz);
  const Float8 error = (ax * x + ay * y) + (az * z + single(per2 * per2 * c));
  const Float8 edge2 = dot(ring_, ring_), tie = 1e-8f * (edge2 * edge2);
  return larger(error, Float8{}) + error_ + tie;
}

void StarLanes::costs(const Quadric& q, const Double3& from, std::array<double, 8>& cost) const {
  alignas(32) std::array<float, 8> lane;
  _mm256_store_ps(lane.data(), cost_lanes(q, from));
  for (std::size_t i = 0; i < size_; ++i) cost[i] = static_cast<double>(lane[i]) * unit4_;
}

StarLanes::Cheapest StarLanes::cheapest(const Quadric& q, const Double3& from) const {
  const Float8 cost = cost_lanes(q, from);
  // Lanes without a vertex of their own repeat the first.
  const float minimum = -lane_max(-cost);
  const unsigned found = bits_of(cost == minimum);
  return {static_cast<double>(minimum) * unit4_,
          found == 0 ? 0 : static_cast<std::size_t>(__builtin_ctz(found))};
}

bool StarLanes::is_surely_flat(float cosine) const {
  // With sines of this or more at the centre, normals are off by less than 2^-11 of their length.
  constexpr float kMinSine = 0x1p-10f, kMargin = 0x1p-8f;
  constexpr float kLeastProduct = 0x1p-100f;  // far from where floats lose digits
  const Float8x3 next = permuted(ring_, indices(kTables.next[size_]));
  const Float8x3 normal = cross(ring_, next), first = permuted(normal, Int8{});
  const Float8 along = dot(first, normal), first2 = dot(first, first), normal2 = dot(normal, normal);
  const float limit = cosine + kMargin;
  const Mask8 flat = (along > 0.0f) & (first2 * normal2 > kLeastProduct) &
                     (along * along > limit * limit * (first2 * normal2)) &
                     (normal2 > kMinSine * kMinSine * (dot(ring_, ring_) * dot(next, next)));
  const unsigned all = (1u << size_) - 1u;
  return (bits_of(flat) & all) == all;
}

StarLanes::Answer StarLanes::judge(std::size_t at, double& deviation) const {
  const std::size_t k = size_;
  const unsigned all = (1u << k) - 1u, fresh = (all >> 1) & ~1u;  // old faces; new ones: 1 to k - 2
  const Int8 next = indices(kTables.next[k]), none = {};
  const Float8x3 a = permuted(ring_, indices(kTables.rotated[k][at]));
  const Float8x3 b = permuted(a, next), v = permuted(a, none);

  // Faces before and after, as check_new_faces() judges them.
  const Float8x3 link_edge = b - a, to_v = v - a, last = v - b;
  const Float8x3 before = cross(a, b), after = cross(link_edge, to_v);
  const Float8 along = dot(before, after), before2 = dot(before, before), after2 = dot(after, after);
  const unsigned folds =
      bits_of(~(along >= 0.0f) | ~(after2 > 0.0f) | (along * along < 0.04f * (before2 * after2)));
  if ((folds & fresh) != 0) return Answer::kRefused;
  const Float8 edges = dot(link_edge, link_edge) + dot(to_v, to_v) + dot(last, last);
  if ((bits_of(after2 < min_ * (edges * edges)) & fresh) != 0) return Answer::kDoubt;

  // The plane of the link's polygon.
  const Int8 size = none + static_cast<std::int32_t>(k);
  const Mask8 used = kLaneNumbers < size;
  Float3 n = {lane_sum(where(used, before[0])), lane_sum(where(used, before[1])),
              lane_sum(where(used, before[2]))};
  const float area = norm(n);
  if (!(area > 0.0f)) return Answer::kDoubt;
  n = n / area;
  // Any two axes of one length at right angles: only signs and ratios of areas in the plane are asked for.
  const float sx = std::fabs(n[0]), sy = std::fabs(n[1]), sz = std::fabs(n[2]);
  const Float3 e = sx <= sy && sx <= sz ? Float3{0.0f, n[2], -n[1]}
                   : sy <= sz           ? Float3{-n[2], 0.0f, n[0]}
                                        : Float3{n[1], -n[0], 0.0f};
  const Float3 f = cross(n, e);
  const auto along_axis = [](const Float8x3& p, const Float3& axis) {
    return p[0] * axis[0] + p[1] * axis[1] + p[2] * axis[2];
  };
  const Float8x3 r = a - v;
  const Float8 x = along_axis(r, e), y = along_axis(r, f), z = along_axis(r, n);
  const Float8 ax = 0.0f - along_axis(v, e), ay = 0.0f - along_axis(v, f), az = 0.0f - along_axis(v, n);
  const float unsure = kUnsure * area;
  // Old fan: counter-clockwise, or a face without area, seen along the normal.
  if ((bits_of(along_axis(before, n) < -unsure) & all) != 0) return Answer::kRefused;
  // New fan: strictly counter-clockwise, and less than a full turn.
  const Float8 xn = permuted(x, next), yn = permuted(y, next), zn = permuted(z, next);
  const Float8 full = cross_in_plane(x, y, xn, yn);
  if ((bits_of(~(full > unsure)) & fresh) != 0)
    return (bits_of(full < -unsure) & fresh) != 0 ? Answer::kRefused : Answer::kDoubt;
  const Float8 x1 = permuted(x, none + 1), y1 = permuted(y, none + 1);
  const unsigned round =
      bits_of((cross_in_plane(x, y, x1, y1) > 0.0f) & (cross_in_plane(x1, y1, xn, yn) > 0.0f));
  if ((round & fresh & ~2u) != 0) return Answer::kRefused;
  // The centre over the new face below it.
  const Float8 side = cross_in_plane(ax, ay, x, y), side_n = permuted(side, next);
  const Float8 height = az - (z * side_n - zn * side) / full;
  const Mask8 covers = (0.0f - side >= -unsure) & (side_n >= -unsure);
  const Mask8 below = covers & (kLaneNumbers > 0) & (kLaneNumbers < size - 1);
  if (bits_of(below) == 0) return Answer::kDoubt;
  Float8 maximum = where(below, absolute(height));
  // Where old spokes cross new ones, those to 2 .. k - 2.
  const Float8 dx = x - ax, dy = y - ay, dz = z - az;
  const Mask8 spoke = (kLaneNumbers > 0) & (kLaneNumbers < size);
  for (std::size_t j = 2; j + 1 < k; ++j) {
    const Int8 to = none + static_cast<std::int32_t>(j);
    const Float8 per = 1.0f / cross_in_plane(dx, dy, permuted(x, to), permuted(y, to));
    const Float8 t = 0.0f - permuted(side, to) * per, s = 0.0f - side * per;
    const Float8 up = az + t * dz - s * permuted(z, to);
    const Mask8 meet = (t > -kSlack) & (t < 1.0f + kSlack) & (s > -kSlack) & (s < 1.0f + kSlack) & spoke &
                       (kLaneNumbers != to);
    maximum = larger(maximum, where(meet, absolute(up)));
  }
  const float highest = lane_max(maximum);
  if (highest < kMinDeviation * largest_) return Answer::kDoubt;
  deviation =
      (static_cast<double>(highest) * (1.0 + 0x1p-20) + 0x1p-19 * static_cast<double>(largest_)) * unit_;
  return Answer::kGood;
}

}  // namespace tessera
