/// \file change_distances.h
/// How far one cloud lies from another at its core points, both of any size: points are dealt to tiles, measured tile by tile,
/// and what is found comes back in the order in which the points came.
#pragma once
#include <cstdint>
#include <filesystem>
#include <functional>
#include <limits>
#include <mutex>
#include <optional>
#include <vector>

#include "kernels/change/core_change.h"
#include "stream/change/change_cells.h"
#include "stream/change/change_tiles.h"
#include "stream/change/cloud_points.h"
#include "stream/runtime/memory_budget.h"
#include "stream/runtime/parallel.h"
#include "stream/survey/indexed_records.h"

namespace tessera {

struct FoundChange {
  double distance = std::numeric_limits<double>::quiet_NaN();
  double uncertainty = std::numeric_limits<double>::quiet_NaN();
  std::uint32_t place = 0;
  std::uint8_t core = 0, significant = 0;
};

/// What it came from.
struct ChangeDetails {
  static constexpr double kNone = std::numeric_limits<double>::quiet_NaN();
  std::array<double, 2> spread = {kNone, kNone};
  Double3 normal = {kNone, kNone, kNone};
  std::array<std::uint32_t, 2> count{};
  std::uint32_t place = 0;
};

struct ChangeSettings {
  ChangeRule rule;            ///< the viewpoint, if any, in the coordinates of the scans
  double core_spacing = 0.0;  ///< one core point in a cell of this size; 0 = all points
  bool details = false;
  Double3 origin{};     ///< of the frame in which points are compared: no coordinate lies below it
  double extent = 0.0;  ///< and none lies farther above it
};

class ChangeDistances {
 public:
  /// \param memory_bytes  for points on their way, beside what measure() reserves
  ChangeDistances(const ChangeSettings& settings, const std::filesystem::path& temp,
                  std::uint64_t memory_bytes);

  /// Deals both clouds to tiles and forgets them. \param budget  for tiles  \throws ResourceError when it cannot hold the
  ///   fullest tile
  void deal(CloudPoints& before, CloudPoints& after, int threads, const MemoryBudget& budget);
  /// Once. What is found hangs on points and settings alone. \param advance  gets the points of every tile that is done
  /// \throws StoppedError
  void measure(WorkerPool& pool, MemoryBudget& budget, ChangeCells& cells,
               const std::function<void(std::uint64_t)>& advance);
  /// Of the next point of the old cloud. \pre measure(), not more often than points were added
  const FoundChange& next() { return found_->next(); }
  const ChangeDetails& next_details() { return details_->next(); }

  std::uint64_t core_points() const { return core_points_; }
  std::uint64_t with_distance() const { return with_distance_; }
  std::uint64_t with_noise() const { return with_noise_; }  ///< their level of detection is known
  std::uint64_t significant() const { return significant_; }
  std::uint64_t without_normal() const { return without_normal_; }

 private:
  struct OldPoint {
    Double3 p{};
    std::uint64_t index = 0;
  };
  struct Measured {
    std::uint64_t index = 0;
    FoundChange found;
    ChangeDetails details;
  };
  static Measured measured_of(std::uint64_t index, const CoreChange& change);
  Double3 framed(const Double3& p) const { return p - settings_.origin; }
  std::uint64_t tile_bytes(const ChangeTile& tile) const;
  void measure_tile(std::size_t k, ChangeCells& cells);
  void keep(const std::vector<Measured>& measured, std::span<const PlacedChange> placed, ChangeCells& cells);

  ChangeSettings settings_;
  double cell_size_, halo_;
  std::uint64_t memory_bytes_;
  SpillPool point_pool_, result_pool_;
  std::optional<ChangeTiles> tiles_;
  std::optional<SpillBuckets<OldPoint>> before_;
  std::optional<SpillBuckets<Double3>> after_;
  std::optional<IndexedRecords<FoundChange>> found_;
  std::optional<IndexedRecords<ChangeDetails>> details_;
  std::mutex mutex_;  ///< of all that follows, the results and the cells
  std::uint64_t core_points_ = 0, with_distance_ = 0, with_noise_ = 0, significant_ = 0, without_normal_ = 0;
};

}  // namespace tessera
