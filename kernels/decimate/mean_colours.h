/// \file mean_colours.h
/// Colours of a decimated mesh as means over the area that each vertex stands for: decimation leaves those of the
/// vertices that happen to stay, which speckles a coarse level and smears a road into the fields beside it.
#pragma once
#include <cstdint>
#include <vector>

#include "kernels/mesh/mesh_block.h"

namespace tessera {

/// Every face of `fine` gives its colour, weighted by its area, to the corners of the closest face of `coarse`, by the
/// barycentric coordinates of the foot of its centroid. Corners without a colour (alpha 0) give none.
/// \param radius  scan units; fine faces whose centroid is farther from `coarse` give nothing
/// \return per vertex of `coarse`; its own colour where nothing was given
/// \pre both have colours. Right for the vertices whose star, the fine faces within `radius` of it and the coarse faces within
/// twice that are there
[[nodiscard]] std::vector<std::uint32_t> mean_colours(const MeshBlock& coarse, const MeshBlock& fine,
                                                      double radius);

}  // namespace tessera
