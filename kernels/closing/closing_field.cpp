#include "kernels/closing/closing_field.h"

#include <algorithm>
#include <cassert>
#include <cmath>
#include <vector>

#include "octree/vector.h"

namespace tessera {
namespace {

/// Misfit from which the quadric begins to lose weight, and at which it has none: of exact samples, and of noisy ones,
/// whose bent normals swing it into pockets.
constexpr float kGoodMisfit = 0.35f, kBadMisfit = 0.7f;
constexpr float kGoodNoisyMisfit = 0.01f, kBadNoisyMisfit = 0.04f;
/// Distance of the winding number from its level from which it begins to overrule the quadric, and does.
constexpr float kDoubtful = 0.36f, kCertain = 0.48f;

/// 1 below low, 0 above high.
float fade(float v, float low, float high) {
  const float t = std::clamp((high - v) / (high - low), 0.0f, 1.0f);
  return t * t * (3.0f - 2.0f * t);
}

}  // namespace

void ClosingField::evaluate(std::span<const Int3> queries, float level, std::span<float> value) const {
  assert(value.size() == queries.size());
  std::vector<float> winding(queries.size());
  std::vector<Float3> gradient(queries.size());
  winding_.evaluate(queries, winding, gradient);
  std::vector<QuadricValue> quadric(queries.size());
  quadric_.evaluate(queries, quadric);
  const float good = kGoodMisfit + noisy_ * (kGoodNoisyMisfit - kGoodMisfit);
  const float bad = kBadMisfit + noisy_ * (kBadNoisyMisfit - kBadMisfit);
  for (std::size_t i = 0; i < queries.size(); ++i) {
    const Float3& g = gradient[i];
    const float slope = norm(g);
    const float off = level - winding[i];
    // Clamped before it is divided: a flat field has no distance.
    const float size = std::abs(off) < kFarthest * slope ? std::abs(off) / slope : kFarthest;
    const float by_winding = off < 0.0f ? -size : size;
    const float by_quadric = std::clamp(quadric[i].distance, -kFarthest, kFarthest);
    float trust = fade(quadric[i].misfit, good, bad);
    if ((by_quadric < 0.0f) != (by_winding < 0.0f)) trust *= fade(std::abs(off), kDoubtful, kCertain);
    value[i] = trust * by_quadric + (1.0f - trust) * by_winding;
  }
}

}  // namespace tessera
