/// \file islands_stage.h
/// Passes "islands" and "prune" of a reconstruction whose first pass of decimation is fused (first_pass.h): components
/// are joined across blocks and counted by faces of the full-resolution surface, as everywhere; those that are too
/// small go from it and from what the first pass left of it.
#pragma once
#include <cstdint>
#include <memory>

#include "stream/runtime/stage.h"

namespace tessera {

/// What joining the components takes at most. \param parts  components of all blocks
std::uint64_t islands_bytes(const RunOptions& run, std::uint64_t parts);
/// What a task of the prune stage takes at most. \param block_bytes  of its largest block, MeshStore::block_bytes
std::uint64_t prune_task_bytes(std::uint64_t block_bytes);

/// Without tasks: its finish joins the components.
std::unique_ptr<Stage> make_islands_stage(const JobState& state);
StageForecast forecast_islands(const PlannedScan& scan);
/// One task for each file of the surface stage that holds a part of an island that goes.
std::unique_ptr<Stage> make_prune_stage(const JobState& state);
StageForecast forecast_prune(const PlannedScan& scan);

}  // namespace tessera
