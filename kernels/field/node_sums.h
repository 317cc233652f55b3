/// \file node_sums.h
/// The weighted sums of the samples around eight nodes in a row, from which spheres are fitted. For .cpp files.
#pragma once
#include <immintrin.h>

#include "kernels/field/row_samples.h"

namespace tessera {

/// NodeSums of eight nodes, relative to each node: w, w p, w n, w p.p, w p.n, w (p.n)^2, and the number of samples.
struct NodeSums {
  __m256 w, px, py, pz, nx, ny, nz, pp, pn, pn2;
  __m256i hits;
};

inline void clear(NodeSums& s) {
  const __m256 zero = _mm256_setzero_ps();
  s = {zero, zero, zero, zero, zero, zero, zero, zero, zero, zero, _mm256_setzero_si256()};
}

/// Weight (1 - d^2/r^2)^4 inside the radius, 1 - d^2/r^2 for a wide one, 0 outside. A sample outside adds exactly
/// nothing, so it does not matter which of those a caller's filter lets through.
template <bool kWide>
void accumulate(const RowSamples& row, float r2, float inverse_r2, NodeSums& sums) {
  NodeSums s = sums;
  const __m256 node_x = _mm256_setr_ps(0, 1, 2, 3, 4, 5, 6, 7);
  const __m256 scale = _mm256_set1_ps(inverse_r2), reach2 = _mm256_set1_ps(r2), one = _mm256_set1_ps(1.0f);
  for (std::size_t i = 0; i < row.size; ++i) {
    const __m256 dx = _mm256_sub_ps(_mm256_broadcast_ss(&row.x[i]), node_x);
    const __m256 d2 = _mm256_fmadd_ps(dx, dx, _mm256_broadcast_ss(&row.yz2[i]));
    __m256 t = _mm256_fnmadd_ps(d2, scale, one);
    const __m256 near = _mm256_cmp_ps(d2, reach2, _CMP_LT_OQ);
    s.hits = _mm256_sub_epi32(s.hits, _mm256_castps_si256(near));
    t = _mm256_and_ps(t, near);
    __m256 w = t;
    if constexpr (!kWide) {
      t = _mm256_mul_ps(t, t);
      w = _mm256_mul_ps(t, t);
    }
    const __m256 n_x = _mm256_broadcast_ss(&row.nx[i]);
    s.w = _mm256_add_ps(s.w, w);
    s.px = _mm256_fmadd_ps(w, dx, s.px);
    s.py = _mm256_fmadd_ps(w, _mm256_broadcast_ss(&row.y[i]), s.py);
    s.pz = _mm256_fmadd_ps(w, _mm256_broadcast_ss(&row.z[i]), s.pz);
    s.nx = _mm256_fmadd_ps(w, n_x, s.nx);
    s.ny = _mm256_fmadd_ps(w, _mm256_broadcast_ss(&row.ny[i]), s.ny);
    s.nz = _mm256_fmadd_ps(w, _mm256_broadcast_ss(&row.nz[i]), s.nz);
    s.pp = _mm256_fmadd_ps(w, d2, s.pp);
    const __m256 along = _mm256_fmadd_ps(n_x, dx, _mm256_broadcast_ss(&row.n_yz[i]));

    s.pn = _mm256_fmadd_ps(w, along, s.pn);
    s.pn2 = _mm256_fmadd_ps(_mm256_mul_ps(w, along), along, s.pn2);
  }
  sums = s;
}

}  // namespace tessera
