/// \file root_colour.h
/// Colour of the surface at the roots: weighted mean of the samples around each.
#pragma once
#include "kernels/field/directed_field.h"
#include "kernels/field/point_leaves.h"

namespace tessera {

/// Sets EdgeRoot::rgba of every root: mean of the coloured samples within 1.5 cells (weight (1 - d^2/1.5^2)^2), else of
/// those within `radius`; alpha 0 where none is. Sums in canonical order.
/// \param with_volumetric  points without normal count too
/// \param far  where none is within `radius`, those within a leaf count
/// \pre points.rgba is as long as points.x; radius <= 4
void colour_roots(const PointBlock& points, const PointLeaves& leaves, float radius, bool with_volumetric,
                  bool far, DirectedField& field);

}  // namespace tessera
