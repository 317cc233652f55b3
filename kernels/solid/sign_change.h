/// \file sign_change.h
/// Where an implicit surface cuts an edge.
#pragma once
#include <algorithm>
#include <cmath>

namespace tessera {

/// Where along [0, 1] a value changes its sign: regula falsi that halves the value of an end which stays, and halves the
/// interval where that is slow.
/// \param starts_inside  whether value(0) counts as negative; value(1) then counts as the other
/// \param width  of the interval that is left: its far side is the result
/// \param enough  the first place whose value is nearer to zero than this is the result; 0 = none
template <class Value>
double find_sign_change(bool starts_inside, double width, double enough, const Value& value) {
  constexpr int kMaxSteps = 60;
  double low = 0.0, high = 1.0, at_low = value(0.0), at_high = value(1.0);
  int side = 0;
  for (int step = 0; step < kMaxSteps && high - low > width; ++step) {
    const double difference = at_high - at_low;
    double t =
        step % 4 == 3 || difference == 0.0 ? 0.5 * (low + high) : low - at_low * (high - low) / difference;
    // Never on an end: then the interval shrinks from both.
    t = std::clamp(t, low + 0.5 * width, high - 0.5 * width);
    const double v = value(t);
    if ((v < 0.0) == starts_inside) {
      low = t, at_low = v;
      if (side == -1) at_high *= 0.5;
      side = -1;
    } else {
      high = t, at_high = v;
      if (side == 1) at_low *= 0.5;
      side = 1;
    }
    if (std::fabs(v) < enough) return t;
  }
  return high;
}

}  // namespace tessera
