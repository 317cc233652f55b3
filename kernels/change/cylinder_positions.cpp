#include "kernels/change/cylinder_positions.h"

#include <immintrin.h>

#include <algorithm>
#include <array>
#include <cmath>

namespace tessera {
namespace {

constexpr std::size_t kAxialLanes = 4;
/// A cell is passed over where rounding decides nothing.
constexpr double kSurelyOut = 1.0 + 1e-9;

/// Cells that a capsule around the cylinder may meet: columns by x, then the part of the axis near to each row of y.
template <class Use>
void for_cylinder_cells(const PointCells& cells, const Cylinder& c, const Use& use) {
  const double radius = c.radius * kSurelyOut + cells.size() * 1e-6;
  const auto part = [&](double low, double high, std::size_t a, double& begin, double& end) {
    // Where along the axis its coordinate a comes within the radius of [low, high].
    const double from = low - radius - c.middle[a], to = high + radius - c.middle[a];
    if (std::abs(c.axis[a]) < 1e-12) {
      if (from > 0.0 || to < 0.0) end = begin - 1.0;
      return;
    }
    const double u = from / c.axis[a], v = to / c.axis[a];
    begin = std::max(begin, std::min(u, v)), end = std::min(end, std::max(u, v));
  };
  const auto reach = [&](std::size_t a, double begin, double end, std::int32_t& low, std::int32_t& high) {
    const double u = c.middle[a] + begin * c.axis[a], v = c.middle[a] + end * c.axis[a];
    low = cells.cell_of(std::min(u, v) - radius), high = cells.cell_of(std::max(u, v) + radius);
  };
  std::int32_t x_low = 0, x_high = 0;
  reach(0, -c.depth, c.depth, x_low, x_high);
  for (std::int32_t x = x_low; x <= x_high; ++x) {
    double begin = -c.depth, end = c.depth;
    part(x * cells.size(), (x + 1) * cells.size(), 0, begin, end);
    if (begin > end) continue;
    std::int32_t y_low = 0, y_high = 0;
    reach(1, begin, end, y_low, y_high);
    for (std::int32_t y = y_low; y <= y_high; ++y) {
      double first = begin, last = end;
      part(y * cells.size(), (y + 1) * cells.size(), 1, first, last);
      if (first > last) continue;
      std::int32_t z_low = 0, z_high = 0;
      reach(2, first, last, z_low, z_high);
      cells.for_column_cells(x, y, y, z_low, z_high, use);
    }
  }
}

bool may_meet(const PointCell& cell, const Cylinder& c) {
  const Double3 v = cell.middle - c.middle;
  const double along = dot(v, c.axis), outer = c.radius + cell.radius;
  if (std::abs(along) > (c.depth + cell.radius) * kSurelyOut) return false;
  return dot(v, v) - along * along <= outer * outer * kSurelyOut + along * along * 1e-12;
}

__m256i first_axial_lanes(std::size_t count) {
  alignas(32) static constexpr std::array<std::int64_t, 8> kMask = {-1, -1, -1, -1, 0, 0, 0, 0};
  return _mm256_loadu_si256(reinterpret_cast<const __m256i*>(kMask.data() + (kAxialLanes - count)));
}

/// Calls use(along, in) for the points of a cell, four at a time: their positions along the axis, and which of them lie in the
/// cylinder. No fused products: membership is that of plain arithmetic.
template <class Use>
void for_points(const PointCells& cells, const PointCell& cell, const Cylinder& c, const Use& use) {
  const __m256d px = _mm256_set1_pd(c.middle[0]), py = _mm256_set1_pd(c.middle[1]),
                pz = _mm256_set1_pd(c.middle[2]);
  const __m256d ax = _mm256_set1_pd(c.axis[0]), ay = _mm256_set1_pd(c.axis[1]),
                az = _mm256_set1_pd(c.axis[2]);
  const __m256d square = _mm256_set1_pd(c.radius * c.radius), depth = _mm256_set1_pd(c.depth);
  const __m256d sign = _mm256_set1_pd(-0.0);
  for (std::size_t i = cell.begin; i < cell.end; i += kAxialLanes) {
    const __m256i there = first_axial_lanes(std::min<std::size_t>(kAxialLanes, cell.end - i));
    const __m256d x = _mm256_sub_pd(_mm256_maskload_pd(cells.x().data() + i, there), px);
    const __m256d y = _mm256_sub_pd(_mm256_maskload_pd(cells.y().data() + i, there), py);
    const __m256d z = _mm256_sub_pd(_mm256_maskload_pd(cells.z().data() + i, there), pz);
    const __m256d along =
        _mm256_add_pd(_mm256_add_pd(_mm256_mul_pd(x, ax), _mm256_mul_pd(y, ay)), _mm256_mul_pd(z, az));
    const __m256d d2 =
        _mm256_add_pd(_mm256_add_pd(_mm256_mul_pd(x, x), _mm256_mul_pd(y, y)), _mm256_mul_pd(z, z));
    const __m256d off = _mm256_sub_pd(d2, _mm256_mul_pd(along, along));
    __m256d in = _mm256_and_pd(_mm256_cmp_pd(off, square, _CMP_LE_OQ),
                               _mm256_cmp_pd(_mm256_andnot_pd(sign, along), depth, _CMP_LE_OQ));
    in = _mm256_and_pd(in, _mm256_castsi256_pd(there));
    use(along, in);
  }
}

double axial_sum(__m256d v) {
  alignas(32) std::array<double, kAxialLanes> lane{};
  _mm256_store_pd(lane.data(), v);
  return (lane[0] + lane[2]) + (lane[1] + lane[3]);
}

AxialPositions mean_of(const PointCells& cells, const Cylinder& c) {
  __m256d n = _mm256_setzero_pd(), sum = n, squares = n, shift = n;
  bool shifted = false;
  const __m256d one = _mm256_set1_pd(1.0);
  double origin = 0.0;
  for_cylinder_cells(cells, c, [&](std::uint32_t k) {
    const PointCell& cell = cells.cells()[k];
    if (!may_meet(cell, c)) return;
    if (!shifted) {  // squares of what is left do not cancel
      origin = dot(cell.middle - c.middle, c.axis);
      shift = _mm256_set1_pd(origin), shifted = true;
    }
    for_points(cells, cell, c, [&](__m256d along, __m256d in) {
      const __m256d u = _mm256_and_pd(_mm256_sub_pd(along, shift), in);
      n = _mm256_add_pd(n, _mm256_and_pd(one, in));
      sum = _mm256_add_pd(sum, u);
      squares = _mm256_add_pd(squares, _mm256_mul_pd(u, u));
    });
  });
  AxialPositions out;
  const double count = axial_sum(n);
  out.count = static_cast<std::uint64_t>(count);
  if (out.count == 0) return out;
  const double mean = axial_sum(sum) / count;
  out.mean = origin + mean;
  if (out.count > 1)
    out.spread = std::sqrt(std::max(0.0, axial_sum(squares) - count * mean * mean) / (count - 1.0));
  return out;
}

/// \pre values ascend, there are some
double quantile(const std::vector<double>& values, double share) {
  const double at = share * static_cast<double>(values.size() - 1), below = std::floor(at);
  const auto i = static_cast<std::size_t>(below);
  const double next = values[std::min(i + 1, values.size() - 1)];
  return values[i] + (at - below) * (next - values[i]);
}

AxialPositions median_of(const PointCells& cells, const Cylinder& c, std::vector<double>& values) {
  values.clear();
  for_cylinder_cells(cells, c, [&](std::uint32_t k) {
    const PointCell& cell = cells.cells()[k];
    if (!may_meet(cell, c)) return;
    for_points(cells, cell, c, [&](__m256d along, __m256d in) {
      alignas(32) std::array<double, kAxialLanes> lane{};
      _mm256_store_pd(lane.data(), along);
      const int mask = _mm256_movemask_pd(in);
      for (std::size_t l = 0; l < kAxialLanes; ++l)
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

AxialPositions axial_positions(const PointCells& cells, const Cylinder& cylinder, bool median,
                               std::vector<double>& work) {
  if (cells.empty()) return {};
  return median ? median_of(cells, cylinder, work) : mean_of(cells, cylinder);
}

}  // namespace tessera
