/// \file top_stage.h
/// Passes of scenes seen from above whose strewn points the top surface stands in for, or of which it is all that is wanted;
/// no task in others.
///   top         points -> the model of the top surface by brick column, and its samples by brick
///   top-points  points and samples -> the points that the surface is made of, in place of the scan's
#pragma once
#include <cstdint>
#include <memory>

#include "kernels/points/surface_model.h"
#include "stream/points/reconstruct_options.h"
#include "stream/runtime/stage.h"

namespace tessera {

/// What --surface makes the surface model for.
ModelUse model_use(const ReconstructOptions& options);
/// Brick columns along an edge of a task under this cap.
int top_group_columns(const RunOptions& run, ModelUse use);
/// What a task takes at most. \param column_points  of its fullest brick column \param brick_points  of its fullest brick
std::uint64_t top_task_bytes(int group_columns, std::uint64_t column_points, std::uint64_t brick_points,
                             ModelUse use);
/// \param brick_points  of its fullest brick \param samples  in that brick
std::uint64_t top_points_task_bytes(std::uint64_t brick_points, std::uint64_t samples);

std::unique_ptr<Stage> make_top_stage(const JobState& state);
StageForecast forecast_top(const PlannedScan& scan);
std::unique_ptr<Stage> make_top_points_stage(const JobState& state);
StageForecast forecast_top_points(const PlannedScan& scan);

}  // namespace tessera
