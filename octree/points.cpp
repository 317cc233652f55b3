#include "octree/points.h"

#include <cmath>
#include <limits>

namespace tessera {
namespace {

// Codes run over 0..65534 per axis, so 0xffff is never produced and kNoNormal stays free.
constexpr float kScale = 32767.0f;

std::uint32_t to_code(float v) {
  return static_cast<std::uint32_t>(static_cast<std::int32_t>(std::floor(v * kScale + 0.5f)) + 32767);
}
float from_code(std::uint32_t c) {
  return static_cast<float>(static_cast<std::int32_t>(c) - 32767) / kScale;
}

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

// Selects in place of branches, so that the loops run on whole vectors; operation by operation as above.

void encode_normals(const float* nx, const float* ny, const float* nz, std::size_t count,
                    std::uint32_t* codes) {
  for (std::size_t i = 0; i < count; ++i) {
    const float sum = std::fabs(nx[i]) + std::fabs(ny[i]) + std::fabs(nz[i]);
    const bool good = sum > 0.0f && sum <= std::numeric_limits<float>::max();
    const float safe = good ? sum : 1.0f;
    const float u = good ? nx[i] / safe : 0.0f;
    const float v = good ? ny[i] / safe : 0.0f;
    const float fold_u = (1.0f - std::fabs(v)) * (u < 0.0f ? -1.0f : 1.0f);
    const float fold_v = (1.0f - std::fabs(u)) * (v < 0.0f ? -1.0f : 1.0f);
    const bool below = nz[i] < 0.0f;
    const std::uint32_t code = to_code(below ? fold_u : u) | to_code(below ? fold_v : v) << 16;
    codes[i] = good ? code : kNoNormal;
  }
}

void decode_normals(const std::uint32_t* codes, std::size_t count, float* nx, float* ny, float* nz) {
  for (std::size_t i = 0; i < count; ++i) {
    const std::uint32_t code = codes[i];
    const float u = from_code(code & 0xffffu);
    const float v = from_code(code >> 16);
    const float z = 1.0f - std::fabs(u) - std::fabs(v);
    const float fold_u = (1.0f - std::fabs(v)) * (u < 0.0f ? -1.0f : 1.0f);
    const float fold_v = (1.0f - std::fabs(u)) * (v < 0.0f ? -1.0f : 1.0f);
    const float a = z < 0.0f ? fold_u : u;
    const float b = z < 0.0f ? fold_v : v;
    const float norm = std::sqrt(a * a + b * b + z * z);
    const bool none = code == kNoNormal;
    nx[i] = none ? 0.0f : a / norm;
    ny[i] = none ? 0.0f : b / norm;
    nz[i] = none ? 0.0f : z / norm;
  }
}

}  // namespace tessera
