/// \file cloud_points.h
/// One of the clouds that are compared, on its way: positions in their order, how far they reach, and how far they lie apart.
#pragma once
#include <cstdint>
#include <functional>
#include <span>
#include <vector>

#include "octree/vector.h"
#include "stream/files/spill_buckets.h"
#include "stream/points/point_sample.h"

namespace tessera {

class CloudPoints {
 public:
  explicit CloudPoints(SpillPool& pool);
  /// Positions in order; one that is not finite keeps its place in it.
  void add(const Double3& p);
  void for_each(const std::function<void(std::span<const Double3>)>& sink) const;
  /// Frees the memory of the positions.
  void release() { points_.release(0); }

  std::uint64_t finite() const { return finite_; }
  const Double3& min() const { return min_; }  ///< of the finite ones
  const Double3& max() const { return max_; }

  /// The spacing of half of the surface, by area; 0 where the points are too few to tell. Once, after the last point. It hangs
  /// on the points alone, not on their order.
  double measure_spacing();

 private:
  double guess_spacing(const std::vector<Double3>& sample) const;

  SpillBuckets<Double3> points_;
  PointSampler sampler_;
  std::uint64_t finite_ = 0;
  Double3 min_{}, max_{};
};

}  // namespace tessera
