/// \file normals_stage.h
/// Pass "normals": shape of every point's neighbourhood: normals where none are given, signs where a sensor or an up
/// direction decides them, brick-local patches where not, supporters for cleaning.
/// Pass "orient": votes between the patches of neighbouring bricks, their solution, and the outlier threshold.
#pragma once
#include <span>

#include "stream/points/point_store.h"
#include "stream/runtime/stage.h"

namespace tessera {

/// What a task over bricks [first, last) of the table takes at most.
std::uint64_t normals_task_bytes(std::span<const BrickEntry> bricks, std::size_t first, std::size_t last);
/// \param boundary  surfels at the faces of the task's bricks, of the brick that has most \param patches  of the task
std::uint64_t orient_task_bytes(std::uint64_t boundary, std::uint64_t patches);

/// No task at all when normals are given and cleaning is off.
std::unique_ptr<Stage> make_normals_stage(const JobState& state);
std::unique_ptr<Stage> make_orient_stage(const JobState& state);

}  // namespace tessera
