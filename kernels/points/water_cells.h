/// \file water_cells.h
/// Cells of a raster that are water: hardly anything comes back from it, and what does lies level, below its banks. The rule is our
/// own. Low density of returns, level heights and banks are what mapping of water from airborne lidar goes by: B. Höfle,
/// M. Vetter, N. Pfeifer, G. Mandlburger, J. Stötter, "Water surface mapping from airborne laser scanning using signal
/// intensity and elevation data", Earth Surface Processes and Landforms 34, 2009; intensities take no part here.
#pragma once
#include <cstdint>
#include <span>
#include <vector>

namespace tessera {

/// Heights are in the unit of the raster.
struct WaterRules {
  double max_count = 0.0;   ///< a cell with no more points is sparse
  double density = 0.25;    ///< of water, to that of the land beside it, at most; > 0
  int width = 0;            ///< cells, >= 2: of the square that water must hold; 0 = none is looked for
  std::int32_t relief = 0;  ///< from the lowest to the highest of level water
  int reach = 128;          ///< cells: so far away a bank is looked for

  /// A cell depends on nothing farther away.
  [[nodiscard]] int halo() const { return width > 0 ? 2 * width + reach + 3 : 0; }
};

/// 1 for cells of water. Such a cell is sparse and lies in a square of `width` cells of which a sixteenth at most is not sparse;
/// a twentieth at least, and four, show a height and have no neighbour that is not sparse, which cells cut by the rim of a
/// void have; nine of ten of these heights lie within half of the relief from their median. Of the eight directions from
/// it six at least lead over sparse cells to land, or over such squares as far as the reach. Land shows within three cells
/// so many points that the square, the fullest of those that hold the cell, has no more than `density` of them to a cell, and
/// is no more than the relief below that median: so what fades out at the end of a scan is no water, nor is a roof.
/// At last half of such a square must be water.
/// \param lowest  of every cell, u fastest, kNoGround where nothing was measured \param counts  points of every cell
[[nodiscard]] std::vector<std::uint8_t> find_water(std::span<const std::int32_t> lowest,
                                                   std::span<const std::uint32_t> counts, int width,
                                                   int height, const WaterRules& rules);

}  // namespace tessera
