/// \file point_distances.h
/// Signed distances of any number of points to a mesh of any size: points are dealt to cells of space, measured cell by
/// cell, and their distances come back in the order in which the points came.
#pragma once
#include <cstdint>
#include <filesystem>
#include <limits>
#include <mutex>
#include <optional>
#include <vector>

#include "stream/files/spill_buckets.h"
#include "stream/runtime/memory_budget.h"
#include "stream/runtime/parallel.h"
#include "stream/survey/distance_cells.h"
#include "stream/survey/indexed_records.h"

namespace tessera {

struct PointDistance {
  double value = 0.0;   ///< positive on the outer side of the nearest face; NaN: nothing within the distance
  bool border = false;  ///< the nearest place lies where the surface ends
};

class PointDistances {
 public:
  /// \param max_distance  > 0, units of the mesh, which outlives this
  /// \param memory_bytes  for points on their way, beside what measure() reserves
  PointDistances(const MeshStore& mesh, double max_distance, const std::filesystem::path& temp,
                 std::uint64_t memory_bytes);

  /// What measure() needs at least.
  std::uint64_t fullest_bytes() const;
  /// Points in order; one that is not finite has no distance.
  void add(const Double3& p);
  std::uint64_t count() const { return count_; }
  /// Once, after the last point. Distances hang on mesh and points alone, not on memory or threads.
  /// \throws ResourceError when the budget cannot hold the fullest cell; StoppedError
  void measure(WorkerPool& pool, MemoryBudget& budget);
  /// The distance of the next point, in the order of add(). \pre measure(), not more often than points were added
  PointDistance next() {
    const Measured& m = results_->next();
    return {m.value, m.border != 0};
  }
  std::uint64_t measured() const { return measured_; }  ///< have a distance
  /// How many points were left for the last step: faces were looked for patch by patch.
  std::uint64_t searched() const { return searched_; }

 private:
  struct Placed {
    Double3 position;
    std::uint64_t index = 0;
  };
  struct Measured {
    double value = std::numeric_limits<double>::quiet_NaN();
    std::uint32_t place = 0;
    std::uint32_t border = 0;
  };
  void measure_cell(std::size_t cell);
  void measure_wide(std::size_t cell);
  void measure_wide(std::size_t cell, std::vector<Placed>& points);
  void measure_far(std::span<const Placed> points, MemoryBudget& budget);
  std::vector<PointDistance> measure_within(const MeshBox& box, double reach,
                                            std::span<const Placed> points) const;
  void keep(std::span<const Placed> points, std::span<const PointDistance> distances);

  const MeshStore& mesh_;
  double max_distance_;
  std::uint64_t memory_bytes_;
  DistanceCells cells_;
  std::uint64_t count_ = 0, measured_ = 0, searched_ = 0;
  SpillPool point_pool_, result_pool_;
  std::optional<SpillBuckets<Placed>> points_, unsettled_, far_;
  std::optional<IndexedRecords<Measured>> results_;
  std::mutex mutex_;  ///< of results_, unsettled_ and far_
};

}  // namespace tessera
