/// \file tile_mesh.h
/// What a tile holds, on the grid of its level, and its GLB: positions of 16 bits (KHR_mesh_quantization), streams packed
/// by EXT_meshopt_compression.
///
/// All tiles of a level share one grid, so a vertex of several tiles is at the same place in all of them.
#pragma once
#include <array>
#include <cstdint>
#include <string>
#include <vector>

#include "kernels/mesh/mesh_block.h"

namespace tessera {

/// Points of the grid are origin + step (i, j, k), z up.
struct TileGrid {
  Double3 origin = {0, 0, 0};  ///< scan units; a multiple of `step`
  double step = 0.0;           ///< a power of two, scan units
  /// No position is farther from its point of the grid.
  double error() const { return 0.8660254037844387 * step; }
};

struct TileMesh {
  TileGrid grid;
  std::array<std::int64_t, 3> low = {0, 0, 0}, high = {0, 0, 0};  ///< of the vertices, in steps
  std::vector<std::array<std::uint32_t, 3>> position;             ///< n, steps above low; < 2^24
  std::vector<std::uint32_t> rgba;                                ///< n, or empty; as MeshBlock::rgba
  std::vector<Double3> normal;                                    ///< n, unit length or zero, or empty
  /// n, or empty where no face closes a hole: 1 at the corners of faces that do. Vertices at the rim are there twice.
  std::vector<std::uint8_t> synthetic;
  std::vector<std::array<std::uint32_t, 3>> faces;
  std::vector<std::array<std::uint16_t, 2>> uv;  ///< n, 65,535ths of the picture, v down, or empty
  std::string jpeg;                              ///< the picture; empty without uv
};

/// The picture of a tile, and where its vertices lie on it: as in TileMesh.
struct TilePicture {
  std::vector<std::array<std::uint16_t, 2>> uv;
  std::string jpeg;
};

/// \param normal  per vertex of the block, or empty \param picture  with uv per vertex of the block, or none
/// \pre the block is not empty, and no wider than 2^24 steps
TileMesh quantise_tile(const MeshBlock& block, const TileGrid& grid, std::vector<Double3> normal,
                       const TilePicture& picture = {});

/// One mesh, y up as glTF has it, under a node that puts it where it is relative to the grid's origin. Tiles wider than
/// 65,535 steps get floats for positions, which are whole numbers then too. A tile without faces is one of points, in their order. One
/// with a picture shows that in place of colours of vertices. A pure function of the tile.
/// \throws std::logic_error when an encoder fails
std::string tile_glb(const TileMesh& tile);

}  // namespace tessera
