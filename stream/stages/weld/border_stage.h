/// \file border_stage.h
/// Pass "border": where a noisy scan ends, its border becomes a smooth line (kernels/smooth/border_fairing.h). Every brick
/// moves its own vertices, for which it sees the faces at the border in the bricks around it. Exact samples (no noise)
/// leave it nothing to do: their border is where they say.
#pragma once
#include <cstdint>
#include <memory>
#include <span>

#include "stream/meshes/patch_store.h"
#include "stream/runtime/stage.h"

namespace tessera {

/// What a task over these patches takes at most.
std::uint64_t border_task_bytes(std::span<const PatchEntry> patches);

std::unique_ptr<Stage> make_border_stage(const JobState& state);
StageForecast forecast_border(const PlannedScan& scan);

}  // namespace tessera
