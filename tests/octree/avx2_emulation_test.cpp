// Every emulated function of immintrin.h against the processor's own, bit by bit, with zeros, infinities and what is no number among
// the arguments. The functions of the processor are named before the emulation takes the names.
#include <immintrin.h>

#include <cstdint>
#include <cstring>

namespace avx2_emulation_test::processor {

#define ONE(to, name, a)     \
  inline to name(a x) {      \
    return _mm256_##name(x); \
  }
#define TWO(to, name, a)        \
  inline to name(a x, a y) {    \
    return _mm256_##name(x, y); \
  }
#define THREE(to, name, a)         \
  inline to name(a x, a y, a z) {  \
    return _mm256_##name(x, y, z); \
  }
// clang-format off
#define FLOATS_TWO(USE) \
  USE(__m256, add_ps, __m256) USE(__m256, sub_ps, __m256) USE(__m256, mul_ps, __m256) \
  USE(__m256, div_ps, __m256) USE(__m256, max_ps, __m256) USE(__m256, min_ps, __m256) \
  USE(__m256, and_ps, __m256) USE(__m256, or_ps, __m256) USE(__m256, andnot_ps, __m256) \
  USE(__m256, unpacklo_ps, __m256) USE(__m256, unpackhi_ps, __m256)
#define DOUBLES_TWO(USE) \
  USE(__m256d, add_pd, __m256d) USE(__m256d, sub_pd, __m256d) USE(__m256d, mul_pd, __m256d) \
  USE(__m256d, div_pd, __m256d) USE(__m256d, max_pd, __m256d) USE(__m256d, min_pd, __m256d) \
  USE(__m256d, and_pd, __m256d) USE(__m256d, or_pd, __m256d) USE(__m256d, xor_pd, __m256d) \
  USE(__m256d, andnot_pd, __m256d)
#define WHOLE_TWO(USE) \
  USE(__m256i, add_epi32, __m256i) USE(__m256i, sub_epi32, __m256i) USE(__m256i, cmpeq_epi32, __m256i) \
  USE(__m256i, cmpeq_epi64, __m256i) USE(__m256i, cmpgt_epi32, __m256i) USE(__m256i, cmpgt_epi16, __m256i) \
  USE(__m256i, or_si256, __m256i) USE(__m256i, and_si256, __m256i) USE(__m256i, xor_si256, __m256i) \
  USE(__m256i, sllv_epi32, __m256i)
#define FLOATS_THREE(USE) \
  USE(__m256, fmadd_ps, __m256) USE(__m256, fnmadd_ps, __m256) USE(__m256, fmsub_ps, __m256) \
  USE(__m256, blendv_ps, __m256)
#define DOUBLES_THREE(USE) \
  USE(__m256d, fmadd_pd, __m256d) USE(__m256d, fnmadd_pd, __m256d) USE(__m256d, fmsub_pd, __m256d) \
  USE(__m256d, blendv_pd, __m256d)
#define FLOATS_BY(USE) \
  USE(__m256, cmp_ps, __m256, _CMP_GE_OQ) USE(__m256, cmp_ps, __m256, _CMP_GT_OQ) USE(__m256, cmp_ps, __m256, _CMP_LE_OQ) \
  USE(__m256, cmp_ps, __m256, _CMP_LT_OQ) USE(__m256, cmp_ps, __m256, _CMP_EQ_OQ) USE(__m256, cmp_ps, __m256, _CMP_NEQ_OQ) \
  USE(__m256, cmp_ps, __m256, _CMP_NGE_UQ) USE(__m256, cmp_ps, __m256, _CMP_NLE_UQ) USE(__m256, shuffle_ps, __m256, 0xd8) \
  USE(__m256, shuffle_ps, __m256, 0x44) USE(__m256, permute2f128_ps, __m256, 1) USE(__m256, permute2f128_ps, __m256, 0x20) \
  USE(__m256, permute2f128_ps, __m256, 0x31)
#define DOUBLES_BY(USE) \
  USE(__m256d, cmp_pd, __m256d, _CMP_GE_OQ) USE(__m256d, cmp_pd, __m256d, _CMP_GT_OQ) USE(__m256d, cmp_pd, __m256d, _CMP_LE_OQ) \
  USE(__m256d, cmp_pd, __m256d, _CMP_LT_OQ) USE(__m256d, cmp_pd, __m256d, _CMP_NEQ_OQ) USE(__m256d, cmp_pd, __m256d, _CMP_NGE_UQ) \
  USE(__m256d, blend_pd, __m256d, 8) USE(__m256d, blend_pd, __m256d, 5)
FLOATS_TWO(TWO)
DOUBLES_TWO(TWO)
WHOLE_TWO(TWO)
FLOATS_THREE(THREE)
DOUBLES_THREE(THREE)
ONE(__m256, sqrt_ps, __m256)
ONE(__m256d, sqrt_pd, __m256d)
ONE(int, movemask_ps, __m256)
ONE(int, movemask_pd, __m256d)
ONE(int, movemask_epi8, __m256i)
ONE(__m128, cvtpd_ps, __m256d)
ONE(__m256d, cvtps_pd, __m128)
ONE(__m128i, cvttpd_epi32, __m256d)
ONE(__m256i, cvtepu8_epi32, __m128i)
TWO(int, testz_ps, __m256)
THREE(__m256i, blendv_epi8, __m256i)
// clang-format on

template <int kPredicate>
__m256 cmp_ps(__m256 x, __m256 y) {
  return _mm256_cmp_ps(x, y, kPredicate);
}
template <int kPredicate>
__m256d cmp_pd(__m256d x, __m256d y) {
  return _mm256_cmp_pd(x, y, kPredicate);
}
template <int kControl>
__m256 shuffle_ps(__m256 x, __m256 y) {
  return _mm256_shuffle_ps(x, y, kControl);
}
template <int kControl>
__m256 permute2f128_ps(__m256 x, __m256 y) {
  return _mm256_permute2f128_ps(x, y, kControl);
}
template <int kControl>
__m256d blend_pd(__m256d x, __m256d y) {
  return _mm256_blend_pd(x, y, kControl);
}
inline __m256 permutevar8x32_ps(__m256 x, __m256i i) {
  return _mm256_permutevar8x32_ps(x, i);
}
inline __m256i permutevar8x32_epi32(__m256i x, __m256i i) {
  return _mm256_permutevar8x32_epi32(x, i);
}
inline __m256 maskload_ps(const float* p, __m256i m) {
  return _mm256_maskload_ps(p, m);
}
inline __m256d maskload_pd(const double* p, __m256i m) {
  return _mm256_maskload_pd(p, m);
}
inline void maskstore_pd(double* p, __m256i m, __m256d x) {
  _mm256_maskstore_pd(p, m, x);
}
inline __m256d broadcast_pd(const __m128d* p) {
  return _mm256_broadcast_pd(p);
}
inline __m128 permutevar(__m128 x, __m128i i) {
  return _mm_permutevar_ps(x, i);
}
inline __m128 movehdup(__m128 x) {
  return _mm_movehdup_ps(x);
}
inline __m256 set_m128(__m128 x, __m128 y) {
  return _mm256_set_m128(x, y);
}
inline __m256d set_m128d(__m128d x, __m128d y) {
  return _mm256_set_m128d(x, y);
}
inline __m128i packus_epi32(__m128i x, __m128i y) {
  return _mm_packus_epi32(x, y);
}
inline __m128 extractf128_ps(__m256 x) {
  return _mm256_extractf128_ps(x, 1);
}
inline std::uint64_t crc_u64(std::uint64_t crc, std::uint64_t v) {
  return _mm_crc32_u64(crc, v);
}
inline std::uint32_t crc_u8(std::uint32_t crc, std::uint8_t v) {
  return _mm_crc32_u8(crc, v);
}
inline __m256i whole_numbers(int a) {
  return _mm256_setr_epi32(a, 1, -2, 3, 4, 5, 6, 7);
}
inline __m256d set_pd(double a) {
  return _mm256_set_pd(a, 2.0, 3.0, 4.0);
}

}  // namespace avx2_emulation_test::processor

#include "octree/avx2_emulation.h"

#include <catch2/catch.hpp>

#include <limits>

#include "tests/helpers/random.h"

namespace avx2_emulation_test {

namespace {

using tessera::test::Random;

template <class T>
bool same(const T& a, const T& b) {
  return std::memcmp(&a, &b, sizeof a) == 0;
}

template <class V, class T, int kLanes>
V any(Random& random) {
  const T special[] = {T{0},
                       -T{0},
                       T{1},
                       T{-1},
                       std::numeric_limits<T>::infinity(),
                       -std::numeric_limits<T>::infinity(),
                       std::numeric_limits<T>::quiet_NaN(),
                       std::numeric_limits<T>::denorm_min()};
  V v;
  for (int i = 0; i < kLanes; ++i)
    v[i] = random.below(4) == 0 ? special[random.below(8)] : static_cast<T>(random.in(-1000, 1000));
  return v;
}
__m256 floats(Random& random) {
  return any<__m256, float, 8>(random);
}
__m256d doubles(Random& random) {
  return any<__m256d, double, 4>(random);
}
__m256i whole(Random& random) {
  __m256i v;
  for (int i = 0; i < 4; ++i)
    v[i] = static_cast<long long>(random.below(3) == 0 ? random.below(3)
                                                       : random.bits() * 0x9e3779b97f4a7c15ULL);
  return v;
}

}  // namespace

#define SAME_TWO(to, name, a) CHECK(same<to>(_mm256_##name(x, y), processor::name(x, y)));
#define SAME_THREE(to, name, a) CHECK(same<to>(_mm256_##name(x, y, z), processor::name(x, y, z)));
#define SAME_BY(to, name, a, k) CHECK(same<to>(_mm256_##name(x, y, k), processor::name<k>(x, y)));

TEST_CASE("emulation: floats, doubles and whole numbers have the bits of the processor", "[unit]") {
  Random random(7);
  for (int round = 0; round < 200; ++round) {
    {
      const __m256 x = floats(random), y = floats(random), z = floats(random);
      FLOATS_TWO(SAME_TWO)
      FLOATS_BY(SAME_BY)
      FLOATS_THREE(SAME_THREE)
      CHECK(same<__m256>(_mm256_sqrt_ps(x), processor::sqrt_ps(x)));
      CHECK(_mm256_movemask_ps(x) == processor::movemask_ps(x));
      CHECK(_mm256_testz_ps(x, y) == processor::testz_ps(x, y));
      const __m128 low = _mm256_castps256_ps128(x), high = _mm256_extractf128_ps(x, 1);
      CHECK(same<__m128>(high, processor::extractf128_ps(x)));
      CHECK(same<__m256>(_mm256_set_m128(low, high), processor::set_m128(low, high)));
      CHECK(same<__m256d>(_mm256_cvtps_pd(low), processor::cvtps_pd(low)));
      CHECK(same<__m128>(_mm_movehdup_ps(low), processor::movehdup(low)));
      const __m256i i = whole(random);
      CHECK(same<__m256>(_mm256_permutevar8x32_ps(x, i), processor::permutevar8x32_ps(x, i)));
      CHECK(same<__m256i>(_mm256_permutevar8x32_epi32(_mm256_castps_si256(x), i),
                          processor::permutevar8x32_epi32(_mm256_castps_si256(x), i)));
      CHECK(same<__m128>(_mm_permutevar_ps(low, _mm256_castsi256_si128(i)),
                         processor::permutevar(low, _mm256_castsi256_si128(i))));
      float numbers[8];
      _mm256_storeu_ps(numbers, x);
      CHECK(same<__m256>(_mm256_maskload_ps(numbers, i), processor::maskload_ps(numbers, i)));
    }
    {
      const __m256d x = doubles(random), y = doubles(random), z = doubles(random);
      DOUBLES_TWO(SAME_TWO)
      DOUBLES_BY(SAME_BY)
      DOUBLES_THREE(SAME_THREE)
      CHECK(same<__m256d>(_mm256_sqrt_pd(x), processor::sqrt_pd(x)));
      CHECK(_mm256_movemask_pd(x) == processor::movemask_pd(x));
      CHECK(same<__m128>(_mm256_cvtpd_ps(x), processor::cvtpd_ps(x)));
      CHECK(same<__m128i>(_mm256_cvttpd_epi32(x), processor::cvttpd_epi32(x)));
      double numbers[4];
      _mm256_storeu_pd(numbers, x);
      const __m256i i = whole(random);
      CHECK(same<__m256d>(_mm256_maskload_pd(numbers, i), processor::maskload_pd(numbers, i)));
      double stored[4], by_processor[4];
      _mm256_storeu_pd(stored, y), _mm256_storeu_pd(by_processor, y);
      _mm256_maskstore_pd(stored, i, x), processor::maskstore_pd(by_processor, i, x);
      CHECK(std::memcmp(stored, by_processor, sizeof stored) == 0);
      const __m128d low = _mm_loadu_pd(numbers), high = _mm_loadu_pd(numbers + 2);
      CHECK(same<__m256d>(_mm256_set_m128d(low, high), processor::set_m128d(low, high)));
      CHECK(same<__m256d>(_mm256_broadcast_pd(&high), processor::broadcast_pd(&high)));
      CHECK(same<__m256d>(_mm256_set_pd(x[0], 2.0, 3.0, 4.0), processor::set_pd(x[0])));
    }
    {
      const __m256i x = whole(random), y = whole(random), z = whole(random);
      WHOLE_TWO(SAME_TWO)
      const __m256i counts = _mm256_and_si256(y, _mm256_set1_epi32(63));  // too far every other time
      CHECK(same<__m256i>(_mm256_sllv_epi32(x, counts), processor::sllv_epi32(x, counts)));
      const __m128i ints = _mm256_castsi256_si128(x);
      const __m128i small = _mm_srai_epi32(ints, 14);  // a quarter of them fit
      CHECK(same<__m128i>(_mm_packus_epi32(ints, small), processor::packus_epi32(ints, small)));
      CHECK(same<__m256i>(_mm256_blendv_epi8(x, y, z), processor::blendv_epi8(x, y, z)));
      CHECK(_mm256_movemask_epi8(x) == processor::movemask_epi8(x));
      CHECK(same<__m256i>(_mm256_cvtepu8_epi32(_mm256_castsi256_si128(x)),
                          processor::cvtepu8_epi32(_mm256_castsi256_si128(x))));
      CHECK(same<__m256i>(_mm256_setr_epi32(round, 1, -2, 3, 4, 5, 6, 7), processor::whole_numbers(round)));
      const auto crc = static_cast<std::uint32_t>(x[0]);
      CHECK(_mm_crc32_u64(crc, static_cast<std::uint64_t>(y[0])) ==
            processor::crc_u64(crc, static_cast<std::uint64_t>(y[0])));
      CHECK(_mm_crc32_u8(crc, static_cast<std::uint8_t>(y[1])) ==
            processor::crc_u8(crc, static_cast<std::uint8_t>(y[1])));
    }
  }
}

}  // namespace avx2_emulation_test
