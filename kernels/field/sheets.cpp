#include "kernels/field/sheets.h"

#include <algorithm>
#include <cmath>

#include "octree/vector.h"

namespace tessera {
namespace {

/// Product with a symmetric matrix (xx, xy, xz, yy, yz, zz).
Float3 times(const std::array<float, 6>& m, const Float3& v) {
  return {m[0] * v[0] + m[1] * v[1] + m[2] * v[2], m[1] * v[0] + m[3] * v[1] + m[4] * v[2],
          m[2] * v[0] + m[4] * v[1] + m[5] * v[2]};
}

/// A cluster's quadric and how well it explains the normals.
struct Fit {
  Sheet sheet;
  Float3 centroid{}, mean_normal{};
  std::array<float, 6> spread{};    ///< covariance of the positions
  float normal_residual = 0.0f;     ///< mean squared
  float height_variance = 0.0f;     ///< along the mean normal
  float curvature_variance = 0.0f;  ///< of it, what the curvature explains at most
};

/// A few clusters, no allocation.
struct Clusters {
  std::array<Moments, kMaxSheets> moments;
  std::array<Fit, kMaxSheets> fit;
  std::size_t count = 0;
  void add(const Moments& m);
  void erase(std::size_t k) {
    for (std::size_t i = k + 1; i < count; ++i) {
      moments[i - 1] = moments[i];
      fit[i - 1] = fit[i];
    }
    --count;
  }
};

/// Ridge that keeps the curvature of a narrow strip of samples bounded, cells^2.
constexpr float kCurvatureRidge = 0.02f;

/// Quadric through the centroid along the mean normal; its curvature is the linear map of tangential offsets
/// to tangential normal changes, in least squares over symmetric maps.
Fit fit_quadric(const Moments& m) {
  Fit fit;
  const float inverse = 1.0f / m.w();
  fit.centroid = m.p() * inverse;
  fit.mean_normal = unit_or_zero(m.n());
  const Float3& c = fit.centroid;
  const Float3& n = fit.mean_normal;
  // Tangent frame: the axis least along the normal makes it well-conditioned.
  const std::size_t axis = std::abs(n[0]) <= std::abs(n[1]) ? (std::abs(n[0]) <= std::abs(n[2]) ? 0 : 2)
                                                            : (std::abs(n[1]) <= std::abs(n[2]) ? 1 : 2);
  Float3 t1 = n * -n[axis];
  t1[axis] += 1.0f;
  t1 = unit_or_zero(t1);
  const Float3 t2 = cross(n, t1);
  const Float3 mean = m.n() * inverse;
  std::array<float, 6> pp;  // covariance of positions
  constexpr std::array<std::array<std::size_t, 2>, 6> kPair = {
      {{0, 0}, {0, 1}, {0, 2}, {1, 1}, {1, 2}, {2, 2}}};
  for (std::size_t i = 0; i < 6; ++i) pp[i] = m.s[7 + i] * inverse - c[kPair[i][0]] * c[kPair[i][1]];
  std::array<Float3, 3> np;  // covariance of normals (row) with positions (column)
  for (std::size_t i = 0; i < 3; ++i)
    for (std::size_t j = 0; j < 3; ++j) np[i][j] = m.s[13 + 3 * i + j] * inverse - mean[i] * c[j];
  const Float3 p1 = times(pp, t1), p2 = times(pp, t2);
  const float m11 = dot(t1, p1) + kCurvatureRidge, m12 = dot(t1, p2), m22 = dot(t2, p2) + kCurvatureRidge;
  const auto through = [&](const Float3& a, const Float3& b) {
    return a[0] * dot(np[0], b) + a[1] * dot(np[1], b) + a[2] * dot(np[2], b);
  };
  const float b11 = through(t1, t1), b12 = 0.5f * (through(t1, t2) + through(t2, t1)), b22 = through(t2, t2);
  // S M + M S = B + B^T for the symmetric 2 x 2 matrix S:
  //   s11 m11 + s12 m12 = b11,  s11 m12 + s12 (m11 + m22) + s22 m12 = 2 b12,  s12 m12 + s22 m22 = b22
  const float k = m11 + m22 - m12 * m12 / m11 - m12 * m12 / m22;
  const float s12 = k > 1e-9f ? (2.0f * b12 - m12 * b11 / m11 - m12 * b22 / m22) / k : 0.0f;
  const float s11 = (b11 - s12 * m12) / m11, s22 = (b22 - s12 * m12) / m22;
  for (std::size_t i = 0; i < 6; ++i) {
    const std::size_t a = kPair[i][0], b = kPair[i][1];
    fit.sheet.h[i] = s11 * t1[a] * t1[b] + s12 * (t1[a] * t2[b] + t2[a] * t1[b]) + s22 * t2[a] * t2[b];
  }
  // Mean of the quadric over the samples is zero.
  const Float3 hc = times(fit.sheet.h, c);
  const float quadratic =
      0.5f * (s11 * (m11 - kCurvatureRidge) + 2.0f * s12 * m12 + s22 * (m22 - kCurvatureRidge));
  fit.sheet.g = n - hc;
  fit.sheet.f0 = 0.5f * dot(c, hc) - dot(n, c) - quadratic;
  const float variance = 1.0f - dot(mean, mean);
  const float explained =
      2.0f * (s11 * b11 + 2.0f * s12 * b12 + s22 * b22) -
      ((s11 * s11 + s12 * s12) * m11 + 2.0f * s12 * (s11 + s22) * m12 + (s12 * s12 + s22 * s22) * m22);
  fit.spread = pp;
  fit.height_variance = dot(n, times(pp, n));
  fit.curvature_variance = s11 * s11 * m11 * m11 + 2.0f * s12 * s12 * m11 * m22 + s22 * s22 * m22 * m22;
  fit.normal_residual = std::max(0.0f, variance - explained);
  return fit;
}

void Clusters::add(const Moments& m) {
  moments[count] = m;
  fit[count++] = fit_quadric(m);
}

Float3 gradient_at(const Sheet& s, const Float3& p) {
  const Float3 hp = times(s.h, p);
  return s.g + hp;
}

/// Sheets farther apart than their spread: the squared chord between their normals must exceed the mean
/// squared residual of the normals by this factor. Halving one Gaussian cloud of normals gives 2, an even
/// bend without curvature fit 12.
constexpr float kSeparation2 = 16.0f;
constexpr float kMaxSeparation2 = 1e6f;  ///< of a single sheet
/// Least share of the weight and least samples of a sheet; less cannot carry one and is left out of the
/// others.
constexpr float kMinShare = 0.03f;
constexpr int kMinSheetHits = 3;
constexpr float kMinHitShare = 0.1f;
/// A face is sampled about as densely as the one beside it; a few flying points with a common normal are not.
/// Samples per squared spread, relative to the densest sheet.
constexpr float kMinDensity = 0.3f;
/// Largest height variance of a sheet as a share of its whole spread: samples with false normals lie on a
/// surface that their normals do not fit.
constexpr float kLargestHeightShare = 0.12f;
/// Two faces that meet lie on one side of each other, at least one way: the squared mean height of one above
/// the other, over its variance. Half a disc at an edge has 2, two mixed sets of samples 0.
constexpr float kOneSided = 0.5f;
/// Largest share of the weight that may be left out: sheets that explain less than the rest are spikes at the
/// silhouettes of single scans, where the smooth fit is the better one.
constexpr float kLargestLoss = 0.2f;

/// Cosine of the angle between two sheets where they meet (half-way between their samples), or 1 if noise
/// explains the difference. \param separation2  becomes the least of itself and the pair's
float joint_cosine(const Fit& a, const Fit& b, float* separation2 = nullptr) {
  const Float3 middle = (a.centroid + b.centroid) * 0.5f;
  const Float3 na = unit_or_zero(gradient_at(a.sheet, middle)),
               nb = unit_or_zero(gradient_at(b.sheet, middle));
  const float cosine = dot(na, nb);
  const float residual = 0.5f * (a.normal_residual + b.normal_residual);
  const float chord2 = 2.0f - 2.0f * cosine;
  if (separation2) *separation2 = std::min(*separation2, chord2 / std::max(residual, 1e-6f));
  return chord2 < kSeparation2 * residual ? 1.0f : cosine;
}

/// Joins what one smooth sheet explains, closest pair first. Where one is left, it has neither moments nor fit.
/// \param cluster_of  per label: its cluster, kept up to date
void join_smooth(Clusters& clusters, float cos_feature, std::array<std::int32_t, kMaxSheets>& cluster_of) {
  while (clusters.count > 1) {
    float best = cos_feature;
    std::size_t best_a = 0, best_b = 0;
    for (std::size_t a = 0; a < clusters.count; ++a)
      for (std::size_t b = a + 1; b < clusters.count; ++b) {
        const float cosine = joint_cosine(clusters.fit[a], clusters.fit[b]);
        if (cosine <= best) continue;
        const Moments both = merged(clusters.moments[a], clusters.moments[b]);
        if (dot(both.n(), both.n()) < 0.25f * both.w() * both.w()) continue;  // half a tube is not one sheet
        best = cosine;
        best_a = a;
        best_b = b;
      }
    if (best_b == 0) return;
    if (clusters.count == 2) {  // one is left, which nobody asks for its fit
      clusters.count = 1;
      return;
    }
    clusters.moments[best_a] = merged(clusters.moments[best_a], clusters.moments[best_b]);
    clusters.fit[best_a] = fit_quadric(clusters.moments[best_a]);
    clusters.erase(best_b);
    for (std::int32_t& c : cluster_of) {
      if (c == static_cast<std::int32_t>(best_b)) c = static_cast<std::int32_t>(best_a);
      if (c > static_cast<std::int32_t>(best_b)) --c;
    }
  }
}

/// Height variance along the normal, beyond what curvature and noise explain, from which two layers are
/// tried, cells^2; and the least gap between them, cells.
constexpr float kLayerVariance = 0.04f;
constexpr float kMinGap = 0.5f;

/// Beside a crease, parallel layers (the treads of a step) share one normal: takes them apart.
void separate_layers(LocalSamples& samples, const std::array<std::int32_t, kMaxSheets>& cluster_of,
                     const SheetOptions& options, Clusters& clusters) {
  bool relabelled = false;
  for (std::size_t k = 0; k < clusters.count && clusters.count < kMaxSheets; ++k) {
    const Fit& fit = clusters.fit[k];
    if (fit.height_variance < kLayerVariance + 4.0f * options.noise * options.noise + fit.curvature_variance)
      continue;
    if (!relabelled) relabel(samples, cluster_of);
    relabelled = true;
    const auto label = static_cast<std::int32_t>(k), upper = static_cast<std::int32_t>(clusters.count);
    if (!split_layers(samples, label, upper, fit.centroid, fit.mean_normal, kMinGap + 4.0f * options.noise))
      continue;
    clusters.moments[k] = sum_moments(samples, label);
    clusters.fit[k] = fit_quadric(clusters.moments[k]);
    clusters.add(sum_moments(samples, upper));
  }
}

/// Orders the joints: repeatedly joins two sheets that relate alike to all others. A relation that cannot be
/// written so loses its lightest sheet first.
void order_joints(Clusters& clusters, Sheets& out) {
  for (;;) {
    const std::size_t n = clusters.count;
    const auto& fits = clusters.fit;
    std::array<std::array<bool, kMaxSheets>, kMaxSheets> convex{};
    for (std::size_t a = 0; a < n; ++a)
      for (std::size_t b = 0; b < n; ++b) {
        const Float3 d = fits[b].centroid - fits[a].centroid;
        convex[a][b] = dot(fits[a].mean_normal, d) - dot(fits[b].mean_normal, d) < 0.0f;
      }
    std::array<bool, kMaxSheets> gone{};
    std::size_t joints = 0;
    for (bool found = true; found && joints + 1 < n;) {
      found = false;
      for (std::size_t a = 0; a < n && !found; ++a)
        for (std::size_t b = a + 1; b < n && !found; ++b) {
          if (gone[a] || gone[b]) continue;
          bool alike = true;
          for (std::size_t o = 0; o < n; ++o)
            if (o != a && o != b && !gone[o] && convex[a][o] != convex[b][o]) alike = false;
          if (!alike) continue;
          out.first[joints] = static_cast<std::uint8_t>(a);
          out.second[joints] = static_cast<std::uint8_t>(b);
          out.convex[joints] = convex[a][b];
          gone[b] = true;
          ++joints;
          found = true;
        }
    }
    if (joints + 1 == n) break;
    std::size_t lightest = 0;
    for (std::size_t k = 1; k < n; ++k)
      if (clusters.moments[k].w() < clusters.moments[lightest].w()) lightest = k;
    clusters.erase(lightest);
  }
}

SurfaceValue value_of_sheet(const Sheet& s, const Float3& p) {
  const Float3 hp = times(s.h, p);
  const float f = s.f0 + dot(s.g, p) + 0.5f * dot(p, hp);
  const Float3 g = s.g + hp;
  const float length = norm(g);
  return length > 0.0f ? SurfaceValue{f / length, g * (1.0f / length)} : SurfaceValue{f, s.g};
}

}  // namespace

Float3 Sheets::along(const Float3& direction, const Float3& p, float near) const {
  Float3 left = direction;
  std::array<Float3, 3> taken;  // orthonormal
  std::size_t count_taken = 0;
  for (std::size_t k = 0; k < static_cast<std::size_t>(count) && count_taken < 3; ++k) {
    const SurfaceValue here = value_of_sheet(sheet[k], p);
    if (std::abs(here.value) > near) continue;
    Float3 n = here.normal;
    for (std::size_t t = 0; t < count_taken; ++t) n = n - taken[t] * dot(n, taken[t]);
    const float length = norm(n);
    if (!(length > 0.1f)) continue;
    n = n * (1.0f / length);
    left = left - n * dot(left, n);
    taken[count_taken++] = n;
  }
  return left;
}

int Sheets::passing(const Float3& p, float near) const {
  int found = 0;
  for (std::size_t k = 0; k < static_cast<std::size_t>(count); ++k)
    found += std::abs(value_of_sheet(sheet[k], p).value) <= near;
  return found;
}

SurfaceValue Sheets::at(const Float3& p) const {
  std::array<SurfaceValue, kMaxSheets> value;
  for (std::size_t k = 0; k < static_cast<std::size_t>(count); ++k) value[k] = value_of_sheet(sheet[k], p);
  for (std::size_t j = 0; j + 1 < static_cast<std::size_t>(count); ++j) {
    SurfaceValue& a = value[first[j]];
    const SurfaceValue& b = value[second[j]];
    if (convex[j] ? b.value > a.value : b.value < a.value) a = b;
  }
  return count > 1 ? value[first[static_cast<std::size_t>(count - 2)]] : value[0];
}

namespace {

/// Squared mean height of b's samples above a's tangent plane, over their variance about it.
float one_sidedness(const Fit& a, const Fit& b, float noise) {
  const float mean = dot(a.mean_normal, b.centroid - a.centroid);
  const float variance = dot(a.mean_normal, times(b.spread, a.mean_normal));
  return mean * mean / (std::max(0.0f, variance) + noise * noise + 1e-4f);
}

/// Leaves out clusters that are no sheets of a surface: too few samples, normals that do not fit the
/// positions, samples mixed with those of a heavier sheet. False if too much would go, or all.
bool drop_false_sheets(const SheetOptions& options, Clusters& clusters) {
  float weight = 0.0f, densest = 0.0f;
  int hits = 0;
  const auto spread_of = [&](std::size_t k) {
    const auto& s = clusters.fit[k].spread;
    return s[0] + s[3] + s[5] + 0.05f;
  };
  for (std::size_t k = 0; k < clusters.count; ++k) {
    const Moments& m = clusters.moments[k];
    weight += m.w();
    hits += m.hits;
    // Only a sheet of some size tells a density.
    if (m.w() >= 0.25f * weight) densest = std::max(densest, static_cast<float>(m.hits) / spread_of(k));
  }
  const float noise2 = options.noise * options.noise;
  for (std::size_t k = clusters.count; k-- > 0;) {
    const Moments& m = clusters.moments[k];
    const Fit& fit = clusters.fit[k];
    const float spread = spread_of(k), sampled = static_cast<float>(m.hits);
    if (m.w() < kMinShare * weight || m.hits < kMinSheetHits ||
        sampled < kMinHitShare * static_cast<float>(hits) || sampled < kMinDensity * densest * spread ||
        fit.height_variance > kLargestHeightShare * spread + 2.0f * noise2 + fit.curvature_variance)
      clusters.erase(k);
  }
  for (bool again = true; again;) {
    again = false;
    for (std::size_t a = 0; a < clusters.count && !again; ++a)
      for (std::size_t b = a + 1; b < clusters.count && !again; ++b) {
        if (std::max(one_sidedness(clusters.fit[a], clusters.fit[b], options.noise),
                     one_sidedness(clusters.fit[b], clusters.fit[a], options.noise)) >= kOneSided)
          continue;
        clusters.erase(clusters.moments[a].w() < clusters.moments[b].w() ? a : b);
        again = true;
      }
  }
  float kept = 0.0f;
  for (std::size_t k = 0; k < clusters.count; ++k) kept += clusters.moments[k].w();
  return clusters.count > 0 && kept >= (1.0f - kLargestLoss) * weight;
}

}  // namespace

Sheets fit_sheets(LocalSamples& samples, const NormalSeeds& seeds, const SheetOptions& options) {
  Sheets out;
  if (seeds.count < 2) return out;
  cluster_normals(samples, seeds);
  Clusters clusters;
  std::array<std::int32_t, kMaxSheets> cluster_of = {};
  for (int k = 0; k < seeds.count; ++k) {
    const Moments m = sum_moments(samples, k);
    cluster_of[static_cast<std::size_t>(k)] = static_cast<std::int32_t>(clusters.count);
    if (m.hits > 0 && dot(m.n(), m.n()) > 0.0f) clusters.add(m);
  }
  join_smooth(clusters, options.cos_feature, cluster_of);
  if (clusters.count < 2) return out;
  separate_layers(samples, cluster_of, options, clusters);
  if (!drop_false_sheets(options, clusters)) return out;
  order_joints(clusters, out);
  out.count = static_cast<int>(clusters.count);
  out.separation2 = kMaxSeparation2;
  for (std::size_t a = 0; a < clusters.count; ++a)
    for (std::size_t b = a + 1; b < clusters.count; ++b)
      joint_cosine(clusters.fit[a], clusters.fit[b], &out.separation2);
  Moments all = clusters.moments[0];
  for (std::size_t k = 0; k < clusters.count; ++k) {
    out.sheet[k] = clusters.fit[k].sheet;
    if (k > 0) all = merged(all, clusters.moments[k]);
  }
  const float inverse = 1.0f / all.w();
  out.centroid = all.p() * inverse;
  out.spread2 = (all.s[7] + all.s[10] + all.s[12]) * inverse - dot(out.centroid, out.centroid);
  return out;
}

}  // namespace tessera
