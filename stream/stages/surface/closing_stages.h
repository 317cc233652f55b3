/// \file closing_stages.h
/// Passes "multipole", "rims" and "close": which cells close the surface where the data ends. Empty with --holes keep.
///   multipole  oriented points -> multipoles by brick, the global summary of the winding number
///   rims       points -> local field of every tile -> its signs by brick, and the cells where the surface ends
///   close      rims -> closing cells by brick: grown brick by brick, in rounds, until nothing is added. The set does
///              not depend on the order (closing.h), so neither does it on tiles or threads
#pragma once
#include <string>

#include "kernels/closing/closing.h"
#include "stream/points/plan.h"
#include "stream/runtime/stage.h"

namespace tessera {

/// Farthest that the closing of an open sheet reaches when no distance is given, cells.
inline constexpr double kDefaultSheetLimit = 20.0;

/// `--holes` as the stages read it.
struct HolesMode {
  bool close = false;
  double limit = 0.0;  ///< scan units; 0 = none given

  /// \throws UsageError for anything but keep, close and fill-to:D
  explicit HolesMode(const std::string& text);
};

/// How a job closes: decided by the close stage, read by the surface stage.
ClosingOptions load_closing_options(const std::filesystem::path& work);

/// What a task takes at most. \param brick_points  of its largest brick
std::uint64_t multipole_task_bytes(std::uint64_t brick_points);

/// What growing the closing cells depends on.
struct CloseCounts {
  std::uint64_t visit_points = 0;  ///< of a brick and its halo
  std::uint64_t near_bytes = 0;    ///< of the multipoles around it
  std::uint64_t far_bytes = 0;     ///< of the summary of all bricks
  std::uint64_t boundaries = 0;    ///< cells where the surface ends
};
/// What the close stage takes at most.
std::uint64_t close_bytes(const RunOptions& run, const CloseCounts& counts);

std::unique_ptr<Stage> make_multipole_stage(const JobState& state);
StageForecast forecast_multipole(const PlannedScan& scan);
std::unique_ptr<Stage> make_boundaries_stage(const JobState& state);
StageForecast forecast_boundaries(const PlannedScan& scan);
std::unique_ptr<Stage> make_close_stage(const JobState& state);
StageForecast forecast_close(const PlannedScan& scan);

}  // namespace tessera
