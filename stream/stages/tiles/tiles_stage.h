/// \file tiles_stage.h
/// Writes the tiles of one level, each a GLB that lies at its place in the output's folder.
///
/// A tile of level 0 holds the faces of its bricks: every face of the mesh lies in one of them. A tile of a further level
/// holds every face of its level that comes, by its box, within the level's bound of the faces of level 0 that its bricks
/// hold, so that it covers all that its descendants do; neighbours have the rows of faces along their sides in common.
#pragma once
#include <cstdint>
#include <filesystem>
#include <memory>
#include <string>
#include <vector>

#include "stream/files/json.h"
#include "stream/runtime/stage.h"
#include "stream/stages/tiles/tile_cut.h"
#include "stream/stages/tiles/tile_mesh.h"
#include "stream/stages/tiles/tiles_options.h"

namespace tessera {

/// A tile that was written; as it lies in files.
struct TileRecord {
  TileCell cell;
  std::int64_t low[3] = {0, 0, 0}, high[3] = {0, 0, 0};  ///< of its vertices, in steps of the level's grid
  std::uint64_t bytes = 0, vertices = 0, faces = 0;
};

/// What a level has.
struct TileLevel {
  TileGrid grid;
  std::uint64_t met_by_grid = 0;        ///< pairs_met_by_grid() of all tiles
  std::uint64_t met_by_first_grid = 0;  ///< the same before a finer grid was chosen, if one was
  double step_bound = 0.0;              ///< proven: between this level and the one below
  std::vector<TileRecord> tiles;        ///< ascending cells
  Json texture;                         ///< for people; empty where tiles have no pictures
};

/// Where the origin of all grids lies: near the middle of the mesh.
Double3 tiles_origin(const std::filesystem::path& work);
/// \pre the stages of this level are done
TileLevel read_tile_level(const std::filesystem::path& work, int level);
/// Relative to the output's folder: "tiles/0/000012.glb".
std::string tile_file(int level, std::size_t tile);

/// What a task takes at most. \param block_bytes  MeshStore::block_bytes of what is loaded for its largest tile
std::uint64_t tile_task_bytes(std::uint64_t block_bytes);

/// Stage "tiles" in the folder of a level. \pre its grid is chosen
std::unique_ptr<Stage> make_tiles_stage(const JobState& state, const TilesOptions& options, int level);

}  // namespace tessera
