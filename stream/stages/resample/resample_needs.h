/// \file resample_needs.h
/// What the stages of resampling will take, told before the mesh is read.
#pragma once
#include <vector>

#include "stream/import/import_needs.h"
#include "stream/runtime/stage.h"

namespace tessera {

/// Of the scale, of blends, and of the patches that they change.
std::vector<StageNeed> resample_needs(const MeshSize& mesh);

}  // namespace tessera
