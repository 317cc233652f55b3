#include "kernels/survey/relief.h"

#include <algorithm>
#include <cmath>

#include "octree/portable_math.h"

namespace tessera {
namespace {

Double3 upward_normal(double gradient_x, double gradient_y) {
  return unit(Double3{-gradient_x, -gradient_y, 1.0});
}

}  // namespace

double slope_degrees(double gradient_x, double gradient_y) {
  return angle_between(upward_normal(gradient_x, gradient_y), {0.0, 0.0, 1.0}) * (180.0 / kPi);
}

Double3 sun_direction(double azimuth, double altitude) {
  const SinCos round = sin_cos(azimuth * (kPi / 180.0)), up = sin_cos(altitude * (kPi / 180.0));
  return {round.sin * up.cos, round.cos * up.cos, up.sin};
}

std::uint8_t hillshade(double gradient_x, double gradient_y, const Double3& sun) {
  const double light = std::max(0.0, dot(upward_normal(gradient_x, gradient_y), sun));
  return static_cast<std::uint8_t>(std::floor(1.5 + 254.0 * std::min(light, 1.0)));
}

}  // namespace tessera
