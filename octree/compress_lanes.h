/// \file compress_lanes.h
/// The compressing filter that narrows an array down, eight numbers at a time, without changing its order. For .cpp files.
#pragma once
#include <immintrin.h>

#include <array>
#include <cstddef>
#include <cstdint>

namespace tessera {

/// Eight lanes: what one register holds.
inline constexpr std::size_t kLanes = 8;

/// Row m lists the set bits of m, ascending, one byte each.
constexpr std::array<std::uint64_t, 256> make_compress_table() {
  std::array<std::uint64_t, 256> table{};
  for (unsigned mask = 0; mask < 256; ++mask) {
    unsigned at = 0;
    for (unsigned bit = 0; bit < 8; ++bit)
      if (mask >> bit & 1u) table[mask] |= static_cast<std::uint64_t>(bit) << (8 * at++);
  }
  return table;
}
inline constexpr std::array<std::uint64_t, 256> kCompressLanes = make_compress_table();

/// Permutation that moves the lanes chosen by an 8-bit mask to the front, in order.
inline __m256i compress_lanes(unsigned mask) {
  return _mm256_cvtepu8_epi32(_mm_cvtsi64_si128(static_cast<long long>(kCompressLanes[mask])));
}

}  // namespace tessera
