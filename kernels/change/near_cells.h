/// \file near_cells.h
/// Cells around places that lie close together, collected once for all of them, so that each has to look at these alone.
#pragma once
#include <immintrin.h>

#include <algorithm>
#include <array>
#include <cstdint>
#include <vector>

#include "kernels/change/point_cells.h"
#include "octree/lanes.h"

namespace tessera {

/// All points within `radius` of the segment from middle - depth axis to middle + depth axis.
struct Capsule {
  Double3 middle{};
  Double3 axis{};  ///< unit; any where depth is 0
  double radius = 0.0;
  double depth = 0.0;
};

/// The cells that hold points of a capsule, and maybe others, by x, y, z. What is summed over those that a place looks at hangs
/// on that place alone, not on what else was collected.
class NearCells {
 public:
  void collect(const PointCells& cells, const Capsule& capsule);
  /// Calls use(cell) for the cells for which meets(x, y, z, radius), given the balls around the points of four of them, has its
  /// lane's sign set; in their order.
  template <class Meets, class Use>
  void for_meeting(const Meets& meets, const Use& use) const {
    for (std::size_t begin = 0; begin < cell_.size(); begin += kDoubleLanes) {
      const auto at = [&](const std::vector<double>& v) { return _mm256_loadu_pd(v.data() + begin); };
      auto mask = static_cast<unsigned>(_mm256_movemask_pd(meets(at(x_), at(y_), at(z_), at(radius_))));
      for (; mask != 0; mask &= mask - 1) use(cell_[begin + static_cast<std::size_t>(__builtin_ctz(mask))]);
    }
  }

 private:
  void add(const PointCells& cells, std::uint32_t k);
  void collect_ball(const PointCells& cells, const Double3& middle, double radius);
  void collect_capsule(const PointCells& cells, const Capsule& capsule);
  void pad();

  std::vector<std::uint32_t> cell_;
  std::vector<double> x_, y_, z_, radius_;
};

/// A place in all lanes.
struct PlaceLanes {
  explicit PlaceLanes(const Double3& p)
      : x(_mm256_set1_pd(p[0])), y(_mm256_set1_pd(p[1])), z(_mm256_set1_pd(p[2])) {}
  __m256d x, y, z;
};

/// Points [begin, end) of the cells relative to a place, four at a time: calls use(x, y, z, there), with all bits of the lanes
/// set in `there` that hold a point.
template <class Use>
void for_point_lanes(const PointCells& cells, std::size_t begin, std::size_t end, const PlaceLanes& p,
                     const Use& use) {
  alignas(32) static constexpr std::array<std::int64_t, 8> kMask = {-1, -1, -1, -1, 0, 0, 0, 0};
  for (std::size_t i = begin; i < end; i += kDoubleLanes) {
    const std::size_t lanes = std::min(kDoubleLanes, end - i);
    const __m256i there =
        _mm256_loadu_si256(reinterpret_cast<const __m256i*>(kMask.data() + (kDoubleLanes - lanes)));
    use(_mm256_sub_pd(_mm256_maskload_pd(cells.x().data() + i, there), p.x),
        _mm256_sub_pd(_mm256_maskload_pd(cells.y().data() + i, there), p.y),
        _mm256_sub_pd(_mm256_maskload_pd(cells.z().data() + i, there), p.z), _mm256_castsi256_pd(there));
  }
}

}  // namespace tessera
