/// \file level_faces.h
/// Faces of the cells at which finer bricks begin (level_cells.h). They hold no features: every loop is triangulated, or a
/// fan around its middle.
#pragma once
#include "kernels/extract/feature_loops.h"

namespace tessera {

/// \pre brick.levels is set   \param leaf  of the brick   \returns number of loops with faces
std::uint64_t emit_level_faces(const BrickInput& brick, const LeafMasks& leaf, const LeafEdges& edges,
                               PatchBuilder& patch);

}  // namespace tessera
