/// \file normal_map.h
/// Tangent-space normal maps: what a coarse mesh has lost of the directions of a fine one.
///
/// Convention, that of glTF 2.0 but with tangents that are written instead of derived (no MikkTSpace): the frame of a texel is
/// the interpolated normal N of the vertices (means of the faces around, by area, the same on both sides of a seam), the interpolated tangent T, made
/// orthogonal to N, and B = N x T. T points along +u of the page, B up on it. Channels are (n + 1) / 2 in 255ths of n = (T, B, N) parts,
/// so that 128, 128, 255 is the coarse surface itself.
#pragma once
#include <cstdint>
#include <span>
#include <vector>

#include "kernels/texture/coloured_chart.h"

namespace tessera {

/// Per vertex of the block: the mean of the normals of the faces at it, by their area; zero where they cancel out.
/// \param around  has, by key, all vertices of the block and all faces at them; keys ascend
std::vector<Double3> star_normals(const MeshBlock& block, const MeshBlock& around);

/// Unit tangents of the vertices of a chart, orthogonal to their normals: along +u of a page on which the chart is turned by so
/// many right angles (chart_packing.h). \param normal  per vertex of the mesh, unit or zero
std::vector<Double3> chart_tangents(const TriangleSpan& mesh, const MeshChart& chart,
                                    std::span<const Double3> normal, std::uint32_t turns);

/// Normals of the points at the texels of a chart, as ColouredChart::pixels; where none is near, the coarse surface.
/// \param chart  coloured from the same source \param normal, turns  as above
std::vector<std::uint32_t> normal_pixels(const ColourSource& from, const ColouredChart& chart,
                                         std::span<const Double3> normal, std::uint32_t turns);

}  // namespace tessera
