/// \file cell_tracing.h
/// The loops of the cells of a leaf: marching cubes by closed loops (cell_loops.h), a feature vertex where one is sharp.
#pragma once
#include "kernels/extract/crease_cells.h"
#include "kernels/extract/feature_loops.h"

namespace tessera {

/// Loops that known creases cut become faces along them. Of the others, loops without a feature become faces, those with one a vertex, to be joined by emit_feature_segments().
/// \param edges   of the leaf
/// \param report  counts loops and samples of own cells
void trace_leaf(const BrickInput& brick, const LeafMasks& leaf, const LeafEdges& edges, BorderShift& border,
                CreaseCells& creases, PatchBuilder& patch, FeatureLoops& features, ExtractReport& report);

}  // namespace tessera
