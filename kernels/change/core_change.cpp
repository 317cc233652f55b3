#include "kernels/change/core_change.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace tessera {
namespace {

constexpr double kNone = std::numeric_limits<double>::quiet_NaN();
constexpr double kTwoSided95 = 1.96;  ///< standard deviations within which 95 % of a normal distribution lie

constexpr double kRoundedUp = 1.0 + 1e-9;

struct Ball {
  Double3 middle{};
  double radius = 0.0;
};

Ball ball_around(std::span<const Double3> places) {
  Double3 low = places.front(), high = low;
  for (const Double3& p : places)
    for (std::size_t a = 0; a < 3; ++a) low[a] = std::min(low[a], p[a]), high[a] = std::max(high[a], p[a]);
  return {(low + high) * 0.5, 0.5 * norm(high - low) * kRoundedUp};
}

}  // namespace

double level_of_detection(const AxialPositions& before, const AxialPositions& after,
                          double registration_error) {
  if (before.count < kMinNoisePoints || after.count < kMinNoisePoints) return kNone;
  const auto variance = [](const AxialPositions& a) {
    return a.spread * a.spread / static_cast<double>(a.count);
  };
  return kTwoSided95 * (std::sqrt(variance(before) + variance(after)) + registration_error);
}

void changes_at(const PointCells& before, const PointCells& after, std::span<const Double3> places,
                const ChangeRule& rule, ChangeWork& work, std::span<CoreChange> out) {
  const double ball = 0.5 * rule.normal_scale;
  const Ball group = ball_around(places);
  if (rule.normals.kind != NormalRule::Kind::kVertical)
    work.ball.collect(before, {group.middle, {}, ball + group.radius, 0.0});
  Double3 sum{};
  for (std::size_t i = 0; i < places.size(); ++i) {
    out[i] = {};
    out[i].distance = out[i].uncertainty = kNone;
    const std::optional<Double3> normal = ball_normal(before, work.ball, places[i], ball, rule.normals);
    if (normal) out[i].normal = *normal, sum = sum + *normal;
  }
  // One capsule around all cylinders, where their axes are nearly parallel.
  const Double3 axis = unit_or_zero(sum);
  double spread = 0.0;
  for (const CoreChange& c : out)
    if (c.normal != Double3{}) spread = std::max(spread, norm(c.normal - axis));
  const double radius = 0.5 * rule.projection_scale, sway = rule.max_depth * spread * kRoundedUp;
  const bool together = sway <= radius;
  const auto collect = [&](const Capsule& capsule) {
    work.cylinders[0].collect(before, capsule), work.cylinders[1].collect(after, capsule);
  };
  if (together) collect({group.middle, axis, radius * kRoundedUp + group.radius + sway, rule.max_depth});
  for (std::size_t i = 0; i < places.size(); ++i) {
    CoreChange& c = out[i];
    if (c.normal == Double3{}) continue;
    const Cylinder cylinder = {places[i], c.normal, radius, rule.max_depth};
    if (!together) collect({places[i], c.normal, radius * kRoundedUp, rule.max_depth});
    c.clouds = {axial_positions(before, work.cylinders[0], cylinder, rule.median, work.values),
                axial_positions(after, work.cylinders[1], cylinder, rule.median, work.values)};
    if (c.clouds[0].count == 0 || c.clouds[1].count == 0) continue;
    c.distance = c.clouds[1].mean - c.clouds[0].mean + 0.0;
    c.uncertainty = level_of_detection(c.clouds[0], c.clouds[1], rule.registration_error);
    c.significant = std::abs(c.distance) > c.uncertainty;
  }
}

double change_reach(const ChangeRule& rule) {
  const double radius = 0.5 * rule.projection_scale;
  return std::max(0.5 * rule.normal_scale, std::sqrt(radius * radius + rule.max_depth * rule.max_depth)) *
         (1.0 + 1e-9);
}

double change_cell_size(const ChangeRule& rule) {
  // Measured at the default scales: a quarter of the ball takes two thirds of the time that an eighth takes. A wide ball shall
  // not have too many cells.
  return std::max(std::min(rule.normal_scale / 4.0, rule.projection_scale / 2.0),
                  std::max(rule.normal_scale, rule.projection_scale) / 32.0);
}

}  // namespace tessera
