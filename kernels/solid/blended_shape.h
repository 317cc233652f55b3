/// \file blended_shape.h
/// Two implicit solids as one, with the joint rounded by a ball that rolls along both (thesis 2.3.1: implicit solids are
/// joined by what their values are).
///
/// Where the ball of radius R touches both surfaces its centre lies at distance R from each, on a curve; a point between the
/// two places of contact is as far from the rounded surface as R less its distance from that centre. The centre is found by
/// Newton steps over both values, so the round is exact wherever the values are distances, curved surfaces included.
#pragma once
#include <memory>

#include "kernels/solid/solid_shape.h"
#include "kernels/solid/solid_tree.h"

namespace tessera {

/// A union gets a fillet where its parts meet, an intersection and a difference lose their new edges; where a ball does not
/// fit the joint stays sharp.
/// \param radius  of the ball, at least 0 (sharp)
/// \pre  values of both are distances near their surfaces: nothing was stretched
[[nodiscard]] std::unique_ptr<SolidShape> blend_shapes(std::unique_ptr<SolidShape> a,
                                                       std::unique_ptr<SolidShape> b, SolidTree::Join join,
                                                       double radius);

}  // namespace tessera
