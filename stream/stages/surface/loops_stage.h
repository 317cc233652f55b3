/// \file loops_stage.h
/// Pass "loops": the boundary loops of the welded mesh that are short enough to be filled. Border edges are found by
/// name in every patch, matched over all of them by an external sort, and chained.
#pragma once
#include <memory>

#include "stream/runtime/stage.h"

namespace tessera {

/// Without --max-hole it has no tasks and leaves no files.
std::unique_ptr<Stage> make_loops_stage(const JobState& state);

}  // namespace tessera
