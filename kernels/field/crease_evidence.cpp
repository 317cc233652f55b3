#include "kernels/field/crease_evidence.h"

#include "kernels/field/sample_list.h"
#include "octree/lanes.h"

namespace tessera {
namespace {

/// The mean squared height over the sheets, as a share of that over the smooth fit, that a crease may leave. Noise of
/// half a spacing at the edge of a cube leaves 0.6.
constexpr float kCreaseShare = 0.6f;
/// The same where normals do not tell the sheets apart clearly (Sheets::separation2): estimated ones turn gradually at
/// an edge, and those of a silhouette are no Gaussian cloud.
constexpr float kClearShare = 0.2f;
constexpr float kNoisySeparation2 = 64.0f;
/// Few of the places where noisy normals bend have a crease: so many samples are asked first, every n-th of all.
constexpr std::size_t kQueriedSamples = 64;

/// Eight points.
struct Points {
  __m256 x, y, z;
  Points(const LocalSamples& s, std::size_t i)
      : x(_mm256_loadu_ps(&s.x[i])), y(_mm256_loadu_ps(&s.y[i])), z(_mm256_loadu_ps(&s.z[i])) {}
};

/// Signed distances to first order.
__m256 heights(const Sheet& s, const Points& p) {
  const auto h = [&s](std::size_t i) { return _mm256_set1_ps(s.h[i]); };
  const auto g = [&s](std::size_t i) { return _mm256_set1_ps(s.g[i]); };
  const __m256 hx = fused_dot(h(0), h(1), h(2), p.x, p.y, p.z),
               hy = fused_dot(h(1), h(3), h(4), p.x, p.y, p.z),
               hz = fused_dot(h(2), h(4), h(5), p.x, p.y, p.z);
  const __m256 f = _mm256_add_ps(_mm256_set1_ps(s.f0),
                                 _mm256_fmadd_ps(_mm256_set1_ps(0.5f), fused_dot(p.x, p.y, p.z, hx, hy, hz),
                                                 fused_dot(g(0), g(1), g(2), p.x, p.y, p.z)));
  const __m256 gx = _mm256_add_ps(g(0), hx), gy = _mm256_add_ps(g(1), hy), gz = _mm256_add_ps(g(2), hz);
  const __m256 length2 = _mm256_max_ps(fused_dot(gx, gy, gz, gx, gy, gz), _mm256_set1_ps(1e-12f));
  return _mm256_div_ps(f, _mm256_sqrt_ps(length2));
}

__m256 heights(const Sheets& sheets, const Points& p) {
  __m256 value[kMaxSheets];
  const auto count = static_cast<std::size_t>(sheets.count);
  for (std::size_t k = 0; k < count; ++k) value[k] = heights(sheets.sheet[k], p);
  for (std::size_t j = 0; j + 1 < count; ++j) {
    __m256& a = value[sheets.first[j]];
    const __m256 b = value[sheets.second[j]];
    a = sheets.convex[j] ? _mm256_max_ps(a, b) : _mm256_min_ps(a, b);
  }
  return count > 1 ? value[sheets.first[count - 2]] : value[0];
}

Sheets confirmed(const NormalSeeds& seeds, const SheetOptions& options, const SmoothFit* smooth,
                 LocalSamples& samples) {
  const Sheets found = fit_sheets(samples, seeds, options);
  if (found.count == 0) return found;
  const float maximum = found.separation2 >= kNoisySeparation2 ? kCreaseShare : kClearShare;
  float left = 0.5f * (kCreaseShare + kClearShare);
  if (smooth) {
    const float all = squared_heights(*smooth, samples);
    left = all > 0.0f ? squared_heights(found, samples) / all : 1.0f;
  }
  return left < maximum ? found : Sheets();
}

}  // namespace

float squared_heights(const SmoothFit& fit, const LocalSamples& samples) {
  const __m256 u0 = _mm256_set1_ps(fit.u0), ux = _mm256_set1_ps(fit.u[0]), uy = _mm256_set1_ps(fit.u[1]),
               uz = _mm256_set1_ps(fit.u[2]), twice = _mm256_set1_ps(fit.twice_u4),
               half = _mm256_set1_ps(0.5f * fit.twice_u4);
  __m256 sum = _mm256_setzero_ps();
  for (std::size_t i = 0; i < samples.size; i += kLanes) {
    const Points p(samples, i);
    const __m256 f = _mm256_fmadd_ps(half, fused_dot(p.x, p.y, p.z, p.x, p.y, p.z),
                                     _mm256_add_ps(u0, fused_dot(ux, uy, uz, p.x, p.y, p.z)));
    const __m256 gx = _mm256_fmadd_ps(p.x, twice, ux), gy = _mm256_fmadd_ps(p.y, twice, uy),
                 gz = _mm256_fmadd_ps(p.z, twice, uz);
    const __m256 slope2 = _mm256_max_ps(fused_dot(gx, gy, gz, gx, gy, gz), _mm256_set1_ps(1e-6f));
    sum = _mm256_fmadd_ps(_mm256_loadu_ps(&samples.w[i]), _mm256_div_ps(_mm256_mul_ps(f, f), slope2), sum);
  }
  return lane_sum(sum);
}

float squared_heights(const Sheets& sheets, const LocalSamples& samples) {
  __m256 sum = _mm256_setzero_ps();
  for (std::size_t i = 0; i < samples.size; i += kLanes) {
    const __m256 f = heights(sheets, Points(samples, i));
    sum = _mm256_fmadd_ps(_mm256_loadu_ps(&samples.w[i]), _mm256_mul_ps(f, f), sum);
  }
  return lane_sum(sum);
}

Sheets confirmed_sheets(const NormalSeeds& seeds, const SheetOptions& options, const SmoothFit* smooth,
                        LocalSamples& samples, LocalSamples& requested) {
  const std::size_t step = samples.size / kQueriedSamples + 1;
  if (step > 1) {
    requested.take_every(step, samples);
    if (confirmed(seeds, options, smooth, requested).count == 0) return {};
  }
  return confirmed(seeds, options, smooth, samples);
}

}  // namespace tessera
