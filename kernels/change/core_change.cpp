#include "kernels/change/core_change.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace tessera {
namespace {

constexpr double kNone = std::numeric_limits<double>::quiet_NaN();
constexpr double kTwoSided95 = 1.96;  ///< standard deviations within which 95 % of a normal distribution lie

}  // namespace

double level_of_detection(const AxialPositions& before, const AxialPositions& after,
                          double registration_error) {
  if (before.count < kMinNoisePoints || after.count < kMinNoisePoints) return kNone;
  const auto variance = [](const AxialPositions& a) {
    return a.spread * a.spread / static_cast<double>(a.count);
  };
  return kTwoSided95 * (std::sqrt(variance(before) + variance(after)) + registration_error);
}

CoreChange change_at(const PointCells& before, const PointCells& after, const Double3& p,
                     const ChangeRule& rule, std::vector<double>& work) {
  CoreChange out;
  out.distance = out.uncertainty = kNone;
  const std::optional<Double3> normal = ball_normal(before, p, 0.5 * rule.normal_scale, rule.normals);
  if (!normal) return out;
  out.normal = *normal;
  const Cylinder cylinder = {p, *normal, 0.5 * rule.projection_scale, rule.max_depth};
  out.clouds = {axial_positions(before, cylinder, rule.median, work),
                axial_positions(after, cylinder, rule.median, work)};
  if (out.clouds[0].count == 0 || out.clouds[1].count == 0) return out;
  out.distance = out.clouds[1].mean - out.clouds[0].mean + 0.0;
  out.uncertainty = level_of_detection(out.clouds[0], out.clouds[1], rule.registration_error);
  out.significant = std::abs(out.distance) > out.uncertainty;
  return out;
}

double change_reach(const ChangeRule& rule) {
  const double radius = 0.5 * rule.projection_scale;
  return std::max(0.5 * rule.normal_scale, std::sqrt(radius * radius + rule.max_depth * rule.max_depth)) *
         (1.0 + 1e-9);
}

double change_cell_size(const ChangeRule& rule) {
  // Measured: an eighth of the ball is best at the default scales. A wide ball shall not have too many cells.
  return std::max(std::min(rule.normal_scale / 8.0, rule.projection_scale / 4.0),
                  std::max(rule.normal_scale, rule.projection_scale) / 64.0);
}

}  // namespace tessera
