/// \file core_points.h
/// Core points: of a cloud, one in each cell of a lattice through zero.
#pragma once
#include <cstddef>
#include <span>
#include <vector>

#include "octree/vector.h"

namespace tessera {

/// Indices of the points that lie nearest to the centre of their cell of this size; of several the one of least x, then y, then
/// z, then the first. A cell all of whose points are given has the same core point in any block.
/// \param points  finite  \param size  > 0
[[nodiscard]] std::vector<std::size_t> core_points(std::span<const Double3> points, double size);

}  // namespace tessera
