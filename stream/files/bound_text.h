/// \file bound_text.h
/// Bounds that people read.
#pragma once
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <string>

namespace tessera {

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

}  // namespace tessera
