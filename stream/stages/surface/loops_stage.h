/// \file loops_stage.h
/// Pass "loops": the boundary loops of the welded mesh that are short enough to be filled. Short ones every
/// brick finds alone, those of which its own vertex has the smallest number. In scenes from above each brick tells its border
/// edges too, and longer loops are chained from them at the end (boundary_chain.h). For longer ones that were asked for border
/// edges are matched over all patches by an external sort, and chained.
#pragma once
#include <cstdint>
#include <memory>
#include <span>

#include "stream/meshes/patch_store.h"
#include "stream/runtime/stage.h"

namespace tessera {

/// What a task over these patches takes at most, and the end over all of them.
std::uint64_t loops_task_bytes(std::span<const PatchEntry> patches);
/// \param max_edges, chained  of the loops to be filled
std::uint64_t loops_finish_bytes(const RunOptions& run, std::uint32_t max_edges, std::uint32_t chained,
                                 std::span<const PatchEntry> patches);

/// Where no holes are filled it has no tasks and leaves no files.
std::unique_ptr<Stage> make_loops_stage(const JobState& state);
StageForecast forecast_loops(const PlannedScan& scan);

}  // namespace tessera
