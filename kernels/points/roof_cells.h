/// \file roof_cells.h
/// Cells of a raster that are roofs: what stands well above the ground and is planar from cell to cell. The lowest height
/// of a cell is asked, which on a roof is the roof and in a crown is anything down to the ground.
/// Source: after F. Rottensteiner, C. Briese, "A new method for building extraction in urban areas from high-resolution
/// LIDAR data", ISPRS Archives 34 (3A), 2002: height over the terrain, roughness, and a least width by an opening; planes
/// here are least squares over 3 x 3 cells, and regions are not grown into building models.
#pragma once
#include <cstdint>
#include <span>
#include <vector>

#include "kernels/points/ground_filter.h"

namespace tessera {

/// In the unit of heights.
struct RoofRules {
  double min_height = 0.0;    ///< over the ground
  double max_residual = 0.0;  ///< of the nine heights to their plane, root mean square
  int min_cells = 0;          ///< of a connected area of find_planar_areas()
};

/// 1 for cells of roofs and those beside them, which hold eaves and walls. A cell depends on nothing farther away than 6 cells.
/// \param lowest, surface  as given to and returned by find_ground()
[[nodiscard]] std::vector<std::uint8_t> find_roofs(std::span<const std::int32_t> lowest,
                                                   const GroundSurface& surface, const RoofRules& rules);

/// 1 for cells of 3 x 3 that stand and are planar, where min_cells of them or more hang together by their sides, and for those
/// up to two cells beside them: small huts too, which are no wider than their cells, but no flat crown.
/// A cell depends on nothing farther away than min_cells + 4 cells. \param lowest, surface  as of find_roofs()
[[nodiscard]] std::vector<std::uint8_t> find_planar_areas(std::span<const std::int32_t> lowest,
                                                          const GroundSurface& surface,
                                                          const RoofRules& rules);

}  // namespace tessera
