/// \file terrain.h
/// The bare terrain of a scan seen from above (a digital terrain model), in three steps: the lowest points of cells of several
/// columns; the ground among them (ground_filter.h), with a membrane below what stands on it; and the layers of a brick
/// column that lie on the ground, with a synthetic one where no ground was seen. Heights are integers, quanta along up, so the
/// result is the same on every machine.
#pragma once
#include <cstdint>
#include <span>
#include <vector>

#include "kernels/points/ground_filter.h"
#include "kernels/points/roof_cells.h"
#include "kernels/points/surface_model.h"

namespace tessera {

/// What lies lowest in a cell.
struct TerrainCell {
  std::int32_t lowest = kNoGround;  ///< kNoGround without a point
  std::int32_t level =
      kNoGround;  ///< median height of the points close above the lowest, without the low bias of that
  std::uint32_t rgba = 0;  ///< mean of their colours
};

/// Cells of a brick column. \param points  get sorted \param cell_columns  along the edge of a cell, divides kBrickCells
/// \param depth  points no higher above the lowest make the level \param cells  of the brick column, u fastest
void find_terrain_cells(std::span<ColumnPoint> points, int cell_columns, std::int32_t depth,
                        std::span<TerrainCell> cells);

/// Bits of TerrainNode::flags.
enum TerrainFlag : std::uint32_t {
  kTerrainSeen = 1,    ///< ground was measured in this cell
  kTerrainStands = 2,  ///< what was measured stands on it, or lies below as a pit does
  kTerrainInside =
      4,  ///< here and in the cells around something was measured, or they lie in holes no wider than the window
  kTerrainRoof = 8,  ///< a building stands here
};

/// The terrain at the middle of a cell.
struct TerrainNode {
  std::int32_t level = kNoGround;
  std::uint32_t rgba = 0;
  std::uint32_t flags = 0;
};

/// The terrain over a raster of cells, u fastest: ground where SMRF finds it, elsewhere a membrane between its levels.
/// A node depends on no cell farther away than terrain_halo(), but for membranes over holes wider than that.
/// \param roofs  of buildings (find_planar_areas()); without a height none are looked for
/// \cost 48 bytes and half a µs a cell
[[nodiscard]] std::vector<TerrainNode> fit_terrain(std::span<const TerrainCell> cells, int width, int height,
                                                   const GroundRules& rules, const RoofRules& roofs = {});
[[nodiscard]] int terrain_halo(const GroundRules& rules, const RoofRules& roofs = {});

/// The terrain below one brick column.
class BrickTerrain {
 public:
  /// \param nodes  of its cells and of those around it, u fastest; none = nothing is known here
  BrickTerrain(std::span<const TerrainNode> nodes, const GroundRules& rules);

  /// Nodes of a brick column with those around it, along an edge.
  [[nodiscard]] static int edge(const GroundRules& rules) {
    return kBrickCells * kQuantaPerCell / rules.cell + 2;
  }
  [[nodiscard]] bool known() const { return !nodes_.empty(); }
  /// Height at the middle of a column, and how far from it ground lies. \pre known()
  [[nodiscard]] GroundAt at(int u, int v) const;
  /// Colour there, between those of the nodes; alpha 0 without.
  [[nodiscard]] std::uint32_t rgba(int u, int v) const;
  [[nodiscard]] const TerrainNode& node(int u, int v) const;  ///< of the cell that holds a column

 private:
  GroundRules rules_;
  GroundSurface surface_;
  std::vector<TerrainNode> nodes_;
};

/// Keeps the ground of a brick column. A column's layer is the lowest of its points near the terrain; steep points, as at the
/// foot of a wall, do not count. Columns with other points, and those inside, get a synthetic layer on the terrain, all others
/// none. \pre terrain.known()
/// \param points  get sorted \param layers  kBrickCells^2, u fastest
void find_ground_layers(std::span<ColumnPoint> points, const BrickTerrain& terrain,
                        std::span<ColumnLayers> layers);

/// Takes what is strewn over the ground out of a brick column: where most points high above the terrain are strewn, its layer is
/// what lies near the terrain, or a synthetic one on it; so is that of places where nothing was measured inside. Columns of
/// bare ground and of buildings keep their layers. Flat crowns are told from buildings by their area: what stands high among
/// some that is strewn is strewn too, where no kTerrainRoof is. \pre terrain.known()
/// \param points  get sorted \param layers  kBrickCells^2, u fastest
void find_cleared_layers(std::span<ColumnPoint> points, const BrickTerrain& terrain,
                         std::span<ColumnLayers> layers);

/// Moves synthetic layers towards measured ones up to kFollowColumns away: cells of the terrain are coarser than columns.
/// A layer depends on nothing farther away, so that a model of it stays within kSurfaceModelHalo.
/// \param layers  edge^2 of find_ground_layers() or find_cleared_layers(), u fastest
inline constexpr int kFollowColumns = 22;
void follow_measured(std::span<ColumnLayers> layers, int edge);

}  // namespace tessera
