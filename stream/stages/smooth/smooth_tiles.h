/// \file smooth_tiles.h
/// How smoothing cuts a store into tiles, and how far a tile must see. Tiles carry no meaning: any cut gives
/// the same bytes.
#pragma once
#include <cstdint>
#include <functional>
#include <vector>

#include "stream/meshes/mesh_store.h"
#include "stream/stages/smooth/patch_range.h"

namespace tessera {

struct SmoothTile {
  std::vector<std::size_t> patches;  ///< ascending
  double margin = 0.0;               ///< what the tile is loaded with
  bool sure = true;         ///< all faces within it hold the rings that were asked for; false: mostly
  std::uint64_t bytes = 0;  ///< upper bound of what the tile takes
};

/// Tiles that one task does one after the other, into one file.
using SmoothTask = std::vector<SmoothTile>;

/// Bytes of the largest tile: tiles of a task take turns.
std::uint64_t task_bytes(const SmoothTask& task);

struct SmoothTiling {
  int rings = 1;
  /// Mean edges that are mostly enough: rings are reached by the longest edge only where many such edges lie in line.
  /// Tiles are loaded with these first, and wider_tile() does for patches that miss something. 0 = rings at once.
  double mostly_edges = 0.0;
  double range = 0.0;            ///< scan units, beyond the rings
  int tile_bricks = 0;           ///< largest edge of a tile in bricks; 0 = as large as the bytes allow
  std::uint64_t tile_bytes = 0;  ///< a tile above it is split down to single patches
  /// What a task asks for at most on behalf of tiles that are sure: few need to be. 0 = all that they may take.
  std::uint64_t largest_bytes = 0;
  /// Upper bound for a tile that reads so many vertices and faces, halo included.
  std::function<std::uint64_t(std::uint64_t vertices, std::uint64_t faces)> bytes;
};

/// Every patch is in exactly one tile, whose bytes also do for the sure tile of each of its patches, up to `largest_bytes`.
std::vector<SmoothTask> make_smooth_tasks(const MeshStore& store, const PatchRange& range,
                                          const SmoothTiling& tiling);

/// A patch whose rings the last tile did not hold: with all that they can reach where that fits into these bytes, else with half
/// as much again around it as before.
/// \throws ResourceError where not even that fits
SmoothTile wider_tile(const MeshStore& store, const PatchRange& range, const SmoothTiling& tiling,
                      std::size_t patch, double margin_before, std::uint64_t bytes);

}  // namespace tessera
