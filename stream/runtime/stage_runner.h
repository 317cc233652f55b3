/// \file stage_runner.h
/// Runs stages in a folder outside of a job: for commands that need a store for a while and nothing to
/// resume.
#pragma once
#include <filesystem>
#include <functional>
#include <string>
#include <vector>

#include "stream/files/json.h"
#include "stream/runtime/stage.h"

namespace tessera {

/// Runs all tasks of all stages within state.run.memory_bytes and state.run.threads (both > 0) in state.work.
/// What a stage makes obsolete is deleted. Returns what each finish returned. \throws what stages throw,
/// ResourceError when a task exceeds the memory, StoppedError through check_stop
std::vector<Json> run_stages(const JobState& state, const std::vector<StageEntry>& stages,
                             const std::function<void()>& check_stop);

}  // namespace tessera
