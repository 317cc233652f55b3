/// \file normals_stage.h
/// Pass "normals": shape of every point's neighbourhood: normals where none are given, signs where a sensor or an up
/// direction decides them, brick-local patches where not, supporters for cleaning.
/// Pass "links": votes between the patches of neighbouring bricks, by blocks of bricks, and whether the scene was seen from above.
/// Pass "orient": the sides of all patches, and the outlier threshold.
#pragma once
#include <span>

#include "stream/points/point_store.h"
#include "stream/runtime/stage.h"

namespace tessera {

/// What a task over bricks [first, last) of the table takes at most.
std::uint64_t normals_task_bytes(std::span<const BrickEntry> bricks, std::size_t first, std::size_t last);
/// \param boundary  surfels at the faces of the task's bricks, of the brick that has most \param patches  of its largest block
std::uint64_t links_task_bytes(std::uint64_t boundary, std::uint64_t patches);
/// \param bricks  of which columns are looked at from above \param outer  links between blocks
/// \param surfels, patches  of the largest block
std::uint64_t links_finish_bytes(std::uint64_t bricks, std::uint64_t outer, std::uint64_t surfels,
                                 std::uint64_t patches);

/// No task at all when normals are given and cleaning is off.
std::unique_ptr<Stage> make_normals_stage(const JobState& state);
StageForecast forecast_normals(const PlannedScan& scan);
std::unique_ptr<Stage> make_links_stage(const JobState& state);
StageForecast forecast_links(const PlannedScan& scan);
std::unique_ptr<Stage> make_orient_stage(const JobState& state);
StageForecast forecast_orient(const PlannedScan& scan);

}  // namespace tessera
