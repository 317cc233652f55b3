/// \file merge_needs.h
/// What the stages of a merge will take, told before the meshes are read.
#pragma once
#include <vector>

#include "stream/import/import_needs.h"
#include "stream/runtime/stage.h"

namespace tessera {

/// Of the stages between import and what mends crossings. \param all  meshes together
std::vector<StageNeed> merge_needs(const RunOptions& run, const MeshSize& all);

}  // namespace tessera
