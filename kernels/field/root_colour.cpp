#include "kernels/field/root_colour.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>

#include "kernels/field/sample_list.h"

namespace tessera {
namespace {

constexpr float kColourRadius = 1.5f;
constexpr float kFarColour = 7.5f;  ///< less than a leaf

/// Mean colour within the radius of p; 0 if there is none.
std::uint32_t mean_colour(const PointBlock& points, const SampleList& samples, const Float3& p,
                          float radius) {
  const float r2 = radius * radius, inverse_r2 = 1.0f / r2;
  const __m256 px = _mm256_set1_ps(p[0]), py = _mm256_set1_ps(p[1]), pz = _mm256_set1_ps(p[2]);
  alignas(32) std::array<float, kLanes> distance2;
  float weight = 0.0f;
  std::array<float, 3> sum = {0, 0, 0};
  for (std::size_t i = 0; i < samples.size; i += kLanes) {
    const __m256 x = _mm256_sub_ps(_mm256_loadu_ps(&samples.x[i]), px);
    const __m256 y = _mm256_sub_ps(_mm256_loadu_ps(&samples.y[i]), py);
    const __m256 z = _mm256_sub_ps(_mm256_loadu_ps(&samples.z[i]), pz);
    const __m256 d2 = _mm256_fmadd_ps(x, x, _mm256_fmadd_ps(y, y, _mm256_mul_ps(z, z)));
    auto mask = static_cast<unsigned>(_mm256_movemask_ps(_mm256_cmp_ps(d2, _mm256_set1_ps(r2), _CMP_LT_OQ)));
    if (samples.size - i < kLanes) mask &= (1u << (samples.size - i)) - 1u;
    if (!mask) continue;
    _mm256_store_ps(distance2.data(), d2);
    for (; mask; mask &= mask - 1) {
      const auto lane = static_cast<std::size_t>(std::countr_zero(mask));
      const std::uint32_t rgba = points.rgba[samples.point[i + lane]];
      if (rgba >> 24 == 0) continue;
      const float t = 1.0f - distance2[lane] * inverse_r2, w = t * t;
      weight += w;
      for (std::size_t c = 0; c < 3; ++c) sum[c] += w * static_cast<float>(rgba >> (8 * c) & 0xff);
    }
  }
  if (!(weight > 0.0f)) return 0;
  std::uint32_t out = 0xff000000u;
  for (std::size_t c = 0; c < 3; ++c)
    out |= static_cast<std::uint32_t>(std::clamp(std::floor(sum[c] / weight + 0.5f), 0.0f, 255.0f))
           << (8 * c);
  return out;
}

/// The samples strictly within a box, in their order: place and point alone.
void take_within(const SampleList& from, const SampleBox& box, SampleList& out) {
  out.reserve(from.size);
  const auto inside = [](__m256 v, float low, float high) {
    return _mm256_and_ps(_mm256_cmp_ps(v, _mm256_set1_ps(low), _CMP_GT_OQ),
                         _mm256_cmp_ps(v, _mm256_set1_ps(high), _CMP_LT_OQ));
  };
  std::size_t size = 0;
  for (std::size_t i = 0; i < from.size; i += kLanes) {
    const __m256 x = _mm256_loadu_ps(&from.x[i]), y = _mm256_loadu_ps(&from.y[i]),
                 z = _mm256_loadu_ps(&from.z[i]);
    auto mask = static_cast<unsigned>(_mm256_movemask_ps(
        _mm256_and_ps(_mm256_and_ps(inside(x, box.low[0], box.high[0]), inside(y, box.low[1], box.high[1])),
                      inside(z, box.low[2], box.high[2]))));
    if (from.size - i < kLanes) mask &= (1u << (from.size - i)) - 1u;
    if (!mask) continue;
    const __m256i front = compress_lanes(mask);
    const auto store = [&](std::vector<float>& to, __m256 v) {
      _mm256_storeu_ps(to.data() + size, _mm256_permutevar8x32_ps(v, front));
    };
    store(out.x, x);
    store(out.y, y);
    store(out.z, z);
    const __m256i point = _mm256_loadu_si256(reinterpret_cast<const __m256i*>(&from.point[i]));
    _mm256_storeu_si256(reinterpret_cast<__m256i*>(out.point.data() + size),
                        _mm256_permutevar8x32_epi32(point, front));
    size += static_cast<std::size_t>(std::popcount(mask));
  }
  out.size = size;
}

}  // namespace

void colour_roots(const PointBlock& points, const PointLeaves& leaves, float radius, bool with_volumetric,
                  bool far, DirectedField& field) {
  SampleList samples, slab, row;
  for (const BandLeaf& leaf : field.leaves) {
    std::uint64_t any = 0;
    for (const auto& axis : leaf.crossing)
      for (const std::uint64_t word : axis) any |= word;
    if (!any) continue;
    // Fixed box, whatever the block: roots lie in [0, 8).
    const float margin = far ? kFarColour : std::max(radius, kColourRadius), low = -margin,
                high = 8.0f + margin;
    const auto gather = with_volumetric ? gather_all : gather_samples;
    gather(points, leaves, leaf.origin[0] >> kLeafBits, leaf.origin[1] >> kLeafBits,
           leaf.origin[2] >> kLeafBits, {{low, low, low}, {high, high, high}}, samples);
    for (std::size_t z = 0; z < 8; ++z) {
      if ((leaf.crossing[0][z] | leaf.crossing[1][z] | leaf.crossing[2][z]) == 0) continue;
      // Roots of these edges lie up to a cell farther along any axis.
      constexpr float kReach = kColourRadius + 0.01f, kEnd = 8.0f + kReach;
      const auto below = static_cast<float>(z) - kReach, above = static_cast<float>(z) + 1.0f + kReach;
      take_within(samples, {{-kReach, -kReach, below}, {kEnd, kEnd, above}}, slab);
      std::array<std::uint32_t, 3> next = {leaf.first_root[0][z], leaf.first_root[1][z],
                                           leaf.first_root[2][z]};
      for (int y = 0; y < 8; ++y) {
        const auto edges = [&](std::size_t axis) {
          return static_cast<unsigned>(leaf.crossing[axis][z] >> (8 * y) & 0xff);
        };
        if ((edges(0) | edges(1) | edges(2)) == 0) continue;
        const auto at = static_cast<float>(y);
        take_within(slab, {{-kReach, at - kReach, below}, {kEnd, at + 1.0f + kReach, above}}, row);
        for (std::size_t axis = 0; axis < 3; ++axis)
          for (unsigned left = edges(axis); left; left &= left - 1) {
            EdgeRoot& root = field.roots[next[axis]++];
            Float3 p = {static_cast<float>(std::countr_zero(left)), at, static_cast<float>(z)};
            p[axis] += root.t;
            root.rgba = mean_colour(points, row, p, kColourRadius);
            if (root.rgba == 0) root.rgba = mean_colour(points, samples, p, radius);
            if (root.rgba == 0 && far) root.rgba = mean_colour(points, samples, p, kFarColour);
          }
      }
    }
  }
}

}  // namespace tessera
