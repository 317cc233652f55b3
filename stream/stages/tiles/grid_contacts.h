/// \file grid_contacts.h
/// Faces of a tile that meet because its positions are steps of a grid.
#pragma once
#include <cstdint>

#include "kernels/mesh/mesh_block.h"
#include "stream/stages/tiles/tile_mesh.h"

namespace tessera {

/// Pairs of faces that cross, overlap or touch beyond what they share where the grid has them (block_contacts.h), and do not where
/// the block does. \pre `tile` is the block's
std::uint64_t pairs_met_by_grid(const MeshBlock& block, const TileMesh& tile);

}  // namespace tessera
