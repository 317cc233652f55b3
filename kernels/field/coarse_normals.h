/// \file coarse_normals.h
/// Mean normals of blocks of 2^3 cells: averaging takes the noise out of the question whether a neighbourhood
/// holds a crease at all.
#pragma once
#include "octree/points.h"

namespace tessera {

/// One point, or two, per occupied block of 2^3 cells, in canonical order: the mean position (a multiple of 1/1024
/// cell) and, as `n`, a direction whose length is 1 / sqrt(points averaged). The direction is the mean
/// normal; where the normals of a block disagree it is the one that differs most from the mean, and the length 1/2. Two
/// faces that oppose each other (a thin wall) give a point each. Points without normal are ignored. Pure function of the block's points.
/// \pre points in canonical order
[[nodiscard]] PointBlock average_normals(const PointBlock& points);

}  // namespace tessera
