/// \file blunt_stage.h
/// Pass "blunt": in noisy scenes from above and in rooms sharp edges are rounded off at the border, before holes are filled, and where what was seen
/// meets what nobody saw, as at walls below crowns and around columns that were filled (kernels/smooth/crease_blunting.h); in sparse scans all that are sharp. Every brick moves its own vertices, for
/// which it sees the faces in the bricks around it. What comes to cross goes back in the pass "uncross".
#pragma once
#include <cstdint>
#include <memory>
#include <span>

#include "stream/meshes/patch_store.h"
#include "stream/runtime/stage.h"

namespace tessera {

/// What a task over these patches takes at most.
std::uint64_t blunt_task_bytes(std::span<const PatchEntry> patches);

std::unique_ptr<Stage> make_blunt_stage(const JobState& state);
StageForecast forecast_blunt(const PlannedScan& scan);

}  // namespace tessera
