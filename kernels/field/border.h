/// \file border.h
/// Where the surface ends: on a contour of a continuous measure, not at the last cell with samples.
///
/// Every node near the end of the samples knows the depth of its foot point within them (node_fit.h). Along a crossed
/// edge the depth is linear, so the surface has a contour of a certain depth: that is the border. Cells without a vertex
/// well within it take no part. All others have their vertices at most a cell beyond: these move onto the contour, as do
/// those that lie closely within it, so that no cell is flat. What moves depends on the two nodes of its edge alone.
/// Roots between two surfaces, where both ends' fits fall while the values rise, count as beyond.
#pragma once
#include <vector>

#include "kernels/field/directed_field.h"
#include "kernels/field/node_fit.h"

namespace tessera {

/// Fills BandLeaf::moving, BandLeaf::ended and DirectedField::moves.
/// \param fits  per leaf of the field, whose roots are complete
void find_border(const std::vector<LeafFit>& fits, const std::vector<BoundaryNode>& boundaries,
                 DirectedField& field);

}  // namespace tessera
