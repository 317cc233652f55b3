/// \file morton.h
/// Morton (Z-order) codes: bits ...zyxzyx, x lowest. A parent's code is a prefix of its children's, so
/// ascending order is also depth-first order of the octree.
#pragma once
#include <array>
#include <cstdint>

namespace tessera {

/// Spreads the low 21 bits of `v` so that two zero bits follow each.
[[nodiscard]] constexpr std::uint64_t morton_spread(std::uint64_t v) {
  v &= 0x1fffff;
  v = (v | v << 32) & 0x1f00000000ffffULL;
  v = (v | v << 16) & 0x1f0000ff0000ffULL;
  v = (v | v << 8) & 0x100f00f00f00f00fULL;
  v = (v | v << 4) & 0x10c30c30c30c30c3ULL;
  v = (v | v << 2) & 0x1249249249249249ULL;
  return v;
}

/// Inverse of morton_spread.
[[nodiscard]] constexpr std::uint32_t morton_compact(std::uint64_t v) {
  v &= 0x1249249249249249ULL;
  v = (v ^ v >> 2) & 0x10c30c30c30c30c3ULL;
  v = (v ^ v >> 4) & 0x100f00f00f00f00fULL;
  v = (v ^ v >> 8) & 0x1f0000ff0000ffULL;
  v = (v ^ v >> 16) & 0x1f00000000ffffULL;
  v = (v ^ v >> 32) & 0x1fffff;
  return static_cast<std::uint32_t>(v);
}

/// Code of (i, j, k); each coordinate < 2^21.
[[nodiscard]] constexpr std::uint64_t morton_encode(std::uint32_t i, std::uint32_t j, std::uint32_t k) {
  return morton_spread(i) | morton_spread(j) << 1 | morton_spread(k) << 2;
}

[[nodiscard]] constexpr std::array<std::uint32_t, 3> morton_decode(std::uint64_t code) {
  return {morton_compact(code), morton_compact(code >> 1), morton_compact(code >> 2)};
}

}  // namespace tessera
