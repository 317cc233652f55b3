#include "octree/lanes.h"

#include <bit>
#include <catch2/catch.hpp>
#include <cmath>

namespace lanes_test {

using namespace tessera;

TEST_CASE("lanes: every mask moves its lanes to the front, in order", "[unit]") {
  const __m256i lane = _mm256_setr_epi32(10, 11, 12, 13, 14, 15, 16, 17);
  for (unsigned mask = 0; mask < 256; ++mask) {
    std::array<std::int32_t, kLanes> got;
    _mm256_storeu_si256(reinterpret_cast<__m256i*>(got.data()),
                        _mm256_permutevar8x32_epi32(lane, compress_lanes(mask)));
    std::size_t at = 0;
    for (int bit = 0; bit < 8; ++bit)
      if (mask >> bit & 1u) CHECK(got[at++] == 10 + bit);
    CHECK(at == static_cast<std::size_t>(std::popcount(mask)));
  }
}

TEST_CASE("lanes: vectors of lanes have the bits of vectors one after the other", "[unit]") {
  const Double3 a[4] = {{0.1, 0.2, 0.3}, {1e9, 1e-9, 7}, {-3, 0.7, 1e300}, {-0.0, 0, 5}};
  const Double3 b[4] = {{0.7, -0.2, 1.3}, {3, 1e9, 7e-7}, {0.3, 0.7, 1e-300}, {1, 2, 3}};
  Double4x3 left, right;
  for (std::size_t k = 0; k < 3; ++k)
    for (std::size_t l = 0; l < 4; ++l) left[k][l] = a[l][k], right[k][l] = b[l][k];
  const Double4 product = dot(left, right), root = square_root(dot(right, right));
  const Double4x3 normal = cross(left, right), sum = (left + right) * 0.3 - right;
  for (std::size_t l = 0; l < 4; ++l) {
    CHECK(product[l] == dot(a[l], b[l]));
    CHECK(root[l] == norm(b[l]));
    const Double3 one = cross(a[l], b[l]), total = (a[l] + b[l]) * 0.3 - b[l];
    for (std::size_t k = 0; k < 3; ++k) {
      CHECK(normal[k][l] == one[k]);
      CHECK(sum[k][l] == total[k]);
    }
  }
}

TEST_CASE("lanes: bits, sums, largest and permuted ones", "[unit]") {
  const Float8 v = {3, -1, 4, 1, -5, 9, 2, 6};
  CHECK(bits_of(v > 2.0f) == 0b10100101u);
  CHECK(bits_of(Double4{1, 2, 3, 4} > 2.5) == 0b1100u);
  CHECK(lane_sum(v) == 19.0f);
  CHECK(lane_sum(Double4{1, 2, 3, 4}) == 10.0);
  CHECK(lane_max(v) == 9.0f);
  CHECK(lane_max(absolute(-v)) == 9.0f);
  CHECK(permuted(v, 7 - kLaneNumbers)[0] == 6.0f);
  CHECK(larger(v, Float8{})[4] == 0.0f);
  double four[4];
  store4(four, load4(std::array<double, 4>{1, 2, 3, 4}.data()) * 2.0);
  CHECK(four[3] == 8.0);
  CHECK(fused(Double4{} + 0.1, Double4{} + 10.0, Double4{} - 1.0)[2] == std::fma(0.1, 10.0, -1.0));
}

}  // namespace lanes_test
