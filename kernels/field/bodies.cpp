#include "kernels/field/bodies.h"

#include <algorithm>
#include <bit>
#include <cmath>

#include "kernels/field/node_sums.h"
#include "octree/vector.h"

namespace tessera {
namespace {

/// Density at the surface of a body, as the sum of weights (1 - d^2/r^2)^4 over occupied cells. Where every cell is
/// occupied it is 30; a lone point has 1 at most.
constexpr float kLevel = 1.5f;
/// Slope of the fourth root of the density from which on it tells distances: below, in saddles between points, it tells
/// too large ones.
constexpr float kMinSlope = 0.2f;
/// Values stay within that, cells; nodes farther out get none.
constexpr float kFarthest = 3.0f;
/// Within that of oriented samples they tell whether a node lies under their surface, cells.
constexpr float kUnderRadius = 5.0f;
/// Fewest mean normals that tell it: fewer are bits of crowns that happen to look like a surface.
constexpr int kUnderHits = 6;

/// Density and its gradient at eight nodes in a row.
struct Density {
  __m256 sum = _mm256_setzero_ps(), x = sum, y = sum, z = sum;
};

void add_density(const RowSamples& row, Density& density) {
  const __m256 node_x = _mm256_setr_ps(0, 1, 2, 3, 4, 5, 6, 7);
  const __m256 one = _mm256_set1_ps(1.0f), scale = _mm256_set1_ps(1.0f / (kBodyRadius * kBodyRadius));
  Density s = density;
  for (std::size_t i = 0; i < row.size; ++i) {
    const __m256 dx = _mm256_sub_ps(_mm256_broadcast_ss(&row.x[i]), node_x);
    const __m256 d2 = _mm256_fmadd_ps(dx, dx, _mm256_broadcast_ss(&row.yz2[i]));
    const __m256 t = _mm256_max_ps(_mm256_fnmadd_ps(d2, scale, one), _mm256_setzero_ps());
    const __m256 t2 = _mm256_mul_ps(t, t), t3 = _mm256_mul_ps(t2, t);
    s.sum = _mm256_fmadd_ps(t2, t2, s.sum);
    s.x = _mm256_fmadd_ps(t3, dx, s.x);
    s.y = _mm256_fmadd_ps(t3, _mm256_broadcast_ss(&row.y[i]), s.y);
    s.z = _mm256_fmadd_ps(t3, _mm256_broadcast_ss(&row.z[i]), s.z);
  }
  density = s;
}

/// The fourth root of the density falls nearly evenly towards the end of its support, so its slope tells distances.
SurfaceValue value_of(float density, const Float3& towards) {
  const float slope = 8.0f / (kBodyRadius * kBodyRadius) * norm(towards);
  const float root = std::sqrt(std::sqrt(density));
  const float root_slope = std::max(0.25f * slope * root / density, kMinSlope);
  static const float level = std::sqrt(std::sqrt(kLevel));
  const float above = level - root;
  SurfaceValue v;
  v.value = std::clamp(above / root_slope, -kFarthest, kFarthest);
  v.normal = unit_or_zero(towards * -1.0f);
  return v;
}

/// Nodes of a row that lie under the surface of oriented samples: the air around a body says nothing of what is there.
std::uint32_t under_surface(const SampleList& coarse, std::size_t y, std::size_t z, RowSamples& row) {
  const RowSupport support = {.y0 = static_cast<float>(y),
                              .z0 = static_cast<float>(z),
                              .low_x = -kUnderRadius,
                              .high_x = 7.0f + kUnderRadius,
                              .r2 = kUnderRadius * kUnderRadius};
  NodeSums sums;
  clear(sums);
  for (std::size_t next = 0; next < coarse.size;) {
    fill_row(coarse, support, &next, row);
    accumulate<true>(row, support.r2, 1.0f / support.r2, sums);
  }
  const __m256 inside = _mm256_cmp_ps(sums.pn, _mm256_setzero_ps(), _CMP_GT_OQ);
  const __m256i enough = _mm256_cmpgt_epi32(sums.hits, _mm256_set1_epi32(kUnderHits - 1));
  return static_cast<std::uint32_t>(_mm256_movemask_ps(_mm256_and_ps(inside, _mm256_castsi256_ps(enough))));
}

/// Takes the sheets of some creased nodes of a leaf away.
void drop_sheets(const std::array<std::uint64_t, 8>& gone, LeafFit& fit, std::vector<Sheets>& sheets) {
  std::size_t first = sheets.size();
  for (std::size_t z = 0; z < 8; ++z)
    if (fit.creased[z]) first = std::min<std::size_t>(first, fit.first_sheets[z]);
  std::size_t to = first;
  for (std::size_t z = 0; z < 8; ++z) {
    std::size_t from = fit.first_sheets[z];
    fit.first_sheets[z] = static_cast<std::uint32_t>(to);
    for (std::uint64_t left = fit.creased[z]; left; left &= left - 1, ++from)
      if (!(gone[z] & left & (~left + 1))) sheets[to++] = sheets[from];
    fit.creased[z] &= ~gone[z];
  }
  sheets.resize(to);
}

}  // namespace

PointBlock volumetric_points(const PointBlock& points) {
  PointBlock out;
  out.origin = points.origin;
  out.cells = points.cells;
  Float3 cell = {0, 0, 0};
  for (std::size_t p = 0; p < points.size(); ++p) {
    if (points.nx[p] != 0.0f || points.ny[p] != 0.0f || points.nz[p] != 0.0f) continue;
    const Float3 at = {std::floor(points.x[p]), std::floor(points.y[p]), std::floor(points.z[p])};
    if (out.size() > 0 && at == cell) continue;  // canonical order: the points of a cell follow each other
    cell = at;
    out.x.push_back(points.x[p]), out.y.push_back(points.y[p]), out.z.push_back(points.z[p]);
    if (!points.rgba.empty()) out.rgba.push_back(points.rgba[p]);
  }
  out.nx.assign(out.size(), 0.0f), out.ny = out.nx, out.nz = out.nx;
  return out;
}

void add_body_leaves(const PointLeaves& volumetric, std::vector<BandNodes>& band) {
  std::vector<std::uint8_t> near(volumetric.range.size(), 0);
  for (int k = -1; k < volumetric.dims[2] - 1; ++k)
    for (int j = -1; j < volumetric.dims[1] - 1; ++j)
      for (int i = -1; i < volumetric.dims[0] - 1; ++i) {
        const PointLeaves::Range& range = volumetric.range[volumetric.at(i, j, k)];
        if (range.begin == range.end) continue;
        for (int d = 0; d < 27; ++d) {
          const Int3 at = {i + d % 3 - 1, j + d / 3 % 3 - 1, k + d / 9 - 1};
          if (volumetric.holds(at[0], at[1], at[2])) near[volumetric.at(at[0], at[1], at[2])] = 1;
        }
      }
  for (const BandNodes& b : band) near[b.leaf] = 0;
  for (std::size_t leaf = 0; leaf < near.size(); ++leaf)
    if (near[leaf]) band.push_back({static_cast<std::uint32_t>(leaf), {}});
  std::sort(band.begin(), band.end(), [](const BandNodes& a, const BandNodes& b) { return a.leaf < b.leaf; });
}

void join_bodies(const BodyPoints& points, const Int3& leaf, const std::array<std::uint64_t, 8>& nodes,
                 BodyScratch& scratch, LeafFit& fit, LeafBoundary& boundary, std::vector<Sheets>& sheets) {
  constexpr float kLow = -kBodyRadius, kHigh = 7.0f + kBodyRadius;
  gather_all(points.volumetric, points.volumetric_leaves, leaf[0], leaf[1], leaf[2],
             {{kLow, kLow, kLow}, {kHigh, kHigh, kHigh}}, scratch.samples);
  if (scratch.samples.size == 0) return;
  constexpr float kUnderLow = -kUnderRadius, kUnderHigh = 7.0f + kUnderRadius;
  gather_samples(points.coarse, points.coarse_leaves, leaf[0], leaf[1], leaf[2],
                 {{kUnderLow, kUnderLow, kUnderLow}, {kUnderHigh, kUnderHigh, kUnderHigh}}, scratch.coarse);
  std::array<std::uint64_t, 8> taken{};
  for (std::size_t z = 0; z < 8; ++z) {
    if (!nodes[z]) continue;
    fill_slab(scratch.samples, static_cast<float>(z), kBodyRadius, scratch.slab);
    for (std::size_t y = 0; y < 8; ++y) {
      const auto wanted = static_cast<std::uint32_t>(nodes[z] >> (8 * y) & 0xff);
      if (!wanted) continue;
      const RowSupport support = {.y0 = static_cast<float>(y),
                                  .z0 = static_cast<float>(z),
                                  .low_x = kLow,
                                  .high_x = kHigh,
                                  .r2 = kBodyRadius * kBodyRadius};
      Density density;
      for (std::size_t next = 0; next < scratch.slab.size;) {
        fill_row(scratch.slab, support, &next, scratch.row);
        add_density(scratch.row, density);
      }
      alignas(32) std::array<float, kLanes> sum, gx, gy, gz;
      _mm256_store_ps(sum.data(), density.sum);
      _mm256_store_ps(gx.data(), density.x);
      _mm256_store_ps(gy.data(), density.y);
      _mm256_store_ps(gz.data(), density.z);
      const std::uint32_t under =
          scratch.coarse.size > 0 ? under_surface(scratch.coarse, y, z, scratch.row) : 0u;
      for (std::uint32_t left = wanted; left; left &= left - 1) {
        const auto x = static_cast<std::size_t>(std::countr_zero(left));
        const std::size_t i = 64 * z + 8 * y + x;
        const std::uint64_t bit = std::uint64_t{1} << (8 * y + x);
        const SurfaceValue body =
            sum[x] > 0.0f ? value_of(sum[x], {gx[x], gy[x], gz[x]}) : SurfaceValue{kFarthest, {0, 0, 0}};
        if (body.value >= kFarthest) continue;
        const bool beyond = (boundary.nodes[z] & bit) != 0 && boundary.depth[i] < kBorderDepth;
        if ((fit.valid[z] & bit) && !beyond && fit.value[i] <= body.value) continue;
        if (body.value > 0.0f && (under >> x & 1)) continue;
        taken[z] |= bit;
        fit.value[i] = body.value;
        for (std::size_t c = 0; c < 3; ++c) fit.gradient[c][i] = body.normal[c];
      }
    }
  }
  drop_sheets(taken, fit, sheets);
  for (std::size_t z = 0; z < 8; ++z) {
    fit.valid[z] |= taken[z];
    boundary.nodes[z] &= ~taken[z];
  }
}

}  // namespace tessera
