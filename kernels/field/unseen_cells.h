/// \file unseen_cells.h
/// Cells whose surface rests on samples that nobody measured: walls of a surface model that no ray reached, holes that it fills.
#pragma once
#include "kernels/field/directed_field.h"
#include "kernels/field/point_leaves.h"
#include "octree/points.h"

namespace tessera {

/// Marks BandLeaf::unseen of the cells in whose surroundings, a cell wide, every sample has kPointUnseen, at least one.
/// None where points bring no flags. \param leaves  of the points
void mark_unseen_cells(const PointBlock& points, const PointLeaves& leaves, DirectedField& field);

}  // namespace tessera
