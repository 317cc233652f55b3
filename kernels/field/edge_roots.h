/// \file edge_roots.h
/// Directed distances: where the surface crosses the lattice edges of the band.
#pragma once
#include <vector>

#include "kernels/field/directed_field.h"
#include "kernels/field/node_fit.h"
#include "kernels/field/point_leaves.h"

namespace tessera {

/// Smallest distance of a root from the ends of its edge, cells; keeps triangles from degenerating.
inline constexpr float kRootMargin = 1.0f / 64.0f;

/// Finds every crossed edge of the band, sets BandLeaf::crossing and first_root, and fills field.roots. On smooth
/// stretches the root is that of the cubic through values and slopes at both nodes. Beside creases it is the root of the
/// nodes' sheets, so that it lies on one exact face and has that face's normal.
/// \param fits    per leaf of the field, same order
/// \param sheets  what LeafFit::first_sheets points into
/// \param noisy  fill field.creased too
void find_roots(const std::vector<LeafFit>& fits, const std::vector<Sheets>& sheets, bool noisy,
                DirectedField& field);

}  // namespace tessera
