/// \file point_distances.h
/// Signed distances of any number of points to a mesh of any size, or their feet on it: points are dealt to cells of space,
/// measured cell by cell, and what was found comes back in the order in which the points came.
#pragma once
#include <cstdint>
#include <filesystem>
#include <limits>
#include <mutex>
#include <optional>
#include <vector>

#include "kernels/mesh/signed_distance.h"
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

/// The nearest place on a mesh.
struct PointFoot {
  double distance = 0.0;  ///< signed; NaN: nothing within the distance
  Double3 at{};           ///< in the frame of the mesh
  Double3 normal{};       ///< unit pseudo-normal (signed_distance.h), or zero
  bool border = false;    ///< the surface ends there
};

/// As both are kept until they are asked for.
struct DistanceRecord {
  double value = std::numeric_limits<double>::quiet_NaN();
  std::uint32_t place = 0;
  std::uint32_t border = 0;
  bool known() const { return value == value; }
  /// \param p  relative to the origin of the surface
  static DistanceRecord of(const Double3& p, const SignedDistance::Foot& foot, const Double3& origin);
  PointDistance found() const { return {value, border != 0}; }
};
struct FootRecord {
  DistanceRecord distance;
  Double3 at{}, normal{};
  std::uint32_t place = 0, unused = 0;
  bool known() const { return distance.known(); }
  static FootRecord of(const Double3& p, const SignedDistance::Foot& foot, const Double3& origin);
  PointFoot found() const { return {distance.value, at, normal, distance.border != 0}; }
};

/// \tparam Record  DistanceRecord or FootRecord
template <class Record>
class PointSearch {
 public:
  /// \param max_distance  > 0, units of the mesh, which outlives this
  /// \param memory_bytes  for points on their way, beside what measure() reserves
  PointSearch(const MeshStore& mesh, double max_distance, const std::filesystem::path& temp,
              std::uint64_t memory_bytes);

  /// What measure() needs at least.
  std::uint64_t fullest_bytes() const;
  /// Points in order; one that is not finite has no distance.
  void add(const Double3& p);
  std::uint64_t count() const { return count_; }
  /// Once, after the last point. Distances hang on mesh and points alone, not on memory or threads.
  /// \throws ResourceError when the budget cannot hold the fullest cell; StoppedError
  void measure(WorkerPool& pool, MemoryBudget& budget);
  /// What was found for the next point, in the order of add(). \pre measure(), not more often than points were added
  auto next() { return results_->next().found(); }
  std::uint64_t measured() const { return measured_; }  ///< have a distance
  /// How many points were left for the last step: faces were looked for patch by patch.
  std::uint64_t searched() const { return searched_; }

 private:
  struct Placed {
    Double3 position;
    std::uint64_t index = 0;
  };
  void measure_cell(std::size_t cell);
  void measure_wide(std::size_t cell);
  void measure_wide(std::size_t cell, std::vector<Placed>& points);
  void measure_far(std::span<const Placed> points, MemoryBudget& budget);
  std::vector<Record> measure_within(const MeshBox& box, double reach, std::span<const Placed> points) const;
  void measure_by(const SignedDistance& surface, double reach, std::span<const Placed> points,
                  std::vector<Record>& found) const;
  void keep(std::span<const Placed> points, std::span<const Record> found);

  const MeshStore& mesh_;
  double max_distance_;
  std::uint64_t memory_bytes_;
  DistanceCells cells_;
  std::uint64_t count_ = 0, measured_ = 0, searched_ = 0;
  SpillPool point_pool_, result_pool_;
  std::optional<SpillBuckets<Placed>> points_, unsettled_, far_;
  std::optional<IndexedRecords<Record>> results_;
  std::mutex mutex_;  ///< of results_, unsettled_ and far_
};

using PointDistances = PointSearch<DistanceRecord>;
using PointFeet = PointSearch<FootRecord>;

}  // namespace tessera
