/// \file ground_stages.h
/// Passes of --surface ground and --vegetation drop, of scenes seen from above; no task in others.
///   ground-cells  points -> the lowest heights of cells of columns, by brick column
///   ground        lowest heights -> the terrain, by blocks of cells with their halo
/// The top stages make the surface model of it.
#pragma once
#include <cstdint>
#include <memory>

#include "kernels/points/ground_filter.h"
#include "kernels/points/roof_cells.h"
#include "stream/points/plan.h"
#include "stream/points/reconstruct_options.h"
#include "stream/runtime/stage.h"

namespace tessera {

/// Cells and rules of the ground filter in columns of the lattice: functions of options and plan alone.
struct GroundSetup {
  int cell_columns = 2;    ///< along the edge of a cell
  GroundRules rules;       ///< in quanta
  RoofRules roofs;         ///< in quanta; of --vegetation drop
  std::int32_t depth = 0;  ///< find_terrain_cells()
};
/// \throws UsageError for a window of too many cells
GroundSetup ground_setup(const ReconstructOptions& options, const Plan& plan);
GroundSetup ground_setup(const JobState& state);

/// Brick columns of a task of the first pass, at most.
inline constexpr int kGroundTaskColumns = 64;
/// \param column_points  of the fullest brick column of the task \param brick_points  of its fullest brick
std::uint64_t ground_cells_task_bytes(std::uint64_t column_points, std::uint64_t brick_points);
/// \param width, height  of the scene, brick columns
std::uint64_t ground_task_bytes(const GroundSetup& setup, std::int64_t width, std::int64_t height);
/// Of its end. \param columns  brick columns that have points
std::uint64_t ground_finish_bytes(std::uint64_t columns);
/// Its tasks where every brick column of such a scene has points, at most.
std::uint64_t ground_tasks(const GroundSetup& setup, std::int64_t width, std::int64_t height);

std::unique_ptr<Stage> make_ground_cells_stage(const JobState& state);
StageForecast forecast_ground_cells(const PlannedScan& scan);
std::unique_ptr<Stage> make_ground_stage(const JobState& state);
StageForecast forecast_ground(const PlannedScan& scan);

}  // namespace tessera
