/// \file avx2_emulation.h
/// What Tessera takes of AVX2, FMA and SSE4.2, for processors without: every function of immintrin.h that is named here gives way to
/// one of plain vectors, with the same bits. The compiler reads it before every file where TESSERA_PORTABLE is on
/// (CMakeLists.txt); nobody includes it but its test, which holds each function against the processor's own.
#pragma once
#include <immintrin.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstring>

namespace tessera::emulated {

using V8f [[gnu::vector_size(32)]] = float;
using V4d [[gnu::vector_size(32)]] = double;
using V8i [[gnu::vector_size(32)]] = std::int32_t;
using V8u [[gnu::vector_size(32)]] = std::uint32_t;
using V4l [[gnu::vector_size(32)]] = std::int64_t;
using V16s [[gnu::vector_size(32)]] = std::int16_t;
using V32c [[gnu::vector_size(32)]] = std::int8_t;

// Values pass by reference: without AVX, how 256 bits are handed over is nobody's agreement.
#define TESSERA_EMULATED [[gnu::always_inline]] inline

template <class To, class From>
TESSERA_EMULATED To bits(const From& from) {
  static_assert(sizeof(To) == sizeof(From));
  To to;
  std::memcpy(&to, &from, sizeof to);
  return to;
}
template <class To, class From>
TESSERA_EMULATED To loaded(const From* from) {
  To to;
  std::memcpy(&to, from, sizeof to);
  return to;
}

TESSERA_EMULATED __m256 fma_ps(const __m256& a, const __m256& b, const __m256& c, float product, float sum) {
  __m256 r{};
  for (int i = 0; i < 8; ++i) r[i] = std::fma(product * a[i], b[i], sum * c[i]);
  return r;
}
TESSERA_EMULATED __m256d fma_pd(const __m256d& a, const __m256d& b, const __m256d& c, double product,
                                double sum) {
  __m256d r{};
  for (int i = 0; i < 4; ++i) r[i] = std::fma(product * a[i], b[i], sum * c[i]);
  return r;
}
template <class V, class I>
TESSERA_EMULATED V compared(const V& a, const V& b, int predicate) {
  I mask;
  switch (predicate) {
    case _CMP_GE_OQ:
      mask = a >= b;
      break;
    case _CMP_GT_OQ:
      mask = a > b;
      break;
    case _CMP_LE_OQ:
      mask = a <= b;
      break;
    case _CMP_LT_OQ:
      mask = a < b;
      break;
    case _CMP_EQ_OQ:
      mask = a == b;
      break;
    case _CMP_NEQ_OQ:
      mask = (a < b) | (a > b);
      break;
    case _CMP_NGE_UQ:
      mask = ~(a >= b);
      break;
    case _CMP_NLE_UQ:
      mask = ~(a <= b);
      break;
    default:
      __builtin_trap();
  }
  return bits<V>(mask);
}
template <class V, class I>
TESSERA_EMULATED V both(const V& a, const V& b) {
  return bits<V>(bits<I>(a) & bits<I>(b));
}
template <class V, class I>
TESSERA_EMULATED V either(const V& a, const V& b) {
  return bits<V>(bits<I>(a) | bits<I>(b));
}
template <class V, class I>
TESSERA_EMULATED V differing(const V& a, const V& b) {
  return bits<V>(bits<I>(a) ^ bits<I>(b));
}
template <class V, class I>
TESSERA_EMULATED V without(const V& a, const V& b) {
  return bits<V>(~bits<I>(a) & bits<I>(b));
}
template <class V>
TESSERA_EMULATED V larger_of(const V& a, const V& b) {
  return a > b ? a : b;
}
template <class V>
TESSERA_EMULATED V smaller_of(const V& a, const V& b) {
  return a < b ? a : b;
}
template <class V, class I>
TESSERA_EMULATED V blended(const V& a, const V& b, const V& mask) {
  return bits<I>(mask) < 0 ? b : a;
}
template <class I, int kLanes, class V>
TESSERA_EMULATED int signs(const V& a) {
  const I v = bits<I>(a);
  int mask = 0;
  for (int i = 0; i < kLanes; ++i) mask |= (v[i] < 0) << i;
  return mask;
}
template <class V, int kLanes>
TESSERA_EMULATED V roots(const V& a) {
  V r{};
  for (int i = 0; i < kLanes; ++i) r[i] = std::sqrt(a[i]);
  return r;
}
template <class V, class I, int kLanes, class T>
TESSERA_EMULATED V masked(const T* from, const __m256i& mask) {
  const I m = bits<I>(mask);
  V r = {};
  for (int i = 0; i < kLanes; ++i)
    if (m[i] < 0) r[i] = from[i];
  return r;
}
template <class I, int kLanes, class T, class V>
TESSERA_EMULATED void store_masked(T* to, const __m256i& mask, const V& v) {
  const I m = bits<I>(mask);
  for (int i = 0; i < kLanes; ++i)
    if (m[i] < 0) to[i] = v[i];
}
TESSERA_EMULATED __m256 permuted_ps(const __m256& a, const __m256i& index) {
  const V8i at = bits<V8i>(index);
  __m256 r{};
  for (int i = 0; i < 8; ++i) r[i] = a[at[i] & 7];
  return r;
}
TESSERA_EMULATED __m128 permuted_4(const __m128& a, const __m128i& index) {
  std::int32_t at[4];
  std::memcpy(at, &index, sizeof at);
  __m128 r{};
  for (int i = 0; i < 4; ++i) r[i] = a[at[i] & 3];
  return r;
}
TESSERA_EMULATED __m256i bytes_as_ints(const __m128i& bytes) {
  std::uint8_t b[16];
  std::memcpy(b, &bytes, sizeof b);
  V8i r{};
  for (int i = 0; i < 8; ++i) r[i] = b[i];
  return bits<__m256i>(r);
}
TESSERA_EMULATED __m256 halves(const __m128& high, const __m128& low) {
  __m256 r{};
  for (int i = 0; i < 4; ++i) r[i] = low[i], r[i + 4] = high[i];
  return r;
}
TESSERA_EMULATED __m256d halves_pd(const __m128d& high, const __m128d& low) {
  return __m256d{low[0], low[1], high[0], high[1]};
}
TESSERA_EMULATED __m128 half(const __m256& a, int which) {
  __m128 r{};
  for (int i = 0; i < 4; ++i) r[i] = a[4 * which + i];
  return r;
}
TESSERA_EMULATED __m128i half_i(const __m256i& a, int which) {
  return __m128i{a[2 * which], a[2 * which + 1]};
}
TESSERA_EMULATED __m256 two_halves(const __m256& a, const __m256& b, int control) {
  __m256 r{};
  for (int side = 0; side < 2; ++side) {
    const int c = control >> 4 * side & 15;
    for (int i = 0; i < 4; ++i)
      r[4 * side + i] = (c & 8) != 0 ? 0.0f : (c & 2) != 0 ? b[4 * (c & 1) + i] : a[4 * (c & 1) + i];
  }
  return r;
}
TESSERA_EMULATED __m256 shuffled(const __m256& a, const __m256& b, int control) {
  __m256 r{};
  for (int side = 0; side < 8; side += 4)
    for (int i = 0; i < 4; ++i) {
      const int from = side + (control >> 2 * i & 3);
      r[side + i] =
          i < 2 ? a[from] : b[from];  // not (i < 2 ? a : b)[from]: GCC 12 reads the wrong one under ASan
    }
  return r;
}
TESSERA_EMULATED __m256 unpacked(const __m256& a, const __m256& b, int first) {
  __m256 r{};
  for (int side = 0; side < 8; side += 4)
    for (int i = 0; i < 2; ++i)
      r[side + 2 * i] = a[side + first + i], r[side + 2 * i + 1] = b[side + first + i];
  return r;
}
TESSERA_EMULATED __m256d blended_by(const __m256d& a, const __m256d& b, int mask) {
  __m256d r{};
  for (int i = 0; i < 4; ++i) r[i] = (mask >> i & 1) != 0 ? b[i] : a[i];
  return r;
}
TESSERA_EMULATED __m128 narrowed(const __m256d& a) {
  __m128 r{};
  for (int i = 0; i < 4; ++i) r[i] = static_cast<float>(a[i]);
  return r;
}
TESSERA_EMULATED __m256d widened(const __m128& a) {
  __m256d r{};
  for (int i = 0; i < 4; ++i) r[i] = static_cast<double>(a[i]);
  return r;
}
TESSERA_EMULATED __m128i truncated(const __m256d& a) {
  return _mm_unpacklo_epi64(_mm_cvttpd_epi32(_mm_set_pd(a[1], a[0])),
                            _mm_cvttpd_epi32(_mm_set_pd(a[3], a[2])));
}
TESSERA_EMULATED __m128i clamped_to_u16(const __m128i& a, const __m128i& b) {
  std::int32_t from[8];
  std::memcpy(from, &a, sizeof a);
  std::memcpy(from + 4, &b, sizeof b);
  std::uint16_t to[8];
  for (int i = 0; i < 8; ++i) to[i] = static_cast<std::uint16_t>(std::clamp(from[i], 0, 0xffff));
  return loaded<__m128i>(to);
}
TESSERA_EMULATED std::uint32_t crc32c(std::uint32_t crc, std::uint64_t value, int bytes) {
  for (int bit = 0; bit < 8 * bytes; ++bit, value >>= 1)
    crc = (crc >> 1) ^ (((crc ^ static_cast<std::uint32_t>(value)) & 1u) != 0 ? 0x82f63b78u : 0u);
  return crc;
}

TESSERA_EMULATED __m256 all_ps(float x) {
  return __m256{x, x, x, x, x, x, x, x};
}
TESSERA_EMULATED __m256d all_pd(double x) {
  return __m256d{x, x, x, x};
}
TESSERA_EMULATED __m256i all_i32(std::int32_t x) {
  return bits<__m256i>(V8i{x, x, x, x, x, x, x, x});
}
TESSERA_EMULATED __m256i all_i64(std::int64_t x) {
  return __m256i{x, x, x, x};
}
TESSERA_EMULATED __m256i all_i16(std::int16_t x) {
  return bits<__m256i>(V16s{x, x, x, x, x, x, x, x, x, x, x, x, x, x, x, x});
}
TESSERA_EMULATED __m256d twice(const __m128d* from) {
  const __m128d half = loaded<__m128d>(from);
  return halves_pd(half, half);
}
template <class V, class T>
TESSERA_EMULATED void store(T* to, const V& v) {
  std::memcpy(to, &v, sizeof v);
}
enum class WholeOp { kAdd, kSubtract, kEqual, kGreater };
template <class I, WholeOp kOp>
TESSERA_EMULATED __m256i whole(const __m256i& a, const __m256i& b) {
  const I x = bits<I>(a), y = bits<I>(b);
  if constexpr (kOp == WholeOp::kAdd) return bits<__m256i>(x + y);
  if constexpr (kOp == WholeOp::kSubtract) return bits<__m256i>(x - y);
  if constexpr (kOp == WholeOp::kEqual) return bits<__m256i>(x == y);
  if constexpr (kOp == WholeOp::kGreater) return bits<__m256i>(x > y);
}
TESSERA_EMULATED __m256i shifted_up(const __m256i& a, const __m256i& counts) {
  const V8u x = bits<V8u>(a), n = bits<V8u>(counts);
  V8u r{};
  for (int i = 0; i < 8; ++i) r[i] = n[i] < 32 ? x[i] << n[i] : 0;
  return bits<__m256i>(r);
}

}  // namespace tessera::emulated

// Names are those of immintrin.h: what reads this reads no other meaning of them.
#define TESSERA_V tessera::emulated
#define _mm256_add_ps(a, b) (__m256)((a) + (b))
#define _mm256_sub_ps(a, b) (__m256)((a) - (b))
#define _mm256_mul_ps(a, b) (__m256)((a) * (b))
#define _mm256_div_ps(a, b) (__m256)((a) / (b))
#define _mm256_add_pd(a, b) (__m256d)((a) + (b))
#define _mm256_sub_pd(a, b) (__m256d)((a) - (b))
#define _mm256_mul_pd(a, b) (__m256d)((a) * (b))
#define _mm256_div_pd(a, b) (__m256d)((a) / (b))
#define _mm256_fmadd_ps(a, b, c) TESSERA_V::fma_ps(a, b, c, 1.0f, 1.0f)
#define _mm256_fnmadd_ps(a, b, c) TESSERA_V::fma_ps(a, b, c, -1.0f, 1.0f)
#define _mm256_fmsub_ps(a, b, c) TESSERA_V::fma_ps(a, b, c, 1.0f, -1.0f)
#define _mm256_fmadd_pd(a, b, c) TESSERA_V::fma_pd(a, b, c, 1.0, 1.0)
#define _mm256_fnmadd_pd(a, b, c) TESSERA_V::fma_pd(a, b, c, -1.0, 1.0)
#define _mm256_fmsub_pd(a, b, c) TESSERA_V::fma_pd(a, b, c, 1.0, -1.0)
#define _mm256_sqrt_ps(a) (TESSERA_V::roots<__m256, 8>(a))
#define _mm256_sqrt_pd(a) (TESSERA_V::roots<__m256d, 4>(a))
#define _mm256_max_ps(a, b) TESSERA_V::larger_of<__m256>(a, b)
#define _mm256_min_ps(a, b) TESSERA_V::smaller_of<__m256>(a, b)
#define _mm256_max_pd(a, b) TESSERA_V::larger_of<__m256d>(a, b)
#define _mm256_min_pd(a, b) TESSERA_V::smaller_of<__m256d>(a, b)
#define _mm256_cmp_ps(a, b, p) (TESSERA_V::compared<__m256, TESSERA_V::V8i>(a, b, p))
#define _mm256_cmp_pd(a, b, p) (TESSERA_V::compared<__m256d, TESSERA_V::V4l>(a, b, p))
#define _mm256_and_ps(a, b) (TESSERA_V::both<__m256, TESSERA_V::V8i>(a, b))
#define _mm256_or_ps(a, b) (TESSERA_V::either<__m256, TESSERA_V::V8i>(a, b))
#define _mm256_andnot_ps(a, b) (TESSERA_V::without<__m256, TESSERA_V::V8i>(a, b))
#define _mm256_and_pd(a, b) (TESSERA_V::both<__m256d, TESSERA_V::V4l>(a, b))
#define _mm256_or_pd(a, b) (TESSERA_V::either<__m256d, TESSERA_V::V4l>(a, b))
#define _mm256_xor_pd(a, b) (TESSERA_V::differing<__m256d, TESSERA_V::V4l>(a, b))
#define _mm256_andnot_pd(a, b) (TESSERA_V::without<__m256d, TESSERA_V::V4l>(a, b))
#define _mm256_or_si256(a, b) (TESSERA_V::either<__m256i, TESSERA_V::V4l>(a, b))
#define _mm256_and_si256(a, b) (TESSERA_V::both<__m256i, TESSERA_V::V4l>(a, b))
#define _mm256_xor_si256(a, b) (TESSERA_V::differing<__m256i, TESSERA_V::V4l>(a, b))
#define _mm256_blendv_ps(a, b, m) (TESSERA_V::blended<__m256, TESSERA_V::V8i>(a, b, m))
#define _mm256_blendv_pd(a, b, m) (TESSERA_V::blended<__m256d, TESSERA_V::V4l>(a, b, m))
#define _mm256_blendv_epi8(a, b, m)                                               \
  (TESSERA_V::bits<__m256i>(TESSERA_V::blended<TESSERA_V::V32c, TESSERA_V::V32c>( \
      TESSERA_V::bits<TESSERA_V::V32c>(a), TESSERA_V::bits<TESSERA_V::V32c>(b),   \
      TESSERA_V::bits<TESSERA_V::V32c>(m))))
#define _mm256_blend_pd(a, b, m) TESSERA_V::blended_by(a, b, m)
#define _mm256_movemask_ps(a) (TESSERA_V::signs<TESSERA_V::V8i, 8>(a))
#define _mm256_movemask_pd(a) (TESSERA_V::signs<TESSERA_V::V4l, 4>(a))
#define _mm256_movemask_epi8(a) (TESSERA_V::signs<TESSERA_V::V32c, 32>(a))
#define _mm256_testz_ps(a, b) \
  ((TESSERA_V::signs<TESSERA_V::V8i, 8>(a) & TESSERA_V::signs<TESSERA_V::V8i, 8>(b)) == 0)
#define _mm256_set1_ps(x) TESSERA_V::all_ps(x)
#define _mm256_set1_pd(x) TESSERA_V::all_pd(x)
#define _mm256_set1_epi32(x) TESSERA_V::all_i32(x)
#define _mm256_set1_epi64x(x) TESSERA_V::all_i64(x)
#define _mm256_set1_epi16(x) TESSERA_V::all_i16(x)
#define _mm256_broadcast_ss(p) TESSERA_V::all_ps(*(p))
#define _mm256_broadcast_sd(p) TESSERA_V::all_pd(*(p))
#define _mm256_broadcast_pd(p) TESSERA_V::twice(p)
#define _mm256_broadcastss_ps(a) TESSERA_V::all_ps((a)[0])
#define _mm256_setzero_ps() (__m256{})
#define _mm256_setzero_pd() (__m256d{})
#define _mm256_setzero_si256() (__m256i{})
#define _mm256_setr_ps(a, b, c, d, e, f, g, h) (__m256{a, b, c, d, e, f, g, h})
#define _mm256_setr_pd(a, b, c, d) (__m256d{a, b, c, d})
#define _mm256_set_pd(a, b, c, d) (__m256d{d, c, b, a})
#define _mm256_setr_epi32(a, b, c, d, e, f, g, h) \
  (TESSERA_V::bits<__m256i>(TESSERA_V::V8i{a, b, c, d, e, f, g, h}))
#define _mm256_setr_epi64x(a, b, c, d) (__m256i{a, b, c, d})
#define _mm256_set_epi64x(a, b, c, d) (__m256i{d, c, b, a})
#define _mm256_set_m128(high, low) TESSERA_V::halves(high, low)
#define _mm256_set_m128d(high, low) TESSERA_V::halves_pd(high, low)
#define _mm256_load_ps(p) (TESSERA_V::loaded<__m256>(p))
#define _mm256_loadu_ps(p) (TESSERA_V::loaded<__m256>(p))
#define _mm256_load_pd(p) (TESSERA_V::loaded<__m256d>(p))
#define _mm256_loadu_pd(p) (TESSERA_V::loaded<__m256d>(p))
#define _mm256_load_si256(p) (TESSERA_V::loaded<__m256i>(p))
#define _mm256_loadu_si256(p) (TESSERA_V::loaded<__m256i>(p))
#define _mm256_store_ps(p, a) TESSERA_V::store<__m256>(p, a)
#define _mm256_storeu_ps(p, a) TESSERA_V::store<__m256>(p, a)
#define _mm256_store_pd(p, a) TESSERA_V::store<__m256d>(p, a)
#define _mm256_storeu_pd(p, a) TESSERA_V::store<__m256d>(p, a)
#define _mm256_store_si256(p, a) TESSERA_V::store<__m256i>(p, a)
#define _mm256_storeu_si256(p, a) TESSERA_V::store<__m256i>(p, a)
#define _mm256_maskload_ps(p, m) (TESSERA_V::masked<__m256, TESSERA_V::V8i, 8>(p, m))
#define _mm256_maskload_pd(p, m) (TESSERA_V::masked<__m256d, TESSERA_V::V4l, 4>(p, m))
#define _mm256_maskstore_pd(p, m, a) (TESSERA_V::store_masked<TESSERA_V::V4l, 4>(p, m, a))
#define _mm256_castps_si256(a) (TESSERA_V::bits<__m256i>((__m256)(a)))
#define _mm256_castsi256_ps(a) (TESSERA_V::bits<__m256>((__m256i)(a)))
#define _mm256_castsi256_pd(a) (TESSERA_V::bits<__m256d>((__m256i)(a)))
#define _mm256_castps256_ps128(a) TESSERA_V::half(a, 0)
#define _mm256_castsi256_si128(a) TESSERA_V::half_i(a, 0)
#define _mm256_extractf128_ps(a, k) TESSERA_V::half(a, k)
#define _mm256_extracti128_si256(a, k) TESSERA_V::half_i(a, k)
#define _mm256_permute2f128_ps(a, b, c) TESSERA_V::two_halves(a, b, c)
#define _mm256_permutevar8x32_ps(a, i) TESSERA_V::permuted_ps(a, i)
#define _mm256_permutevar8x32_epi32(a, i) \
  (TESSERA_V::bits<__m256i>(TESSERA_V::permuted_ps(TESSERA_V::bits<__m256>((__m256i)(a)), i)))
#define _mm256_shuffle_ps(a, b, c) TESSERA_V::shuffled(a, b, c)
#define _mm256_unpacklo_ps(a, b) TESSERA_V::unpacked(a, b, 0)
#define _mm256_unpackhi_ps(a, b) TESSERA_V::unpacked(a, b, 2)
#define _mm256_cvtpd_ps(a) TESSERA_V::narrowed(a)
#define _mm256_cvtps_pd(a) TESSERA_V::widened(a)
#define _mm256_cvttpd_epi32(a) TESSERA_V::truncated(a)
#define _mm256_cvtepu8_epi32(a) TESSERA_V::bytes_as_ints(a)
#define _mm256_add_epi32(a, b) (TESSERA_V::whole<TESSERA_V::V8u, TESSERA_V::WholeOp::kAdd>(a, b))
#define _mm256_sub_epi32(a, b) (TESSERA_V::whole<TESSERA_V::V8u, TESSERA_V::WholeOp::kSubtract>(a, b))
#define _mm256_cmpeq_epi32(a, b) (TESSERA_V::whole<TESSERA_V::V8i, TESSERA_V::WholeOp::kEqual>(a, b))
#define _mm256_cmpeq_epi64(a, b) (TESSERA_V::whole<TESSERA_V::V4l, TESSERA_V::WholeOp::kEqual>(a, b))
#define _mm256_cmpgt_epi32(a, b) (TESSERA_V::whole<TESSERA_V::V8i, TESSERA_V::WholeOp::kGreater>(a, b))
#define _mm256_cmpgt_epi16(a, b) (TESSERA_V::whole<TESSERA_V::V16s, TESSERA_V::WholeOp::kGreater>(a, b))
#define _mm256_sllv_epi32(a, n) TESSERA_V::shifted_up(a, n)
#define _mm_movehdup_ps(a) _mm_shuffle_ps(a, a, _MM_SHUFFLE(3, 3, 1, 1))
#define _mm_permutevar_ps(a, i) TESSERA_V::permuted_4(a, i)
#define _mm_packus_epi32(a, b) TESSERA_V::clamped_to_u16(a, b)
#define _mm_crc32_u8(crc, v) TESSERA_V::crc32c(static_cast<std::uint32_t>(crc), v, 1)
#define _mm_crc32_u64(crc, v) (std::uint64_t{TESSERA_V::crc32c(static_cast<std::uint32_t>(crc), v, 8)})
