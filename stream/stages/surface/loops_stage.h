/// \file loops_stage.h
/// Pass "loops": the boundary loops of the welded mesh that are short enough to be filled. Border edges are found by
/// name in every patch, matched over all of them by an external sort, and chained.
#pragma once
#include <cstdint>
#include <memory>
#include <span>

#include "stream/meshes/patch_store.h"
#include "stream/runtime/stage.h"

namespace tessera {

/// What a task over these patches takes at most, and the end over all of them.
std::uint64_t loops_task_bytes(std::span<const PatchEntry> patches);
std::uint64_t loops_finish_bytes(const RunOptions& run, std::span<const PatchEntry> patches);

/// Without --max-hole it has no tasks and leaves no files.
std::unique_ptr<Stage> make_loops_stage(const JobState& state);

}  // namespace tessera
