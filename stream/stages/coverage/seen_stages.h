/// \file seen_stages.h
/// Passes that keep what a scan saw, for the pass "coverage" to hold the mesh against when the points have gone.
///   seen-spacing  points -> how far apart they lie, by the sixth neighbours of a few hundred of them
///   seen          points -> a sample of those that lie on a surface beyond doubt, and the columns that hold at least four
/// Both read the points of the scan, before any is called strewn or an outlier. What they keep does not depend on order,
/// tiles, cap or threads: a point is in the sample by its place alone.
#pragma once
#include <cstdint>
#include <filesystem>
#include <memory>
#include <span>

#include "stream/points/point_store.h"
#include "stream/points/top_store.h"
#include "stream/runtime/stage.h"

namespace tessera {

/// What of a scan is held against its mesh.
struct SeenScan {
  double spacing = 0.0;      ///< cells; 0 = the points tell none that can be used, and nothing is measured
  std::uint64_t points = 0;  ///< that the job holds
  std::uint64_t stride = 1;  ///< one in so many is looked at
  std::int32_t column_edge = 0;  ///< quanta: four spacings, and a cell at least

  /// Cells; nearer to the mesh a point counts as held by it.
  double near_distance() const { return 2.0 * spacing; }
  /// Of the pass "seen-spacing". \throws InputError where its file is missing or damaged
  static SeenScan of_work(const std::filesystem::path& work);
};

inline constexpr const char* kSeenColumnsFile = "seen/columns.bin";  ///< ColumnMask, ascending key

/// What finding the spacing takes at most, and a task of bricks [first, last), and its end.
std::uint64_t seen_spacing_bytes(std::span<const BrickEntry> bricks);
std::uint64_t seen_task_bytes(std::span<const BrickEntry> bricks, std::size_t first, std::size_t last);
std::uint64_t seen_finish_bytes();

std::unique_ptr<Stage> make_seen_spacing_stage(const JobState& state);
StageForecast forecast_seen_spacing(const PlannedScan& scan);
std::unique_ptr<Stage> make_seen_stage(const JobState& state);
StageForecast forecast_seen(const PlannedScan& scan);

}  // namespace tessera
