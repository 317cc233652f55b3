#include "kernels/field/rim_rule.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>

#include "octree/lanes.h"

namespace tessera {
namespace {

constexpr float kTan22 = 0.41421356f;  ///< of half of 45 degrees
constexpr float kAlike = 0.5f;         ///< cosine of 60 degrees
constexpr int kMaxEmpty = 6;           ///< sectors of 22.5 degrees in a row

/// Bits of the sectors of 22.5 degrees, 0 to 15 around the circle, of the lanes that count.
__m256i sector_bits(__m256 x, __m256 y, __m256 counts) {
  const __m256 sign = _mm256_set1_ps(-0.0f), zero = _mm256_setzero_ps(), tan22 = _mm256_set1_ps(kTan22);
  const __m256 ax = _mm256_andnot_ps(sign, x), ay = _mm256_andnot_ps(sign, y);
  const auto chosen = [](__m256 condition, int yes, int no) {
    return _mm256_blendv_epi8(_mm256_set1_epi32(no), _mm256_set1_epi32(yes), _mm256_castps_si256(condition));
  };
  // Within the first quadrant.
  const __m256i steep = chosen(_mm256_cmp_ps(ax, _mm256_mul_ps(tan22, ay), _CMP_LT_OQ), 3, 2),
                flat = chosen(_mm256_cmp_ps(ay, _mm256_mul_ps(tan22, ax), _CMP_LT_OQ), 0, 1);
  const __m256i within =
      _mm256_blendv_epi8(flat, steep, _mm256_castps_si256(_mm256_cmp_ps(ay, ax, _CMP_GE_OQ)));
  // Quadrants run back and forth: s, 7 - s, 8 + s, 15 - s for s below 4.
  const __m256 up = _mm256_cmp_ps(y, zero, _CMP_GE_OQ);
  const __m256i turn = _mm256_blendv_epi8(chosen(up, 7, 8), chosen(up, 0, 15),
                                          _mm256_castps_si256(_mm256_cmp_ps(x, zero, _CMP_GE_OQ)));
  return _mm256_and_si256(_mm256_sllv_epi32(_mm256_set1_epi32(1), _mm256_xor_si256(within, turn)),
                          _mm256_castps_si256(counts));
}

}  // namespace

bool is_surrounded(const LocalSamples& samples, float value, const Float3& gradient, float thickness,
                   float within) {
  const auto& [gx, gy, gz] = gradient;
  // The foot point lies on the gradient through the node, so tangents through the node do.
  // Tangents: of the axis that is farthest from the gradient, and across.
  const float ax = std::abs(gx), ay = std::abs(gy), az = std::abs(gz);
  Float3 u = {0.0f, -gz, gy};
  if (ay < ax && ay <= az) u = {gz, 0.0f, -gx};
  if (az < ax && az < ay) u = {-gy, gx, 0.0f};
  const Float3 v = {gy * u[2] - gz * u[1], gz * u[0] - gx * u[2], gx * u[1] - gy * u[0]};
  const auto along = [](__m256 x, __m256 y, __m256 z, const Float3& a) {
    return _mm256_add_ps(
        _mm256_add_ps(_mm256_mul_ps(x, _mm256_set1_ps(a[0])), _mm256_mul_ps(y, _mm256_set1_ps(a[1]))),
        _mm256_mul_ps(z, _mm256_set1_ps(a[2])));
  };
  const __m256 gx8 = _mm256_set1_ps(gx), gy8 = _mm256_set1_ps(gy), gz8 = _mm256_set1_ps(gz);
  const __m256 value8 = _mm256_set1_ps(value), foot_x = _mm256_set1_ps(value * gx),
               foot_y = _mm256_set1_ps(value * gy), foot_z = _mm256_set1_ps(value * gz);
  const __m256i lane = _mm256_setr_epi32(0, 1, 2, 3, 4, 5, 6, 7);
  __m256i bits = _mm256_setzero_si256();
  __m256 near8 = _mm256_setzero_ps();
  for (std::size_t i = 0; i < samples.size; i += kLanes) {
    const auto left = static_cast<int>(std::min(samples.size - i, kLanes));
    __m256 counts = _mm256_castsi256_ps(_mm256_cmpgt_epi32(_mm256_set1_epi32(left), lane));
    const __m256 turn = along(_mm256_loadu_ps(&samples.nx[i]), _mm256_loadu_ps(&samples.ny[i]),
                              _mm256_loadu_ps(&samples.nz[i]), gradient);
    counts = _mm256_andnot_ps(_mm256_cmp_ps(turn, _mm256_set1_ps(kAlike), _CMP_LT_OQ), counts);
    const __m256 x = _mm256_loadu_ps(&samples.x[i]), y = _mm256_loadu_ps(&samples.y[i]),
                 z = _mm256_loadu_ps(&samples.z[i]);
    const __m256 height =
        _mm256_add_ps(_mm256_add_ps(_mm256_add_ps(value8, _mm256_mul_ps(x, gx8)), _mm256_mul_ps(y, gy8)),
                      _mm256_mul_ps(z, gz8));
    const __m256 off = _mm256_andnot_ps(_mm256_set1_ps(-0.0f), height);
    counts = _mm256_andnot_ps(_mm256_cmp_ps(off, _mm256_set1_ps(thickness), _CMP_GT_OQ), counts);
    if (_mm256_movemask_ps(counts) == 0) continue;
    const __m256 dx = _mm256_add_ps(x, foot_x), dy = _mm256_add_ps(y, foot_y), dz = _mm256_add_ps(z, foot_z);
    const __m256 d2 =
        _mm256_add_ps(_mm256_add_ps(_mm256_mul_ps(dx, dx), _mm256_mul_ps(dy, dy)), _mm256_mul_ps(dz, dz));
    near8 = _mm256_or_ps(
        near8, _mm256_and_ps(counts, _mm256_cmp_ps(d2, _mm256_set1_ps(within * within), _CMP_LE_OQ)));
    bits = _mm256_or_si256(bits, sector_bits(along(x, y, z, u), along(x, y, z, v), counts));
  }
  const bool near = _mm256_movemask_ps(near8) != 0;
  alignas(32) std::array<std::uint32_t, kLanes> words;
  _mm256_store_si256(reinterpret_cast<__m256i*>(words.data()), bits);
  std::uint32_t seen = 0;
  for (const std::uint32_t word : words) seen |= word;
  if (!near) return false;
  // Twice around, so that a gap over sector 0 is whole.
  const std::uint32_t twice = seen | seen << 16;
  std::uint32_t gap = ~twice;
  for (int k = 1; k < kMaxEmpty; ++k) gap &= ~twice >> k;
  return (gap & 0xffff) == 0;
}

}  // namespace tessera
