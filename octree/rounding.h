/// \file rounding.h
/// Directed roundings: what is rounded up stays an upper bound.
#pragma once
#include <algorithm>
#include <bit>
#include <cmath>
#include <cstdint>
#include <limits>

namespace tessera {

/// The smallest float that is not below `value`.
inline float rounded_up(double value) {
  const auto f = static_cast<float>(value);
  return static_cast<double>(f) < value ? std::nextafter(f, std::numeric_limits<float>::infinity()) : f;
}

/// A half float from its bits.
inline float half_value(std::uint16_t bits) {
  return std::bit_cast<float>(std::uint32_t{bits} << 13) * 0x1p112f;
}
/// Bits of the smallest half float that is not below `value`, of the largest at most. \pre value >= 0
inline std::uint16_t half_rounded_up(float value) {
  if (!(value > 0.0f)) return 0;
  // Scaled by 2^-112 the exponent fields agree; normal and denormal halfs alike.
  const auto bits = std::bit_cast<std::uint32_t>(value * 0x1p-112f);
  std::uint32_t half = bits >> 13;
  while (half < 0x7bffu && half_value(static_cast<std::uint16_t>(half)) < value) ++half;
  return static_cast<std::uint16_t>(std::min(half, 0x7bffu));
}

}  // namespace tessera
