#include "kernels/field/sample_list.h"

#include <bit>

namespace tessera {
namespace {

constexpr std::size_t kSlack = 2 * kLanes;

template <bool kOriented>
void gather(const PointBlock& points, const PointLeaves& leaves, int i, int j, int k, const SampleBox& box,
            SampleList& out) {
  std::size_t bound = 0;
  for (int dk = -1; dk <= 1; ++dk)
    for (int dj = -1; dj <= 1; ++dj)
      for (int di = -1; di <= 1; ++di) {
        if (!leaves.holds(i + di, j + dj, k + dk)) continue;
        const auto range = leaves.range[leaves.at(i + di, j + dj, k + dk)];
        bound += range.end - range.begin;
      }
  out.reserve(bound);

  const __m256 corner_x = _mm256_set1_ps(static_cast<float>(i * kLeafCells));
  const __m256 corner_y = _mm256_set1_ps(static_cast<float>(j * kLeafCells));
  const __m256 corner_z = _mm256_set1_ps(static_cast<float>(k * kLeafCells));
  const auto inside = [](__m256 v, float low, float high) {
    return _mm256_and_ps(_mm256_cmp_ps(v, _mm256_set1_ps(low), _CMP_GT_OQ),
                         _mm256_cmp_ps(v, _mm256_set1_ps(high), _CMP_LT_OQ));
  };
  const __m256i lane = _mm256_setr_epi32(0, 1, 2, 3, 4, 5, 6, 7);
  const std::size_t all = points.size();
  std::size_t size = 0;
  for (int dk = -1; dk <= 1; ++dk)
    for (int dj = -1; dj <= 1; ++dj)
      for (int di = -1; di <= 1; ++di) {
        if (!leaves.holds(i + di, j + dj, k + dk)) continue;
        const auto range = leaves.range[leaves.at(i + di, j + dj, k + dk)];
        for (std::size_t p = range.begin; p < range.end; p += kLanes) {
          const std::size_t left = range.end - p;
          __m256i live =
              _mm256_cmpgt_epi32(_mm256_set1_epi32(left < kLanes ? static_cast<int>(left) : 8), lane);
          const auto load = [&](const std::vector<float>& v) {
            return p + kLanes <= all ? _mm256_loadu_ps(v.data() + p) : _mm256_maskload_ps(v.data() + p, live);
          };
          const __m256 x = _mm256_sub_ps(load(points.x), corner_x);
          const __m256 y = _mm256_sub_ps(load(points.y), corner_y);
          const __m256 z = _mm256_sub_ps(load(points.z), corner_z);
          __m256 keep = _mm256_and_ps(_mm256_castsi256_ps(live), inside(x, box.low[0], box.high[0]));
          keep = _mm256_and_ps(keep, inside(y, box.low[1], box.high[1]));
          keep = _mm256_and_ps(keep, inside(z, box.low[2], box.high[2]));
          if (_mm256_testz_ps(keep, keep)) continue;
          const __m256 nx = load(points.nx), ny = load(points.ny), nz = load(points.nz);
          const __m256 zero = _mm256_setzero_ps();
          if constexpr (kOriented)
            keep = _mm256_and_ps(keep, _mm256_or_ps(_mm256_cmp_ps(nx, zero, _CMP_NEQ_OQ),
                                                    _mm256_or_ps(_mm256_cmp_ps(ny, zero, _CMP_NEQ_OQ),
                                                                 _mm256_cmp_ps(nz, zero, _CMP_NEQ_OQ))));
          const auto mask = static_cast<unsigned>(_mm256_movemask_ps(keep));
          if (!mask) continue;
          const __m256i front = compress_lanes(mask);
          const auto store = [&](std::vector<float>& v, __m256 value) {
            _mm256_storeu_ps(v.data() + size, _mm256_permutevar8x32_ps(value, front));
          };
          store(out.x, x);
          store(out.y, y);
          store(out.z, z);
          store(out.nx, nx);
          store(out.ny, ny);
          store(out.nz, nz);
          const __m256i index = _mm256_add_epi32(_mm256_set1_epi32(static_cast<int>(p)), lane);
          _mm256_storeu_si256(reinterpret_cast<__m256i*>(out.point.data() + size),
                              _mm256_permutevar8x32_epi32(index, front));
          size += static_cast<std::size_t>(std::popcount(mask));
        }
      }
  out.size = size;
}

}  // namespace

void SampleList::reserve(std::size_t n) {
  size = 0;
  if (x.size() >= n + kSlack) return;
  const std::size_t capacity = n + n / 2 + kSlack;
  for (auto* array : {&x, &y, &z, &nx, &ny, &nz}) array->assign(capacity, 0.0f);
  point.assign(capacity, 0);
}

void gather_samples(const PointBlock& points, const PointLeaves& leaves, int i, int j, int k,
                    const SampleBox& box, SampleList& out) {
  gather<true>(points, leaves, i, j, k, box, out);
}

void gather_all(const PointBlock& points, const PointLeaves& leaves, int i, int j, int k,
                const SampleBox& box, SampleList& out) {
  gather<false>(points, leaves, i, j, k, box, out);
}

}  // namespace tessera
