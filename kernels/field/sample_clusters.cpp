#include "kernels/field/sample_clusters.h"

#include <algorithm>
#include <bit>

#include "kernels/field/sample_list.h"
#include "octree/lanes.h"

namespace tessera {
namespace {

/// Index of the sample that maximises w times the smallest of 1 - n.seed over the seeds; lowest index on
/// ties.
std::size_t farthest(const LocalSamples& s, const std::array<Float3, kMaxSheets>& seeds, int count) {
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
void nearest_mean(__m256 nx, __m256 ny, __m256 nz, const std::array<Float3, kMaxSheets>& means, int count,
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
void lloyd_round(const LocalSamples& s, std::array<Float3, kMaxSheets>& means, int count) {
  __m256 sum[3 * kMaxSheets];
  for (__m256& v : sum) v = _mm256_setzero_ps();
  __m256 mine[kMaxSheets];
  for (std::size_t i = 0; i < s.size; i += kLanes) {
    const __m256 nx = _mm256_loadu_ps(&s.nx[i]), ny = _mm256_loadu_ps(&s.ny[i]),
                 nz = _mm256_loadu_ps(&s.nz[i]);
    const __m256 w = _mm256_loadu_ps(&s.w[i]);
    nearest_mean(nx, ny, nz, means, count, mine);
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
    const Float3 n = {lane_sum(sum[at]), lane_sum(sum[at + 1]), lane_sum(sum[at + 2])};
    if (dot(n, n) > 0.0f) means[static_cast<std::size_t>(k)] = unit_or_zero(n);
  }
}

void label_samples(LocalSamples& s, const std::array<Float3, kMaxSheets>& means, int count) {
  __m256 mine[kMaxSheets];
  for (std::size_t i = 0; i < s.size; i += kLanes) {
    nearest_mean(_mm256_loadu_ps(&s.nx[i]), _mm256_loadu_ps(&s.ny[i]), _mm256_loadu_ps(&s.nz[i]), means,
                 count, mine);
    __m256i label = _mm256_setzero_si256();
    for (int k = 1; k < count; ++k)
      label = _mm256_blendv_epi8(label, _mm256_set1_epi32(k), _mm256_castps_si256(mine[k]));
    _mm256_storeu_si256(reinterpret_cast<__m256i*>(&s.label[i]), label);
  }
  for (std::size_t i = s.size; i < s.size + kLanes; ++i) s.label[i] = -1;
}

/// The squared gap between two layers must exceed their mean squared height about themselves by this factor.
constexpr float kLayerSeparation2 = 16.0f;

}  // namespace

void LocalSamples::reserve(std::size_t n) {
  const std::size_t need = n + 2 * kLanes;
  if (x.size() >= need) return;
  for (auto* v : {&x, &y, &z, &nx, &ny, &nz, &w}) v->resize(need + need / 2, 0.0f);
  label.resize(need + need / 2, -1);
}

void LocalSamples::take_every(std::size_t n, const LocalSamples& from) {
  size = 0;
  reserve(from.size / n + 1);
  for (std::size_t i = 0; i < from.size; i += n, ++size) {
    x[size] = from.x[i], y[size] = from.y[i], z[size] = from.z[i];
    nx[size] = from.nx[i], ny[size] = from.ny[i], nz[size] = from.nz[i];
    w[size] = from.w[i];
  }
  pad();
}

void LocalSamples::pad() {
  reserve(size);
  for (std::size_t i = size; i < size + kLanes; ++i) x[i] = y[i] = z[i] = nx[i] = ny[i] = nz[i] = w[i] = 0.0f;
}

Moments merged(const Moments& a, const Moments& b) {
  Moments m;
  for (std::size_t i = 0; i < m.s.size(); ++i) m.s[i] = a.s[i] + b.s[i];
  m.hits = a.hits + b.hits;
  return m;
}

void make_unit(LocalSamples& s) {
  for (std::size_t i = 0; i < s.size; i += kLanes) {
    const __m256 nx = _mm256_loadu_ps(&s.nx[i]), ny = _mm256_loadu_ps(&s.ny[i]),
                 nz = _mm256_loadu_ps(&s.nz[i]);
    const __m256 n2 = _mm256_fmadd_ps(nx, nx, _mm256_fmadd_ps(ny, ny, _mm256_mul_ps(nz, nz)));
    // Padding stays zero.
    const __m256 scale =
        _mm256_div_ps(_mm256_set1_ps(1.0f), _mm256_sqrt_ps(_mm256_max_ps(n2, _mm256_set1_ps(1e-12f))));
    _mm256_storeu_ps(&s.nx[i], _mm256_mul_ps(nx, scale));
    _mm256_storeu_ps(&s.ny[i], _mm256_mul_ps(ny, scale));
    _mm256_storeu_ps(&s.nz[i], _mm256_mul_ps(nz, scale));
  }
}

NormalSeeds seed_normals(const LocalSamples& from, float cos_seed) {
  NormalSeeds seeds;
  __m256 sx = _mm256_setzero_ps(), sy = sx, sz = sx;
  for (std::size_t i = 0; i < from.size; i += kLanes) {
    const __m256 w = _mm256_loadu_ps(&from.w[i]);
    sx = _mm256_fmadd_ps(w, _mm256_loadu_ps(&from.nx[i]), sx);
    sy = _mm256_fmadd_ps(w, _mm256_loadu_ps(&from.ny[i]), sy);
    sz = _mm256_fmadd_ps(w, _mm256_loadu_ps(&from.nz[i]), sz);
  }
  seeds.normal[0] = unit_or_zero(Float3{lane_sum(sx), lane_sum(sy), lane_sum(sz)});
  const auto normal_of = [&](std::size_t i) { return Float3{from.nx[i], from.ny[i], from.nz[i]}; };
  const std::size_t first = farthest(from, seeds.normal, 1);
  if (first >= from.size) return seeds;  // all normals alike: padding won
  seeds.normal[0] = normal_of(first);
  while (seeds.count < kMaxSheets) {
    const std::size_t next = farthest(from, seeds.normal, seeds.count);
    if (next >= from.size) break;
    const Float3 n = normal_of(next);
    float close = -1.0f;
    for (int k = 0; k < seeds.count; ++k)
      close = std::max(close, dot(n, seeds.normal[static_cast<std::size_t>(k)]));
    if (close > cos_seed) break;
    seeds.normal[static_cast<std::size_t>(seeds.count++)] = n;
  }
  return seeds;
}

void cluster_normals(LocalSamples& samples, const NormalSeeds& seeds) {
  std::array<Float3, kMaxSheets> means = seeds.normal;
  for (int round = 0; round < 2; ++round) lloyd_round(samples, means, seeds.count);
  label_samples(samples, means, seeds.count);
}

Moments sum_moments(const LocalSamples& s, std::int32_t label) {
  __m256 sum[22];
  for (__m256& v : sum) v = _mm256_setzero_ps();
  int hits = 0;
  const __m256i wanted = _mm256_set1_epi32(label);
  for (std::size_t i = 0; i < s.size; i += kLanes) {
    const __m256 nx = _mm256_loadu_ps(&s.nx[i]), ny = _mm256_loadu_ps(&s.ny[i]),
                 nz = _mm256_loadu_ps(&s.nz[i]);
    const __m256 mine = _mm256_castsi256_ps(
        _mm256_cmpeq_epi32(wanted, _mm256_loadu_si256(reinterpret_cast<const __m256i*>(&s.label[i]))));
    const __m256 w = _mm256_and_ps(_mm256_loadu_ps(&s.w[i]), mine);
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
  Moments m;
  for (std::size_t i = 0; i < 22; ++i) m.s[i] = lane_sum(sum[i]);
  m.hits = hits;
  return m;
}

void relabel(LocalSamples& s, const std::array<std::int32_t, kMaxSheets>& map) {
  for (std::size_t i = 0; i < s.size; ++i) s.label[i] = map[static_cast<std::size_t>(s.label[i])];
}

bool split_layers(LocalSamples& s, std::int32_t label, std::int32_t new_label, const Float3& c,
                  const Float3& n, float min_gap) {
  const float offset = dot(n, c);
  const __m256i wanted = _mm256_set1_epi32(label);
  const auto height = [&](std::size_t i) {
    return _mm256_sub_ps(
        _mm256_fmadd_ps(_mm256_set1_ps(n[0]), _mm256_loadu_ps(&s.x[i]),
                        _mm256_fmadd_ps(_mm256_set1_ps(n[1]), _mm256_loadu_ps(&s.y[i]),
                                        _mm256_mul_ps(_mm256_set1_ps(n[2]), _mm256_loadu_ps(&s.z[i])))),
        _mm256_set1_ps(offset));
  };
  const auto upper_lanes = [&](std::size_t i, __m256 u, float cut, __m256* lower) {
    const __m256 mine = _mm256_castsi256_ps(
        _mm256_cmpeq_epi32(wanted, _mm256_loadu_si256(reinterpret_cast<const __m256i*>(&s.label[i]))));
    const __m256 above = _mm256_cmp_ps(u, _mm256_set1_ps(cut), _CMP_GT_OQ);
    *lower = _mm256_andnot_ps(above, mine);
    return _mm256_and_ps(above, mine);
  };
  float cut = 0.0f, gap = 0.0f, within = 0.0f;
  for (int round = 0; round < 3; ++round) {
    const __m256 zero = _mm256_setzero_ps();
    __m256 wl = zero, wh = zero, ul = zero, uh = zero, uu = zero;
    for (std::size_t i = 0; i < s.size; i += kLanes) {
      const __m256 u = height(i), w = _mm256_loadu_ps(&s.w[i]);
      __m256 low;
      const __m256 high = upper_lanes(i, u, cut, &low);
      const __m256 w_low = _mm256_and_ps(w, low), w_high = _mm256_and_ps(w, high);
      wl = _mm256_add_ps(wl, w_low);
      wh = _mm256_add_ps(wh, w_high);
      ul = _mm256_fmadd_ps(w_low, u, ul);
      uh = _mm256_fmadd_ps(w_high, u, uh);
      uu = _mm256_fmadd_ps(_mm256_mul_ps(_mm256_add_ps(w_low, w_high), u), u, uu);
    }
    const float weight_low = lane_sum(wl), weight_high = lane_sum(wh);
    if (!(weight_low > 0.0f && weight_high > 0.0f)) return false;
    const float low = lane_sum(ul) / weight_low, high = lane_sum(uh) / weight_high;
    gap = high - low;
    within = (lane_sum(uu) - weight_low * low * low - weight_high * high * high) / (weight_low + weight_high);
    cut = 0.5f * (low + high);
  }
  if (gap < min_gap || gap * gap < kLayerSeparation2 * within) return false;
  for (std::size_t i = 0; i < s.size; i += kLanes) {
    __m256 low;
    const __m256 high = upper_lanes(i, height(i), cut, &low);
    auto* at = reinterpret_cast<__m256i*>(&s.label[i]);
    _mm256_storeu_si256(at, _mm256_blendv_epi8(_mm256_loadu_si256(at), _mm256_set1_epi32(new_label),
                                               _mm256_castps_si256(high)));
  }
  return true;
}

}  // namespace tessera
