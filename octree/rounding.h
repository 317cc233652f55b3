/// \file rounding.h
/// Directed roundings: what is rounded up stays an upper bound.
#pragma once
#include <cmath>
#include <limits>

namespace tessera {

/// The smallest float that is not below `value`.
inline float rounded_up(double value) {
  const auto f = static_cast<float>(value);
  return static_cast<double>(f) < value ? std::nextafter(f, std::numeric_limits<float>::infinity()) : f;
}

}  // namespace tessera
