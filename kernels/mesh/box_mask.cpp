#include "kernels/mesh/box_mask.h"

#include <immintrin.h>

#include <limits>

namespace tessera {

std::vector<std::uint8_t> beyond_sides(std::span<const Double3> points, const Double3& low,
                                       const Double3& high) {
  std::vector<std::uint8_t> sides(points.size());
  if (points.empty()) return sides;
  static_assert(sizeof(Double3) == 3 * sizeof(double));
  constexpr double kFar = std::numeric_limits<double>::infinity();
  const __m256d from = _mm256_setr_pd(low[0], low[1], low[2], -kFar),
                to = _mm256_setr_pd(high[0], high[1], high[2], kFar);
  const auto of = [&](__m256d p) {
    const int below = _mm256_movemask_pd(_mm256_cmp_pd(p, from, _CMP_LT_OQ)),
              above = _mm256_movemask_pd(_mm256_cmp_pd(p, to, _CMP_GT_OQ));
    return static_cast<std::uint8_t>(below | above << 3);
  };
  // Four numbers at once, the fourth of the next point.
  for (std::size_t i = 0; i + 1 < points.size(); ++i) sides[i] = of(_mm256_loadu_pd(points[i].data()));
  const Double3& last = points.back();
  sides.back() = of(_mm256_setr_pd(last[0], last[1], last[2], 0.0));
  return sides;
}

std::vector<std::uint32_t> BoxMask::faces_that_meet(
    std::span<const Double3> points, std::span<const std::array<std::uint32_t, 3>> faces) const {
  // As range() places them; along x, y, z in a byte each.
  const double last = static_cast<double>(cells_) - 0.5;
  const __m256d low = _mm256_setr_pd(low_[0], low_[1], low_[2], 0.0),
                per_cell = _mm256_setr_pd(per_cell_[0], per_cell_[1], per_cell_[2], 0.0),
                most = _mm256_set1_pd(last), least = _mm256_setzero_pd();
  std::vector<std::uint32_t> cell(points.size());
  for (std::size_t i = 0; i < points.size(); ++i) {
    const Double3& p = points[i];
    const __m256d at =
        i + 1 < points.size() ? _mm256_loadu_pd(p.data()) : _mm256_setr_pd(p[0], p[1], p[2], 0.0);
    const __m256d inside =
        _mm256_min_pd(_mm256_max_pd(_mm256_mul_pd(_mm256_sub_pd(at, low), per_cell), least), most);
    const __m128i numbers = _mm256_cvttpd_epi32(inside), shorts = _mm_packus_epi32(numbers, numbers);
    cell[i] = static_cast<std::uint32_t>(_mm_cvtsi128_si32(_mm_packus_epi16(shorts, shorts)));
  }
  std::vector<std::uint32_t> out;
  for (std::uint32_t f = 0; f < faces.size(); ++f) {
    const auto of = [&](std::size_t corner) {
      return _mm_cvtsi32_si128(static_cast<int>(cell[faces[f][corner]]));
    };
    const __m128i a = of(0), b = of(1), c = of(2);
    const auto least_of = static_cast<std::uint32_t>(_mm_cvtsi128_si32(_mm_min_epu8(_mm_min_epu8(a, b), c)));
    const auto most_of = static_cast<std::uint32_t>(_mm_cvtsi128_si32(_mm_max_epu8(_mm_max_epu8(a, b), c)));
    const auto along = [](std::uint32_t numbers, int k) -> std::size_t { return numbers >> 8 * k & 255u; };
    const Range r = {{along(least_of, 0), along(least_of, 1), along(least_of, 2)},
                     {along(most_of, 0), along(most_of, 1), along(most_of, 2)},
                     bits(along(least_of, 0), along(most_of, 0))};
    if (meets(r)) out.push_back(f);
  }
  return out;
}

}  // namespace tessera
