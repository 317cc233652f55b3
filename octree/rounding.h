/// \file rounding.h
/// Directed roundings: what is rounded up stays an upper bound.
#pragma once
#include <cmath>
#include <limits>

namespace tessera {

/// The smallest float that is not below `value`.
[[nodiscard]] inline float rounded_up(double value) {
  const auto f = static_cast<float>(value);
  return static_cast<double>(f) < value ? std::nextafter(f, std::numeric_limits<float>::infinity()) : f;
}

/// The largest bound that stays within a limit when `added` is added to it and the sum is rounded up; at least 0.
[[nodiscard]] inline double bound_within(double limit, double added) {
  auto f = static_cast<float>(limit - added);
  while (f > 0.0f && static_cast<double>(rounded_up(static_cast<double>(f) + added)) > limit)
    f = std::nextafter(f, 0.0f);
  return f > 0.0f ? static_cast<double>(f) : 0.0;
}

}  // namespace tessera
