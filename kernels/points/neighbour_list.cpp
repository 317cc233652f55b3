#include "kernels/points/neighbour_list.h"

#include <algorithm>
#include <bit>

#include "octree/lanes.h"

namespace tessera {
namespace {

constexpr float kListCubeCells = 4.0f;
constexpr float kSupportCosine = 0.5f;  ///< supporters' normals lie within 60 degrees
constexpr float kPadding = 1e6f;        ///< where padding is
constexpr float kRounding = 1.00001f;   ///< squares summed in another order stay within

std::size_t padded(std::size_t n) {
  return (n + kLanes - 1) / kLanes * kLanes;
}

/// The least of the lanes.
float minimum(__m256 v) {
  const __m128 four = _mm_min_ps(_mm256_castps256_ps128(v), _mm256_extractf128_ps(v, 1));
  const __m128 two = _mm_min_ps(four, _mm_movehl_ps(four, four));
  return _mm_cvtss_f32(_mm_min_ss(two, _mm_shuffle_ps(two, two, 1)));
}
float largest(__m256 v) {
  const __m128 four = _mm_max_ps(_mm256_castps256_ps128(v), _mm256_extractf128_ps(v, 1));
  const __m128 two = _mm_max_ps(four, _mm_movehl_ps(four, four));
  return _mm_cvtss_f32(_mm_max_ss(two, _mm_shuffle_ps(two, two, 1)));
}

int count(__m256i negative) {  // every lane holds minus its number
  const __m128i four = _mm_add_epi32(_mm256_castsi256_si128(negative), _mm256_extracti128_si256(negative, 1));
  const __m128i two = _mm_add_epi32(four, _mm_unpackhi_epi64(four, four));
  return -_mm_cvtsi128_si32(_mm_add_epi32(two, _mm_shuffle_epi32(two, 1)));
}

/// The lower and upper four lanes of `v` added to `low` and `high`.
void add(__m256 v, __m256d& low, __m256d& high) {
  low = _mm256_add_pd(low, _mm256_cvtps_pd(_mm256_castps256_ps128(v)));
  high = _mm256_add_pd(high, _mm256_cvtps_pd(_mm256_extractf128_ps(v, 1)));
}

/// Sums each of eight vectors, in double, lanes 0 to 7 one after the other. \param low, high  the first and last four
void sum_lanes(const __m256 (&v)[8], __m256d& low, __m256d& high) {
  __m256 pair[8], quad[8];
  for (std::size_t i = 0; i < 8; i += 2) {
    pair[i] = _mm256_unpacklo_ps(v[i], v[i + 1]);
    pair[i + 1] = _mm256_unpackhi_ps(v[i], v[i + 1]);
  }
  for (std::size_t i = 0; i < 8; i += 4)
    for (std::size_t half = 0; half < 2; ++half) {
      quad[i + 2 * half] = _mm256_shuffle_ps(pair[i + half], pair[i + 2 + half], 0x44);
      quad[i + 2 * half + 1] = _mm256_shuffle_ps(pair[i + half], pair[i + 2 + half], 0xee);
    }
  low = high = _mm256_setzero_pd();
  for (std::size_t k = 0; k < 4; ++k) add(_mm256_permute2f128_ps(quad[k], quad[k + 4], 0x20), low, high);
  for (std::size_t k = 0; k < 4; ++k) add(_mm256_permute2f128_ps(quad[k], quad[k + 4], 0x31), low, high);
}

}  // namespace

void NeighbourList::reserve_lanes(std::size_t maximum, bool normals) {
  const std::size_t capacity = padded(maximum) + kLanes;  // compressed packs are stored whole
  for (std::vector<float>* v : {&x_, &y_, &z_})
    if (v->size() < capacity) v->resize(capacity);
  for (std::vector<float>* v : {&nx_, &ny_, &nz_})
    if (normals && v->size() < capacity) v->resize(capacity);
}

void NeighbourList::fill(const NeighbourSource& source,
                         std::span<const std::pair<std::uint32_t, std::uint32_t>> runs, const Float3& corner,
                         float radius, bool only_ground, bool normals) {
  std::size_t maximum = 0;
  for (const auto& [first, last] : runs) maximum += last - first;
  reserve_lanes(maximum, normals);
  const __m256i lane = _mm256_setr_epi32(0, 1, 2, 3, 4, 5, 6, 7);
  const __m256 low = _mm256_set1_ps(-radius), high = _mm256_set1_ps(kListCubeCells + radius);
  const __m256 origin[3] = {_mm256_set1_ps(corner[0]), _mm256_set1_ps(corner[1]), _mm256_set1_ps(corner[2])};
  const auto close = [&](__m256 v) {
    return _mm256_and_ps(_mm256_cmp_ps(v, low, _CMP_GT_OQ), _mm256_cmp_ps(v, high, _CMP_LT_OQ));
  };
  const std::size_t all = source.x.size();
  size_ = 0;
  for (const auto& [first, last] : runs)
    for (std::size_t p = first; p < last; p += kLanes) {
      const std::size_t left = std::min<std::size_t>(last - p, kLanes);
      const __m256i live = _mm256_cmpgt_epi32(_mm256_set1_epi32(static_cast<int>(left)), lane);
      const auto load = [&](std::span<const float> v) {
        return p + kLanes <= all ? _mm256_loadu_ps(v.data() + p) : _mm256_maskload_ps(v.data() + p, live);
      };
      const __m256 x = _mm256_sub_ps(load(source.x), origin[0]), y = _mm256_sub_ps(load(source.y), origin[1]),
                   z = _mm256_sub_ps(load(source.z), origin[2]);
      const __m256 keep = _mm256_and_ps(_mm256_and_ps(close(x), close(y)),
                                        _mm256_and_ps(close(z), _mm256_castsi256_ps(live)));
      auto mask = static_cast<unsigned>(_mm256_movemask_ps(keep));
      for (std::size_t k = 0; only_ground && k < left; ++k)
        if (source.ground.empty() || source.ground[p + k] == 0) mask &= ~(1u << k);
      if (mask == 0) continue;
      const __m256i front = compress_lanes(mask);
      const auto store = [&](std::vector<float>& to, __m256 v) {
        _mm256_storeu_ps(to.data() + size_, _mm256_permutevar8x32_ps(v, front));
      };
      store(x_, x), store(y_, y), store(z_, z);
      if (normals) store(nx_, load(source.nx)), store(ny_, load(source.ny)), store(nz_, load(source.nz));
      size_ += static_cast<std::size_t>(std::popcount(mask));
    }
  for (std::vector<float>* v : {&x_, &y_, &z_}) _mm256_storeu_ps(v->data() + size_, _mm256_set1_ps(kPadding));
  make_boxes();
  size_ = padded(size_);
}

void NeighbourList::make_boxes() {
  const std::size_t packs = padded(padded(size_) / kLanes);
  const std::vector<float>* axes[3] = {&x_, &y_, &z_};
  for (std::size_t a = 0; a < 3; ++a) {
    const float* const at = axes[a]->data();
    low_[a].assign(packs, kPadding);
    high_[a].assign(packs, -kPadding);
    std::size_t i = 0;
    for (; i + kLanes <= size_; i += kLanes) {
      const __m256 v = _mm256_loadu_ps(at + i);
      low_[a][i / kLanes] = minimum(v), high_[a][i / kLanes] = largest(v);
    }
    for (; i < size_; ++i) {
      low_[a][i / kLanes] = std::min(low_[a][i / kLanes], at[i]);
      high_[a][i / kLanes] = std::max(high_[a][i / kLanes], at[i]);
    }
  }
}

void NeighbourList::select(const Float3& low, const Float3& high, float radius,
                           std::vector<std::uint32_t>& packs) const {
  const __m256 limit = _mm256_set1_ps(radius * radius * kRounding);
  const std::size_t boxes = low_[0].size();
  packs.resize(boxes + kLanes);
  __m256i lane_index = _mm256_setr_epi32(0, 8, 16, 24, 32, 40, 48, 56);
  std::size_t found = 0;
  for (std::size_t v = 0; v < boxes; v += kLanes) {
    __m256 square = _mm256_setzero_ps();
    for (std::size_t a = 0; a < 3; ++a) {
      const __m256 above = _mm256_sub_ps(_mm256_loadu_ps(&low_[a][v]), _mm256_set1_ps(high[a]));
      const __m256 below = _mm256_sub_ps(_mm256_set1_ps(low[a]), _mm256_loadu_ps(&high_[a][v]));
      const __m256 away = _mm256_max_ps(_mm256_max_ps(above, below), _mm256_setzero_ps());
      square = _mm256_fmadd_ps(away, away, square);
    }
    const auto near = static_cast<unsigned>(_mm256_movemask_ps(_mm256_cmp_ps(square, limit, _CMP_LE_OQ)));
    _mm256_storeu_si256(reinterpret_cast<__m256i*>(packs.data() + found),
                        _mm256_permutevar8x32_epi32(lane_index, compress_lanes(near)));
    found += static_cast<std::size_t>(std::popcount(near));
    lane_index = _mm256_add_epi32(lane_index, _mm256_set1_epi32(static_cast<int>(kLanes * kLanes)));
  }
  packs.resize(found);
}

int NeighbourList::sum(std::span<const std::uint32_t> packs, const Float3& p, float radius,
                       NeighbourSums& sums, std::size_t lane) const {
  const __m256 r2 = _mm256_set1_ps(radius * radius), inv_r2 = _mm256_set1_ps(1.0f / (radius * radius));
  const __m256 one = _mm256_set1_ps(1.0f);
  const __m256 px = _mm256_set1_ps(p[0]), py = _mm256_set1_ps(p[1]), pz = _mm256_set1_ps(p[2]);
  const float *const at_x = x_.data(), *const at_y = y_.data(), *const at_z = z_.data();
  __m256 w = _mm256_setzero_ps(), sx = w, sy = w, sz = w, xx = w, xy = w, xz = w, yy = w, yz = w, zz = w;
  __m256i inside = _mm256_setzero_si256();
  for (const std::uint32_t i : packs) {
    const __m256 dx = _mm256_sub_ps(_mm256_loadu_ps(at_x + i), px);
    const __m256 dy = _mm256_sub_ps(_mm256_loadu_ps(at_y + i), py);
    const __m256 dz = _mm256_sub_ps(_mm256_loadu_ps(at_z + i), pz);
    const __m256 d2 = _mm256_fmadd_ps(dx, dx, _mm256_fmadd_ps(dy, dy, _mm256_mul_ps(dz, dz)));
    const __m256 in = _mm256_cmp_ps(d2, r2, _CMP_LT_OQ);
    inside = _mm256_add_epi32(inside, _mm256_castps_si256(in));
    const __m256 q = _mm256_fnmadd_ps(d2, inv_r2, one);
    const __m256 weight = _mm256_and_ps(in, _mm256_mul_ps(q, q));
    w = _mm256_add_ps(w, weight);
    const __m256 wx = _mm256_mul_ps(weight, dx), wy = _mm256_mul_ps(weight, dy),
                 wz = _mm256_mul_ps(weight, dz);
    sx = _mm256_add_ps(sx, wx);
    sy = _mm256_add_ps(sy, wy);
    sz = _mm256_add_ps(sz, wz);
    xx = _mm256_fmadd_ps(wx, dx, xx);
    xy = _mm256_fmadd_ps(wx, dy, xy);
    xz = _mm256_fmadd_ps(wx, dz, xz);
    yy = _mm256_fmadd_ps(wy, dy, yy);
    yz = _mm256_fmadd_ps(wy, dz, yz);
    zz = _mm256_fmadd_ps(wz, dz, zz);
  }
  alignas(32) double s[12];
  __m256d low, high;
  sum_lanes({w, sx, sy, sz, xx, xy, xz, yy}, low, high);
  _mm256_store_pd(s, low), _mm256_store_pd(s + 4, high);
  // The last two: a column of them at a time.
  const __m256 first = _mm256_unpacklo_ps(yz, zz), second = _mm256_unpackhi_ps(yz, zz);
  __m128d pair = _mm_setzero_pd();
  for (const __m128 half : {_mm256_castps256_ps128(first), _mm256_castps256_ps128(second),
                            _mm256_extractf128_ps(first, 1), _mm256_extractf128_ps(second, 1)}) {
    pair = _mm_add_pd(pair, _mm_cvtps_pd(half));
    pair = _mm_add_pd(pair, _mm_cvtps_pd(_mm_movehl_ps(half, half)));
  }
  _mm_store_pd(s + 8, pair);
  for (std::size_t k = 0; k < NeighbourSums::kRows; ++k) sums.row[k][lane] = s[k];
  return count(inside);
}

std::pair<int, int> NeighbourList::supported(std::span<const std::uint32_t> packs, const Float3& p,
                                             const Float3& n, float radius) const {
  const __m256 r2 = _mm256_set1_ps(radius * radius), support = _mm256_set1_ps(kSupportCosine);
  const __m256 px = _mm256_set1_ps(p[0]), py = _mm256_set1_ps(p[1]), pz = _mm256_set1_ps(p[2]);
  const __m256 ux = _mm256_set1_ps(n[0]), uy = _mm256_set1_ps(n[1]), uz = _mm256_set1_ps(n[2]);
  __m256i inside = _mm256_setzero_si256(), agree = inside;
  for (const std::uint32_t i : packs) {
    const __m256 dx = _mm256_sub_ps(_mm256_loadu_ps(&x_[i]), px);
    const __m256 dy = _mm256_sub_ps(_mm256_loadu_ps(&y_[i]), py);
    const __m256 dz = _mm256_sub_ps(_mm256_loadu_ps(&z_[i]), pz);
    const __m256 d2 = _mm256_fmadd_ps(dx, dx, _mm256_fmadd_ps(dy, dy, _mm256_mul_ps(dz, dz)));
    const __m256 in = _mm256_cmp_ps(d2, r2, _CMP_LT_OQ);
    const __m256 along = _mm256_fmadd_ps(
        ux, _mm256_loadu_ps(&nx_[i]),
        _mm256_fmadd_ps(uy, _mm256_loadu_ps(&ny_[i]), _mm256_mul_ps(uz, _mm256_loadu_ps(&nz_[i]))));
    inside = _mm256_add_epi32(inside, _mm256_castps_si256(in));
    agree = _mm256_add_epi32(
        agree, _mm256_castps_si256(_mm256_and_ps(in, _mm256_cmp_ps(along, support, _CMP_GE_OQ))));
  }
  return {count(inside), count(agree)};
}

}  // namespace tessera
