/// \file tileset.h
/// The tree of tiles of a site and its JSON (OGC 22-025r4, 3D Tiles 1.1).
#pragma once
#include <cstdint>
#include <functional>
#include <string>
#include <vector>

#include "stream/files/json.h"
#include "stream/meshes/mesh_store.h"
#include "stream/stages/tiles/tiles_stage.h"

namespace tessera {

/// One tile, boxes relative to the origin of the grids.
struct TileNode {
  MeshBox box;                                    ///< of the tile and all below it, exact
  std::uint64_t first_child = 0, last_child = 0;  ///< tiles of the level below
  bool own_file = false;                          ///< what lies below it has a tileset of its own
};

struct TileTree {
  std::vector<std::vector<TileNode>> levels;  ///< level 0 first
  /// Of a level, scan units: no crack between tiles of it and of any level below is wider, nor is any point of the level
  /// farther from level 0 or the other way round. Rises from level to level.
  std::vector<double> error;
};

/// \param levels  level 0 first, at least one
/// \param maximum    tiles of one JSON file, about
TileTree make_tile_tree(const std::vector<TileLevel>& levels, std::size_t maximum);

/// Writes tileset.json and those that it refers to.
/// \param transform  from the frame of the origin to that of the world, column by column
/// \param sink       gets the name below the output's folder (empty for tileset.json itself) and the text; tileset.json last
void write_tilesets(const TileTree& tree, const std::vector<double>& transform, double whole_error,
                    const std::function<void(const std::string& name, const std::string& text)>& sink);

}  // namespace tessera
