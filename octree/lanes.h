/// \file lanes.h
/// Numbers side by side in one vector register. Operators work on every lane alone: the bits are those of one number after the
/// other. Vectors of lanes, Vector3<Double4>, have the operators of vector.h. Of AVX2; for .cpp files and what they share.
#pragma once
#include <immintrin.h>

#include <array>
#include <cstddef>
#include <cstdint>
#include <cstring>

#include "octree/vector.h"

namespace tessera {

using Double4 [[gnu::vector_size(4 * sizeof(double))]] = double;
using Float8 [[gnu::vector_size(8 * sizeof(float))]] = float;
using Int8 [[gnu::vector_size(8 * sizeof(std::int32_t))]] = std::int32_t;
/// What comparisons give: all bits of a lane, or none.
using Mask4 = decltype(Double4{} < Double4{});
using Mask8 = decltype(Float8{} < Float8{});

inline constexpr std::size_t kLanes = 8;  ///< floats of a register
inline constexpr std::size_t kDoubleLanes = 4;
inline constexpr Int8 kLaneNumbers = {0, 1, 2, 3, 4, 5, 6, 7};

template <>
inline constexpr bool kIsLanes<Double4> = true;
template <>
inline constexpr bool kIsLanes<Float8> = true;
using Double4x3 = Vector3<Double4>;
using Float8x3 = Vector3<Float8>;

inline Double4x3 operator*(const Double4x3& a, double s) {
  return {a[0] * s, a[1] * s, a[2] * s};
}

/// Of any alignment.
[[nodiscard]] inline Double4 load4(const double* from) {
  return _mm256_loadu_pd(from);
}
inline void store4(double* to, Double4 value) {
  _mm256_storeu_pd(to, value);
}

[[nodiscard]] inline Double4 square_root(Double4 v) {
  return _mm256_sqrt_pd(v);
}
/// a b + c, rounded once: written out, since no compiler may contract.
[[nodiscard]] inline Double4 fused(Double4 a, Double4 b, Double4 c) {
  return _mm256_fmadd_pd(a, b, c);
}
[[nodiscard]] inline Float8 absolute(Float8 v) {
  return _mm256_andnot_ps(_mm256_set1_ps(-0.0f), v);
}
/// The second where one is no number.
[[nodiscard]] inline Float8 larger(Float8 a, Float8 b) {
  return _mm256_max_ps(a, b);
}
[[nodiscard]] inline Float8 permuted(Float8 v, Int8 index) {
  return _mm256_permutevar8x32_ps(v, reinterpret_cast<__m256i>(index));
}

/// A bit for each lane that holds.
[[nodiscard]] inline unsigned bits_of(Mask4 mask) {
  return static_cast<unsigned>(_mm256_movemask_pd(reinterpret_cast<__m256d>(mask)));
}
[[nodiscard]] inline unsigned bits_of(Mask8 mask) {
  return static_cast<unsigned>(_mm256_movemask_ps(reinterpret_cast<__m256>(mask)));
}

/// Sum of the lanes by a fixed tree.
[[nodiscard]] inline double lane_sum(Double4 v) {
  return (v[0] + v[1]) + (v[2] + v[3]);
}
[[nodiscard]] inline float lane_sum(Float8 v) {
  const __m128 four = _mm_add_ps(_mm256_castps256_ps128(v), _mm256_extractf128_ps(v, 1));
  const __m128 two = _mm_add_ps(four, _mm_movehl_ps(four, four));
  return _mm_cvtss_f32(_mm_add_ss(two, _mm_shuffle_ps(two, two, 1)));
}
[[nodiscard]] inline float lane_max(Float8 v) {
  const __m128 four = _mm_max_ps(_mm256_castps256_ps128(v), _mm256_extractf128_ps(v, 1));
  const __m128 two = _mm_max_ps(four, _mm_movehl_ps(four, four));
  return _mm_cvtss_f32(_mm_max_ss(two, _mm_shuffle_ps(two, two, 1)));
}

/// a . b, products rounded once: not the bits of dot() in vector.h.
[[nodiscard]] inline __m256 fused_dot(__m256 ax, __m256 ay, __m256 az, __m256 bx, __m256 by, __m256 bz) {
  return _mm256_fmadd_ps(ax, bx, _mm256_fmadd_ps(ay, by, _mm256_mul_ps(az, bz)));
}

/// Row m lists the set bits of m, ascending, one byte each.
[[nodiscard]] constexpr std::array<std::uint64_t, 256> make_compress_table() {
  std::array<std::uint64_t, 256> table{};
  for (unsigned mask = 0; mask < 256; ++mask) {
    unsigned at = 0;
    for (unsigned bit = 0; bit < 8; ++bit)
      if (mask >> bit & 1u) table[mask] |= static_cast<std::uint64_t>(bit) << (8 * at++);
  }
  return table;
}
inline constexpr std::array<std::uint64_t, 256> kCompressLanes = make_compress_table();

/// Permutation that moves the lanes chosen by an 8-bit mask to the front, in order: what narrows an array down, eight numbers at
/// a time, without changing its order.
[[nodiscard]] inline __m256i compress_lanes(unsigned mask) {
  return _mm256_cvtepu8_epi32(_mm_cvtsi64_si128(static_cast<long long>(kCompressLanes[mask])));
}

}  // namespace tessera
