#include "octree/compress_lanes.h"

#include <bit>
#include <catch2/catch.hpp>

namespace compress_lanes_test {

using namespace tessera;

TEST_CASE("compress lanes: every mask moves its lanes to the front, in order", "[unit]") {
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

}  // namespace compress_lanes_test
