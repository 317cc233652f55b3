/// \file point_means.h
/// Coloured points made fewer, and points on faces that are wide beside them: what textures of coarser levels are made of.
#pragma once
#include <cstdint>
#include <functional>
#include <span>

#include "kernels/mesh/mesh_block.h"
#include "octree/vector.h"

namespace tessera {

/// \param normal  unit, or zero where unknown
using ColouredPointSink = std::function<void(const Double3& p, std::uint32_t rgba, const Double3& normal)>;

/// Means of the points in each cube of space, those that look along different axes apart, so that both sides of a wall keep
/// their colours. Cubes in ascending order; sums in the order of the points, colours in whole numbers.
/// \param normal  packed (point_colours.h), as many as points, or empty  \param edge  of the cubes, which begin at zero; > 0
void mean_points(std::span<const Float3> position, std::span<const std::uint32_t> rgba,
                 std::span<const std::uint32_t> normal, double edge, const ColouredPointSink& sink);

/// Points on the faces of a block with an edge longer than two spacings, as many as their areas hold squares of the spacing
/// in the mean, with the colours between those of the corners. A function of the faces alone: keys of their corners say where the
/// low-discrepancy sequence R2 (Roberts 2018) begins.
/// \pre  the block has colours, spacing > 0
void sample_wide_faces(const MeshBlock& block, double spacing, const ColouredPointSink& sink);

}  // namespace tessera
