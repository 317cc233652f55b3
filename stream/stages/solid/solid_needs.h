/// \file solid_needs.h
/// What the stages of a model of solids will take, told before its meshes are read.
#pragma once
#include <vector>

#include "stream/runtime/stage.h"

namespace tessera {

struct SolidModel;

/// Memory of all stages of a model, whether it ends as a surface or as a field, by what is known before its meshes are read: of
/// bricks as a closed surface fills them.
std::vector<StageNeed> solid_needs(const JobState& state, const SolidModel& model);

}  // namespace tessera
