/// \file uncross_stage.h
/// Pass "uncross": where faces cross because features or borders moved their vertices, these go back to where extraction had
/// them within their cells. In each round all that may go back of two faces that cross do; the last round only counts.
#pragma once
#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "stream/meshes/patch_store.h"
#include "stream/runtime/stage.h"
#include "stream/stages/weld/written_positions.h"

namespace tessera {

/// What a task over these patches takes at most.
std::uint64_t uncross_task_bytes(std::span<const PatchEntry> patches);

/// A stage for each round, to stand behind "weld" and, in a job that has it, "border". Faces are compared where the output holds them.
std::vector<StageEntry> uncross_stages(const WrittenBy& written);

}  // namespace tessera
