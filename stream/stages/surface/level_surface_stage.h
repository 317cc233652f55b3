/// \file level_surface_stage.h
/// Pass "surface" of `reconstruct --levels`: every leaf of the octree (level_files.h) gets its field on its own level and, where
/// bricks of other levels touch it, what it shares with them on theirs; the patches go to the store of the full surface
/// (first_pass.h).
#pragma once
#include <cstdint>
#include <memory>
#include <span>

#include "stream/runtime/stage.h"

namespace tessera {

struct BrickEntry;
struct Plan;
struct ReconstructOptions;

/// Faces that a job is expected to have: plan.faces_estimate with one cell size. Levels make at most about two faces of a
/// point, and never fewer than one cell size does.
double expected_level_faces(const Plan& plan, const ReconstructOptions& options);
/// Most points in a brick and what its neighbours lend it, about a quarter each.
std::uint64_t max_points_near(std::span<const BrickEntry> bricks);

/// What a task takes at most. \param points  most that are loaded at once
std::uint64_t level_surface_task_bytes(std::uint64_t points);

std::unique_ptr<Stage> make_level_surface_stage(const JobState& state);
StageForecast forecast_level_surface(const PlannedScan& scan);

}  // namespace tessera
