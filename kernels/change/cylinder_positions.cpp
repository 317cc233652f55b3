#include "kernels/change/cylinder_positions.h"

#include <immintrin.h>

#include <algorithm>
#include <array>
#include <cmath>

namespace tessera {
namespace {

/// A cell is passed over where rounding decides nothing.
constexpr double kSurelyOut = 1.0 + 1e-9;

/// A cylinder in all lanes.
struct CylinderLanes {
  explicit CylinderLanes(const Cylinder& c)
      : middle(c.middle),
        axis(c.axis),
        radius(_mm256_set1_pd(c.radius)),
        square(_mm256_set1_pd(c.radius * c.radius)),
        depth(_mm256_set1_pd(c.depth)) {}
  PlaceLanes middle, axis;
  __m256d radius, square, depth;
};

/// Where along the axis and at which square beside it. No fused products: membership is that of plain arithmetic.
struct AxialLanes {
  AxialLanes(const CylinderLanes& c, __m256d x, __m256d y, __m256d z)
      : along(_mm256_add_pd(_mm256_add_pd(_mm256_mul_pd(x, c.axis.x), _mm256_mul_pd(y, c.axis.y)),
                            _mm256_mul_pd(z, c.axis.z))),
        size(_mm256_andnot_pd(_mm256_set1_pd(-0.0), along)),
        all(_mm256_add_pd(_mm256_add_pd(_mm256_mul_pd(x, x), _mm256_mul_pd(y, y)), _mm256_mul_pd(z, z))),
        beside(_mm256_sub_pd(all, _mm256_mul_pd(along, along))) {}
  __m256d along, size, all, beside;
};

/// Calls use(cell) for cells that may hold points of the cylinder.
template <class Use>
void for_meeting_cells(const PointCells& cells, const NearCells& near, const CylinderLanes& c,
                       const Use& use) {
  const __m256d sure = _mm256_set1_pd(kSurelyOut), rounding = _mm256_set1_pd(1e-12);
  near.for_meeting(
      [&](__m256d x, __m256d y, __m256d z, __m256d r) {
        const AxialLanes at(c, _mm256_sub_pd(x, c.middle.x), _mm256_sub_pd(y, c.middle.y),
                            _mm256_sub_pd(z, c.middle.z));
        const __m256d outer = _mm256_add_pd(c.radius, r);
        const __m256d limit =
            _mm256_add_pd(_mm256_mul_pd(_mm256_mul_pd(outer, outer), sure), _mm256_mul_pd(at.all, rounding));
        return _mm256_and_pd(
            _mm256_cmp_pd(at.beside, limit, _CMP_LE_OQ),
            _mm256_cmp_pd(at.size, _mm256_mul_pd(_mm256_add_pd(c.depth, r), sure), _CMP_LE_OQ));
      },
      [&](std::uint32_t k) { use(cells.cells()[k]); });
}

/// Calls use(along, in) for the points of a cell, four at a time: their positions along the axis, and which of them lie in the
/// cylinder.
template <class Use>
void for_points(const PointCells& cells, const PointCell& cell, const CylinderLanes& c, const Use& use) {
  for_point_lanes(cells, cell.begin, cell.end, c.middle, [&](__m256d x, __m256d y, __m256d z, __m256d there) {
    const AxialLanes at(c, x, y, z);
    const __m256d in = _mm256_and_pd(_mm256_cmp_pd(at.beside, c.square, _CMP_LE_OQ),
                                     _mm256_cmp_pd(at.size, c.depth, _CMP_LE_OQ));
    use(at.along, _mm256_and_pd(in, there));
  });
}

AxialPositions mean_of(const PointCells& cells, const NearCells& near, const Cylinder& c) {
  const CylinderLanes lanes(c);
  __m256d n = _mm256_setzero_pd(), sum = n, squares = n, shift = n;
  bool shifted = false;
  const __m256d one = _mm256_set1_pd(1.0);
  double origin = 0.0;
  for_meeting_cells(cells, near, lanes, [&](const PointCell& cell) {
    for_points(cells, cell, lanes, [&](__m256d along, __m256d in) {
      if (!shifted) {  // by the first of the points, so that squares of what is left do not cancel
        const int mask = _mm256_movemask_pd(in);
        if (mask == 0) return;
        alignas(32) std::array<double, kDoubleLanes> lane{};
        _mm256_store_pd(lane.data(), along);
        origin = lane[static_cast<std::size_t>(__builtin_ctz(static_cast<unsigned>(mask)))];
        shift = _mm256_set1_pd(origin), shifted = true;
      }
      const __m256d u = _mm256_and_pd(_mm256_sub_pd(along, shift), in);
      n = _mm256_add_pd(n, _mm256_and_pd(one, in));
      sum = _mm256_add_pd(sum, u);
      squares = _mm256_add_pd(squares, _mm256_mul_pd(u, u));
    });
  });
  AxialPositions out;
  const double count = lane_sum(n);
  out.count = static_cast<std::uint64_t>(count);
  if (out.count == 0) return out;
  const double mean = lane_sum(sum) / count;
  out.mean = origin + mean;
  if (out.count > 1)
    out.spread = std::sqrt(std::max(0.0, lane_sum(squares) - count * mean * mean) / (count - 1.0));
  return out;
}

/// \pre values ascend, there are some
double quantile(const std::vector<double>& values, double share) {
  const double at = share * static_cast<double>(values.size() - 1), below = std::floor(at);
  const auto i = static_cast<std::size_t>(below);
  const double next = values[std::min(i + 1, values.size() - 1)];
  return values[i] + (at - below) * (next - values[i]);
}

AxialPositions median_of(const PointCells& cells, const NearCells& near, const Cylinder& c,
                         std::vector<double>& values) {
  const CylinderLanes lanes(c);
  values.clear();
  for_meeting_cells(cells, near, lanes, [&](const PointCell& cell) {
    for_points(cells, cell, lanes, [&](__m256d along, __m256d in) {
      alignas(32) std::array<double, kDoubleLanes> lane{};
      _mm256_store_pd(lane.data(), along);
      const int mask = _mm256_movemask_pd(in);
      for (std::size_t l = 0; l < kDoubleLanes; ++l)
        if ((mask >> l & 1) != 0) values.push_back(lane[l]);
    });
  });
  AxialPositions out;
  out.count = values.size();
  if (values.empty()) return out;
  std::sort(values.begin(), values.end());
  out.mean = quantile(values, 0.5);
  out.spread = quantile(values, 0.75) - quantile(values, 0.25);
  return out;
}

}  // namespace

AxialPositions axial_positions(const PointCells& cells, const NearCells& near, const Cylinder& cylinder,
                               bool median, std::vector<double>& work) {
  return median ? median_of(cells, near, cylinder, work) : mean_of(cells, near, cylinder);
}

}  // namespace tessera
