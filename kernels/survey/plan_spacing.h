/// \file plan_spacing.h
/// How far the points of a scan lie apart when it is seen from above: what a raster of it can resolve. The rule is our own.
#pragma once
#include <vector>

#include "octree/vector.h"

namespace tessera {

/// Half of the area that has points is sampled at least as closely as that: a cell of this edge holds one point there.
/// Counted in square cells, halved until half of those that have points hold fewer than eight. 0 for fewer than eight points, or
/// where they all lie at one place.
/// \param sample  some of the points, spread evenly, in any order; finite \param share  of all points, in (0, 1]
double plan_spacing(const std::vector<Double2>& sample, double share);

/// The least of 1, 2 and 5 times a power of ten that is not below a number. \pre 1e-300 < x < 1e300
double round_up_1_2_5(double x);

}  // namespace tessera
