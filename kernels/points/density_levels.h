/// \file density_levels.h
/// How small the cells of a lattice may be where points lie, from counts of occupied cells.
///
/// A surface that samples cover passes four times as many cells of half the edge, a lone point one, a line two. So a brick
/// whose points occupy at least 3.25 times as many of the finer cells as of its own is covered on the finer level too:
/// its samples lie closer than 0.8 of the finer edge, however the scans overlap or the surface leans.
#pragma once
#include <cstdint>
#include <vector>

#include "octree/points.h"

namespace tessera {

struct DensityNode {
  int level = 0;
  Int3 at = {0, 0, 0};  ///< on its level: in bricks of it from the lattice origin
};

/// Nodes of the octree under one brick of level `levels` - 1 that are split, parents first.
/// \param points  of the brick, canonical order, relative to it, in its cells; no halo
/// \param brick   its coordinates
/// \param minimum   no bricks below this level
[[nodiscard]] std::vector<DensityNode> split_by_density(const PointBlock& points, const Int3& brick,
                                                        int levels, int minimum);

}  // namespace tessera
