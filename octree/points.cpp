#include "octree/points.h"

#include <cmath>

namespace tessera {
namespace {

// Codes run over 0..65534 per axis, so 0xffff is never produced and kNoNormal stays free.
constexpr float kScale = 32767.0f;

std::uint32_t to_code(float v) {
  return static_cast<std::uint32_t>(static_cast<std::int32_t>(std::floor(v * kScale + 0.5f)) + 32767);
}
float from_code(std::uint32_t c) { return static_cast<float>(static_cast<std::int32_t>(c) - 32767) / kScale; }

}  // namespace

std::uint32_t encode_normal(float x, float y, float z) {
  const float sum = std::fabs(x) + std::fabs(y) + std::fabs(z);
  if (!(sum > 0.0f) || !std::isfinite(sum)) return kNoNormal;
  float u = x / sum;
  float v = y / sum;
  if (z < 0.0f) {
    const float fold_u = (1.0f - std::fabs(v)) * (u < 0.0f ? -1.0f : 1.0f);
    v = (1.0f - std::fabs(u)) * (v < 0.0f ? -1.0f : 1.0f);
    u = fold_u;
  }
  return to_code(u) | to_code(v) << 16;
}

Float3 decode_normal(std::uint32_t code) {
  if (code == kNoNormal) return {0.0f, 0.0f, 0.0f};
  float u = from_code(code & 0xffffu);
  float v = from_code(code >> 16);
  const float z = 1.0f - std::fabs(u) - std::fabs(v);
  if (z < 0.0f) {
    const float fold_u = (1.0f - std::fabs(v)) * (u < 0.0f ? -1.0f : 1.0f);
    v = (1.0f - std::fabs(u)) * (v < 0.0f ? -1.0f : 1.0f);
    u = fold_u;
  }
  const float norm = std::sqrt(u * u + v * v + z * z);
  return {u / norm, v / norm, z / norm};
}

}  // namespace tessera
