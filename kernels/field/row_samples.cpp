#include "kernels/field/row_samples.h"

#include <bit>

namespace tessera {

void fill_row(const SampleList& list, const RowSupport& support, std::size_t* next, RowSamples& row) {
  const __m256 row_y = _mm256_set1_ps(support.y0), row_z = _mm256_set1_ps(support.z0),
               support2 = _mm256_set1_ps(support.r2);
  const __m256 low = _mm256_set1_ps(support.low_x), high = _mm256_set1_ps(support.high_x);
  std::size_t size = 0, p = *next;
  for (; p < list.size && size <= kRowSamples - kLanes; p += kLanes) {
    const __m256 x = _mm256_loadu_ps(list.x.data() + p);
    const __m256 y = _mm256_sub_ps(_mm256_loadu_ps(list.y.data() + p), row_y);
    const __m256 z = _mm256_sub_ps(_mm256_loadu_ps(list.z.data() + p), row_z);
    const __m256 yz2 = _mm256_fmadd_ps(y, y, _mm256_mul_ps(z, z));
    __m256 keep = _mm256_cmp_ps(yz2, support2, _CMP_LT_OQ);
    keep = _mm256_and_ps(keep, _mm256_cmp_ps(x, low, _CMP_GT_OQ));
    keep = _mm256_and_ps(keep, _mm256_cmp_ps(x, high, _CMP_LT_OQ));
    auto mask = static_cast<unsigned>(_mm256_movemask_ps(keep));
    if (list.size - p < kLanes) mask &= (1u << (list.size - p)) - 1u;
    if (!mask) continue;
    const __m256i front = compress_lanes(mask);
    const __m256 nx = _mm256_loadu_ps(list.nx.data() + p);
    const __m256 ny = _mm256_loadu_ps(list.ny.data() + p);
    const __m256 nz = _mm256_loadu_ps(list.nz.data() + p);
    const __m256 n_yz = _mm256_fmadd_ps(ny, y, _mm256_mul_ps(nz, z));
    const auto store = [&](std::array<float, kRowSamples + kLanes>& to, __m256 v) {
      _mm256_storeu_ps(to.data() + size, _mm256_permutevar8x32_ps(v, front));
    };
    store(row.x, x);
    store(row.y, y);
    store(row.z, z);
    store(row.yz2, yz2);
    store(row.nx, nx);
    store(row.ny, ny);
    store(row.nz, nz);
    store(row.n_yz, n_yz);
    size += static_cast<std::size_t>(std::popcount(mask));
  }
  *next = p;
  row.size = size;
}

void fill_slab(const SampleList& list, float z0, float radius, SampleList& slab) {
  slab.reserve(list.size);
  const __m256 low = _mm256_set1_ps(z0 - radius), high = _mm256_set1_ps(z0 + radius);
  std::size_t size = 0;
  for (std::size_t p = 0; p < list.size; p += kLanes) {
    const __m256 z = _mm256_loadu_ps(list.z.data() + p);
    auto mask = static_cast<unsigned>(_mm256_movemask_ps(
        _mm256_and_ps(_mm256_cmp_ps(z, low, _CMP_GT_OQ), _mm256_cmp_ps(z, high, _CMP_LT_OQ))));
    if (list.size - p < kLanes) mask &= (1u << (list.size - p)) - 1u;
    if (!mask) continue;
    const __m256i front = compress_lanes(mask);
    const auto store = [&](std::vector<float>& to, __m256 v) {
      _mm256_storeu_ps(to.data() + size, _mm256_permutevar8x32_ps(v, front));
    };
    store(slab.x, _mm256_loadu_ps(list.x.data() + p));
    store(slab.y, _mm256_loadu_ps(list.y.data() + p));
    store(slab.z, z);
    store(slab.nx, _mm256_loadu_ps(list.nx.data() + p));
    store(slab.ny, _mm256_loadu_ps(list.ny.data() + p));
    store(slab.nz, _mm256_loadu_ps(list.nz.data() + p));
    size += static_cast<std::size_t>(std::popcount(mask));
  }
  slab.size = size;
}

void append_local(const RowSamples& row, float x0, float r2, LocalSamples& out) {
  out.reserve(out.size + row.size);
  const __m256 node_x = _mm256_set1_ps(x0), support2 = _mm256_set1_ps(r2), one = _mm256_set1_ps(1.0f),
               scale = _mm256_set1_ps(1.0f / r2);
  std::size_t size = out.size;
  for (std::size_t p = 0; p < row.size; p += kLanes) {
    const __m256 x = _mm256_sub_ps(_mm256_loadu_ps(&row.x[p]), node_x);
    const __m256 d2 = _mm256_fmadd_ps(x, x, _mm256_loadu_ps(&row.yz2[p]));
    auto mask = static_cast<unsigned>(_mm256_movemask_ps(_mm256_cmp_ps(d2, support2, _CMP_LT_OQ)));
    if (row.size - p < kLanes) mask &= (1u << (row.size - p)) - 1u;
    if (!mask) continue;
    const __m256i front = compress_lanes(mask);
    const auto store = [&](std::vector<float>& to, __m256 v) {
      _mm256_storeu_ps(to.data() + size, _mm256_permutevar8x32_ps(v, front));
    };
    __m256 w = _mm256_fnmadd_ps(d2, scale, one);
    w = _mm256_mul_ps(w, w);
    store(out.w, _mm256_mul_ps(w, w));
    store(out.x, x);
    store(out.y, _mm256_loadu_ps(&row.y[p]));
    store(out.z, _mm256_loadu_ps(&row.z[p]));
    store(out.nx, _mm256_loadu_ps(&row.nx[p]));
    store(out.ny, _mm256_loadu_ps(&row.ny[p]));
    store(out.nz, _mm256_loadu_ps(&row.nz[p]));
    size += static_cast<std::size_t>(std::popcount(mask));
  }
  out.size = size;
}

}  // namespace tessera
