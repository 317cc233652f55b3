#include "kernels/sheets.h"

#include <immintrin.h>

#include <algorithm>
#include <bit>
#include <cmath>

namespace tessera {
namespace {

constexpr std::size_t kLanes = 8;

float dot(const Float3& a, const Float3& b) {
  return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}
Float3 scaled(const Float3& a, float s) {
  return {a[0] * s, a[1] * s, a[2] * s};
}
Float3 minus(const Float3& a, const Float3& b) {
  return {a[0] - b[0], a[1] - b[1], a[2] - b[2]};
}
Float3 unit(const Float3& a) {
  const float l2 = dot(a, a);
  return l2 > 0.0f ? scaled(a, 1.0f / std::sqrt(l2)) : Float3{0, 0, 0};
}
/// Product with a symmetric matrix (xx, xy, xz, yy, yz, zz).
Float3 times(const std::array<float, 6>& m, const Float3& v) {
  return {m[0] * v[0] + m[1] * v[1] + m[2] * v[2], m[1] * v[0] + m[3] * v[1] + m[4] * v[2],
          m[2] * v[0] + m[4] * v[1] + m[5] * v[2]};
}

/// Sum of eight lanes by a fixed tree.
float total(__m256 v) {
  const __m128 four = _mm_add_ps(_mm256_castps256_ps128(v), _mm256_extractf128_ps(v, 1));
  const __m128 two = _mm_add_ps(four, _mm_movehl_ps(four, four));
  return _mm_cvtss_f32(_mm_add_ss(two, _mm_shuffle_ps(two, two, 1)));
}

/// Weighted sums of one cluster; additive, so clusters merge by adding.
struct Moments {
  // w, w p (3), w n (3), w p p (xx xy xz yy yz zz), w n p (row n, column p)
  std::array<float, 22> s{};
  int hits = 0;
  float w() const { return s[0]; }
  Float3 p() const { return {s[1], s[2], s[3]}; }
  Float3 n() const { return {s[4], s[5], s[6]}; }
};

Moments merged(const Moments& a, const Moments& b) {
  Moments m;
  for (std::size_t i = 0; i < m.s.size(); ++i) m.s[i] = a.s[i] + b.s[i];
  m.hits = a.hits + b.hits;
  return m;
}

/// A cluster's quadric and how well it explains the normals.
struct Fit {
  Sheet sheet;
  Float3 centroid{}, mean_normal{};
  float normal_residual = 0.0f;  ///< mean squared
};

/// A few clusters, no allocation.
struct Clusters {
  std::array<Moments, kMostSheets> moments;
  std::array<Fit, kMostSheets> fit;
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
  fit.centroid = scaled(m.p(), inverse);
  fit.mean_normal = unit(m.n());
  const Float3& c = fit.centroid;
  const Float3& n = fit.mean_normal;
  // Tangent frame: the axis least along the normal makes it well-conditioned.
  const std::size_t axis = std::abs(n[0]) <= std::abs(n[1]) ? (std::abs(n[0]) <= std::abs(n[2]) ? 0 : 2)
                                                            : (std::abs(n[1]) <= std::abs(n[2]) ? 1 : 2);
  Float3 t1 = scaled(n, -n[axis]);
  t1[axis] += 1.0f;
  t1 = unit(t1);
  const Float3 t2 = {n[1] * t1[2] - n[2] * t1[1], n[2] * t1[0] - n[0] * t1[2], n[0] * t1[1] - n[1] * t1[0]};
  const Float3 mean = scaled(m.n(), inverse);
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
  const float bend =
      0.5f * (s11 * (m11 - kCurvatureRidge) + 2.0f * s12 * m12 + s22 * (m22 - kCurvatureRidge));
  fit.sheet.g = minus(n, hc);
  fit.sheet.f0 = 0.5f * dot(c, hc) - dot(n, c) - bend;
  const float variance = 1.0f - dot(mean, mean);
  const float explained =
      2.0f * (s11 * b11 + 2.0f * s12 * b12 + s22 * b22) -
      ((s11 * s11 + s12 * s12) * m11 + 2.0f * s12 * (s11 + s22) * m12 + (s12 * s12 + s22 * s22) * m22);
  fit.normal_residual = std::max(0.0f, variance - explained);
  return fit;
}

void Clusters::add(const Moments& m) {
  moments[count] = m;
  fit[count++] = fit_quadric(m);
}

Float3 gradient_at(const Sheet& s, const Float3& p) {
  const Float3 hp = times(s.h, p);
  return {s.g[0] + hp[0], s.g[1] + hp[1], s.g[2] + hp[2]};
}

/// Index of the sample that maximises w times the smallest of 1 - n.seed over the seeds; lowest index on
/// ties.
std::size_t farthest(const LocalSamples& s, const std::array<Float3, kMostSheets>& seeds, int count) {
  __m256 best = _mm256_set1_ps(-1.0f);
  __m256i best_index = _mm256_setzero_si256();
  __m256i index = _mm256_setr_epi32(0, 1, 2, 3, 4, 5, 6, 7);
  for (std::size_t i = 0; i < s.size; i += kLanes) {
    const __m256 nx = _mm256_loadu_ps(&s.nx[i]), ny = _mm256_loadu_ps(&s.ny[i]),
                 nz = _mm256_loadu_ps(&s.nz[i]);
    __m256 close = _mm256_set1_ps(-2.0f);
    for (int k = 0; k < count; ++k) {
      const Float3& a = seeds[static_cast<std::size_t>(k)];
      close = _mm256_max_ps(close, _mm256_fmadd_ps(nx, _mm256_set1_ps(a[0]),
                                                   _mm256_fmadd_ps(ny, _mm256_set1_ps(a[1]),
                                                                   _mm256_mul_ps(nz, _mm256_set1_ps(a[2])))));
    }
    const __m256 score = _mm256_mul_ps(_mm256_loadu_ps(&s.w[i]), _mm256_sub_ps(_mm256_set1_ps(1.0f), close));
    const __m256 better = _mm256_cmp_ps(score, best, _CMP_GT_OQ);
    best = _mm256_blendv_ps(best, score, better);
    best_index = _mm256_blendv_epi8(best_index, index, _mm256_castps_si256(better));
    index = _mm256_add_epi32(index, _mm256_set1_epi32(8));
  }
  alignas(32) std::array<float, kLanes> scores;
  alignas(32) std::array<std::int32_t, kLanes> indices;
  _mm256_store_ps(scores.data(), best);
  _mm256_store_si256(reinterpret_cast<__m256i*>(indices.data()), best_index);
  std::size_t lane = 0;
  for (std::size_t l = 1; l < kLanes; ++l)
    if (scores[l] > scores[lane] || (scores[l] == scores[lane] && indices[l] < indices[lane])) lane = l;
  return static_cast<std::size_t>(indices[lane]);
}

/// Lane masks of the samples whose normal is closest to each mean; ties to the lower cluster.
void assign(__m256 nx, __m256 ny, __m256 nz, const std::array<Float3, kMostSheets>& means, int count,
            __m256* mine) {
  __m256 best = _mm256_set1_ps(-4.0f);
  for (int k = 0; k < count; ++k) {
    const Float3& a = means[static_cast<std::size_t>(k)];
    const __m256 d =
        _mm256_fmadd_ps(nx, _mm256_set1_ps(a[0]),
                        _mm256_fmadd_ps(ny, _mm256_set1_ps(a[1]), _mm256_mul_ps(nz, _mm256_set1_ps(a[2]))));
    const __m256 closer = _mm256_cmp_ps(d, best, _CMP_GT_OQ);
    for (int o = 0; o < k; ++o) mine[o] = _mm256_andnot_ps(closer, mine[o]);
    mine[k] = closer;
    best = _mm256_max_ps(best, d);
  }
}

/// One Lloyd round on the unit normals.
void lloyd_round(const LocalSamples& s, std::array<Float3, kMostSheets>& means, int count) {
  __m256 sum[3 * kMostSheets];
  for (__m256& v : sum) v = _mm256_setzero_ps();
  __m256 mine[kMostSheets];
  for (std::size_t i = 0; i < s.size; i += kLanes) {
    const __m256 nx = _mm256_loadu_ps(&s.nx[i]), ny = _mm256_loadu_ps(&s.ny[i]),
                 nz = _mm256_loadu_ps(&s.nz[i]);
    const __m256 w = _mm256_loadu_ps(&s.w[i]);
    assign(nx, ny, nz, means, count, mine);
    for (int k = 0; k < count; ++k) {
      const __m256 v = _mm256_and_ps(w, mine[k]);
      const auto at = static_cast<std::size_t>(3 * k);
      sum[at] = _mm256_fmadd_ps(v, nx, sum[at]);
      sum[at + 1] = _mm256_fmadd_ps(v, ny, sum[at + 1]);
      sum[at + 2] = _mm256_fmadd_ps(v, nz, sum[at + 2]);
    }
  }
  for (int k = 0; k < count; ++k) {
    const auto at = static_cast<std::size_t>(3 * k);
    const Float3 n = {total(sum[at]), total(sum[at + 1]), total(sum[at + 2])};
    if (dot(n, n) > 0.0f) means[static_cast<std::size_t>(k)] = unit(n);
  }
}

void sum_moments(const LocalSamples& s, const std::array<Float3, kMostSheets>& means, int count,
                 std::array<Moments, kMostSheets>& out) {
  for (int k = 0; k < count; ++k) {
    __m256 sum[22];
    for (__m256& v : sum) v = _mm256_setzero_ps();
    int hits = 0;
    __m256 mine[kMostSheets];
    for (std::size_t i = 0; i < s.size; i += kLanes) {
      const __m256 nx = _mm256_loadu_ps(&s.nx[i]), ny = _mm256_loadu_ps(&s.ny[i]),
                   nz = _mm256_loadu_ps(&s.nz[i]);
      assign(nx, ny, nz, means, count, mine);
      const __m256 w = _mm256_and_ps(_mm256_loadu_ps(&s.w[i]), mine[k]);
      const auto live =
          static_cast<unsigned>(_mm256_movemask_ps(_mm256_cmp_ps(w, _mm256_setzero_ps(), _CMP_GT_OQ)));
      if (!live) continue;
      hits += std::popcount(live);
      const __m256 x = _mm256_loadu_ps(&s.x[i]), y = _mm256_loadu_ps(&s.y[i]), z = _mm256_loadu_ps(&s.z[i]);
      const __m256 wx = _mm256_mul_ps(w, x), wy = _mm256_mul_ps(w, y), wz = _mm256_mul_ps(w, z);
      sum[0] = _mm256_add_ps(sum[0], w);
      sum[1] = _mm256_add_ps(sum[1], wx);
      sum[2] = _mm256_add_ps(sum[2], wy);
      sum[3] = _mm256_add_ps(sum[3], wz);
      sum[4] = _mm256_fmadd_ps(w, nx, sum[4]);
      sum[5] = _mm256_fmadd_ps(w, ny, sum[5]);
      sum[6] = _mm256_fmadd_ps(w, nz, sum[6]);
      sum[7] = _mm256_fmadd_ps(wx, x, sum[7]);
      sum[8] = _mm256_fmadd_ps(wx, y, sum[8]);
      sum[9] = _mm256_fmadd_ps(wx, z, sum[9]);
      sum[10] = _mm256_fmadd_ps(wy, y, sum[10]);
      sum[11] = _mm256_fmadd_ps(wy, z, sum[11]);
      sum[12] = _mm256_fmadd_ps(wz, z, sum[12]);
      sum[13] = _mm256_fmadd_ps(nx, wx, sum[13]);
      sum[14] = _mm256_fmadd_ps(nx, wy, sum[14]);
      sum[15] = _mm256_fmadd_ps(nx, wz, sum[15]);
      sum[16] = _mm256_fmadd_ps(ny, wx, sum[16]);
      sum[17] = _mm256_fmadd_ps(ny, wy, sum[17]);
      sum[18] = _mm256_fmadd_ps(ny, wz, sum[18]);
      sum[19] = _mm256_fmadd_ps(nz, wx, sum[19]);
      sum[20] = _mm256_fmadd_ps(nz, wy, sum[20]);
      sum[21] = _mm256_fmadd_ps(nz, wz, sum[21]);
    }
    Moments& m = out[static_cast<std::size_t>(k)];
    for (std::size_t i = 0; i < 22; ++i) m.s[i] = total(sum[i]);
    m.hits = hits;
  }
}

/// Sheets farther apart than their spread: the squared chord between their normals must exceed the mean
/// squared residual of the normals by this factor. Halving one Gaussian cloud of normals gives 2, an even
/// bend without curvature fit 12.
constexpr float kSeparation2 = 16.0f;
/// Least share of the weight and least samples of a sheet; less cannot carry one and is left out of the
/// others.
constexpr float kLeastShare = 0.02f;
constexpr int kLeastSheetHits = 3;

/// Cosine of the angle between two sheets where they meet (half-way between their samples), or 1 if noise
/// explains the difference.
float joint_cosine(const Fit& a, const Fit& b) {
  const Float3 middle = scaled(
      {a.centroid[0] + b.centroid[0], a.centroid[1] + b.centroid[1], a.centroid[2] + b.centroid[2]}, 0.5f);
  const Float3 na = unit(gradient_at(a.sheet, middle)), nb = unit(gradient_at(b.sheet, middle));
  const float cosine = dot(na, nb);
  const float residual = 0.5f * (a.normal_residual + b.normal_residual);
  return 2.0f - 2.0f * cosine < kSeparation2 * residual ? 1.0f : cosine;
}

/// Joins what one smooth sheet explains, closest pair first.
void join_smooth(Clusters& clusters, float cos_feature) {
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
    clusters.moments[best_a] = merged(clusters.moments[best_a], clusters.moments[best_b]);
    clusters.fit[best_a] = fit_quadric(clusters.moments[best_a]);
    clusters.erase(best_b);
  }
}

/// Orders the joints: repeatedly joins two sheets that relate alike to all others. A relation that cannot be
/// written so loses its lightest sheet first.
void order_joints(Clusters& clusters, Sheets& out) {
  for (;;) {
    const std::size_t n = clusters.count;
    const auto& fits = clusters.fit;
    std::array<std::array<bool, kMostSheets>, kMostSheets> convex{};
    for (std::size_t a = 0; a < n; ++a)
      for (std::size_t b = 0; b < n; ++b) {
        const Float3 d = minus(fits[b].centroid, fits[a].centroid);
        convex[a][b] = dot(fits[a].mean_normal, d) - dot(fits[b].mean_normal, d) < 0.0f;
      }
    std::array<bool, kMostSheets> gone{};
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

}  // namespace

void LocalSamples::reserve(std::size_t n) {
  const std::size_t need = n + 2 * kLanes;
  if (x.size() >= need) return;
  for (auto* v : {&x, &y, &z, &nx, &ny, &nz, &w}) v->resize(need + need / 2, 0.0f);
}

void LocalSamples::pad() {
  reserve(size);
  for (std::size_t i = size; i < size + kLanes; ++i) x[i] = y[i] = z[i] = nx[i] = ny[i] = nz[i] = w[i] = 0.0f;
}

SurfaceValue Sheets::at(const Float3& p) const {
  std::array<SurfaceValue, kMostSheets> value;
  for (std::size_t k = 0; k < static_cast<std::size_t>(count); ++k) {
    const Sheet& s = sheet[k];
    const Float3 hp = times(s.h, p);
    const float f = s.f0 + dot(s.g, p) + 0.5f * dot(p, hp);
    const Float3 g = {s.g[0] + hp[0], s.g[1] + hp[1], s.g[2] + hp[2]};
    const float length = std::sqrt(dot(g, g));
    value[k] = length > 0.0f ? SurfaceValue{f / length, scaled(g, 1.0f / length)} : SurfaceValue{f, s.g};
  }
  for (std::size_t j = 0; j + 1 < static_cast<std::size_t>(count); ++j) {
    SurfaceValue& a = value[first[j]];
    const SurfaceValue& b = value[second[j]];
    if (convex[j] ? b.value > a.value : b.value < a.value) a = b;
  }
  return count > 1 ? value[first[static_cast<std::size_t>(count - 2)]] : value[0];
}

Sheets fit_sheets(const LocalSamples& samples, const SheetOptions& options) {
  Sheets out;
  // Seeds: normals far from the ones before, nearer samples first; the mean normal only finds the first.
  std::array<Float3, kMostSheets> means{};
  __m256 sx = _mm256_setzero_ps(), sy = sx, sz = sx;
  for (std::size_t i = 0; i < samples.size; i += kLanes) {
    const __m256 w = _mm256_loadu_ps(&samples.w[i]);
    sx = _mm256_fmadd_ps(w, _mm256_loadu_ps(&samples.nx[i]), sx);
    sy = _mm256_fmadd_ps(w, _mm256_loadu_ps(&samples.ny[i]), sy);
    sz = _mm256_fmadd_ps(w, _mm256_loadu_ps(&samples.nz[i]), sz);
  }
  means[0] = unit({total(sx), total(sy), total(sz)});
  const auto normal_of = [&](std::size_t i) { return Float3{samples.nx[i], samples.ny[i], samples.nz[i]}; };
  const std::size_t first = farthest(samples, means, 1);
  if (first >= samples.size) return out;  // all normals alike: a padding sample won
  means[0] = normal_of(first);
  int count = 1;
  while (count < kMostSheets) {
    const std::size_t next = farthest(samples, means, count);
    if (next >= samples.size) break;
    const Float3 n = normal_of(next);
    float close = -1.0f;
    for (int k = 0; k < count; ++k) close = std::max(close, dot(n, means[static_cast<std::size_t>(k)]));
    if (close > options.cos_feature) break;
    means[static_cast<std::size_t>(count++)] = n;
  }
  if (count == 1) return out;
  for (int round = 0; round < 2; ++round) lloyd_round(samples, means, count);
  std::array<Moments, kMostSheets> sums;
  sum_moments(samples, means, count, sums);
  Clusters clusters;
  for (int k = 0; k < count; ++k) {
    const Moments& m = sums[static_cast<std::size_t>(k)];
    if (m.hits > 0 && dot(m.n(), m.n()) > 0.0f) clusters.add(m);
  }
  join_smooth(clusters, options.cos_feature);
  if (clusters.count < 2) return out;
  float weight = 0.0f;
  for (std::size_t k = 0; k < clusters.count; ++k) weight += clusters.moments[k].w();
  for (std::size_t k = clusters.count; k-- > 0;)
    if (clusters.moments[k].w() < kLeastShare * weight || clusters.moments[k].hits < kLeastSheetHits)
      clusters.erase(k);
  if (clusters.count == 0) return out;
  order_joints(clusters, out);
  out.count = static_cast<int>(clusters.count);
  Moments all = clusters.moments[0];
  for (std::size_t k = 0; k < clusters.count; ++k) {
    out.sheet[k] = clusters.fit[k].sheet;
    if (k > 0) all = merged(all, clusters.moments[k]);
  }
  const float inverse = 1.0f / all.w();
  out.centroid = scaled(all.p(), inverse);
  out.spread2 = (all.s[7] + all.s[10] + all.s[12]) * inverse - dot(out.centroid, out.centroid);
  return out;
}

}  // namespace tessera
