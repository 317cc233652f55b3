#include "kernels/field/rim_rule.h"

#include <cmath>
#include <cstdint>

namespace tessera {
namespace {

constexpr float kTan22 = 0.41421356f;  ///< of half of 45 degrees
constexpr float kAlike = 0.5f;         ///< cosine of 60 degrees
constexpr int kMaxEmpty = 6;           ///< sectors of 22.5 degrees in a row

/// Sector of 22.5 degrees, 0 to 15 around the circle.
unsigned sector(float x, float y) {
  const float ax = std::abs(x), ay = std::abs(y);
  unsigned s = 0;  // within the first quadrant
  if (ay >= ax) {
    s = ax < kTan22 * ay ? 3 : 2;
  } else {
    s = ay < kTan22 * ax ? 0 : 1;
  }
  if (x >= 0.0f) return y >= 0.0f ? s : 15 - s;
  return y >= 0.0f ? 7 - s : 8 + s;
}

}  // namespace

bool is_surrounded(const LocalSamples& samples, float value, const Float3& gradient, float thickness,
                   float within) {
  const auto& [gx, gy, gz] = gradient;
  // The foot point lies on the gradient through the node, so tangents through the node do.
  // Tangents: of the axis that is farthest from the gradient, and across.
  const float ax = std::abs(gx), ay = std::abs(gy), az = std::abs(gz);
  Float3 u = {0.0f, -gz, gy};
  if (ay < ax && ay <= az) u = {gz, 0.0f, -gx};
  if (az < ax && az < ay) u = {-gy, gx, 0.0f};
  const Float3 v = {gy * u[2] - gz * u[1], gz * u[0] - gx * u[2], gx * u[1] - gy * u[0]};
  std::uint32_t seen = 0;
  bool near = false;
  for (std::size_t i = 0; i < samples.size; ++i) {
    if (samples.nx[i] * gx + samples.ny[i] * gy + samples.nz[i] * gz < kAlike) continue;
    const float x = samples.x[i], y = samples.y[i], z = samples.z[i];
    if (std::abs(value + x * gx + y * gy + z * gz) > thickness) continue;
    const float dx = x + value * gx, dy = y + value * gy, dz = z + value * gz;
    near = near || dx * dx + dy * dy + dz * dz <= within * within;
    seen |= 1u << sector(x * u[0] + y * u[1] + z * u[2], x * v[0] + y * v[1] + z * v[2]);
  }
  if (!near) return false;
  // Twice around, so that a gap over sector 0 is whole.
  const std::uint32_t twice = seen | seen << 16;
  std::uint32_t gap = ~twice;
  for (int k = 1; k < kMaxEmpty; ++k) gap &= ~twice >> k;
  return (gap & 0xffff) == 0;
}

}  // namespace tessera
