/// \file numbers.h
/// Numbers that people read.
#pragma once
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <string>

namespace tessera {

/// Six significant digits, as messages show a length.
inline std::string number_text(double value) {
  char text[40];
  std::snprintf(text, sizeof text, "%.6g", value);
  return text;
}

/// So many significant digits of an upper bound, never below it: what is shown is proven too.
inline std::string bound_text(double value, int digits = 4) {
  char text[40];
  std::snprintf(text, sizeof text, "%.*g", digits, value);
  if (!std::isfinite(value) || !(value > 0.0)) return text;
  double up = value, step = 0.5;
  for (int d = 0; d < digits; ++d) step /= 10.0;  // half of the last digit at most, a twentieth at least
  while (std::strtod(text, nullptr) < value) {
    up *= 1.0 + step;
    std::snprintf(text, sizeof text, "%.*g", digits, up);
  }
  return text;
}

/// Smallest number of two decimal digits that is not below `value` > 0, so that a resolution reads well.
inline double round_up_2_digits(double value) {
  double scale = 1.0;  // a power of ten, exact up to 10^22
  while (value * scale < 10.0) scale *= 10.0;
  if (scale > 1.0) return std::ceil(value * scale) / scale;
  while (value / scale >= 100.0) scale *= 10.0;
  return std::ceil(value / scale) * scale;
}

/// 1, 2, 5, 10, 20, 50, ...: the first of these by which `count` >= 0 things make no more than `max` > 0 groups.
inline std::int64_t round_stride(std::int64_t count, std::int64_t max) {
  for (std::int64_t power = 1;; power *= 10)
    for (const std::int64_t step : {1, 2, 5})
      if (count <= max * step * power) return step * power;
}

}  // namespace tessera
