/// \file rounding.h
/// Directed roundings: what is rounded up stays an upper bound.
#pragma once
#include <bit>
#include <cmath>
#include <cstdint>
#include <limits>

namespace tessera {

/// The smallest float that is not below `value`.
[[nodiscard]] inline float rounded_up(double value) {
  const auto f = static_cast<float>(value);
  if (!(static_cast<double>(f) < value)) return f;
  // The next one: std::nextafter() is a call, and this is asked for every face.
  return std::bit_cast<float>(std::bit_cast<std::int32_t>(f) + (f < 0.0f ? -1 : 1));
}

/// The largest bound that stays within a limit when `added` is added to it and the sum is rounded up; at least 0.
[[nodiscard]] inline double bound_within(double limit, double added) {
  auto f = static_cast<float>(limit - added);
  while (f > 0.0f && static_cast<double>(rounded_up(static_cast<double>(f) + added)) > limit)
    f = std::nextafter(f, 0.0f);
  return f > 0.0f ? static_cast<double>(f) : 0.0;
}

}  // namespace tessera
