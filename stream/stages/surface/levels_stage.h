/// \file levels_stage.h
/// Pass "levels" of `reconstruct --levels`: how small the cells may be, place by place.
#pragma once
#include <memory>

#include "stream/runtime/stage.h"

namespace tessera {

/// Per file of points one task that counts, in every brick and then in every eighth of what is split, the cells that hold
/// points, on its level and on the next finer one; its finish joins the answers to an octree (level_files.h).
/// \throws UsageError when the finest lattice would have more than 2^20 cells along an axis
std::unique_ptr<Stage> make_levels_stage(const JobState& state);

}  // namespace tessera
