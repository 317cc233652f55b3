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
  double margin =
      0.0;  ///< what the tile is loaded with: all faces within it hold the rings that were asked for
  bool by_rings = false;  ///< not by a margin: the faces around are gathered ring by ring (smoothed_patch.h)
  std::uint64_t bytes = 0;  ///< upper bound of what the tile takes
};

/// Tiles that one task does one after the other, into one file.
using SmoothTask = std::vector<SmoothTile>;

/// Bytes of the largest tile: tiles of a task take turns.
std::uint64_t task_bytes(const SmoothTask& task);

struct SmoothTiling {
  int rings = 1;
  double range = 0.0;            ///< scan units, beyond the rings
  int tile_bricks = 0;           ///< largest edge of a tile in bricks; 0 = as large as the bytes allow
  std::uint64_t tile_bytes = 0;  ///< a tile above it is split down to single patches
  /// What gathering rings may take, where that is possible, else 0: tiles of one patch do so whose margin holds too much, or far
  /// more than its rings. With `few_rings` > 0 all tiles do, with so many rings at first.
  std::uint64_t ring_bytes = 0;
  int few_rings = 0;
  /// Upper bound for a tile that reads so many vertices and faces, halo included.
  std::function<std::uint64_t(std::uint64_t vertices, std::uint64_t faces)> bytes;
};

/// Every patch is in exactly one tile.
std::vector<SmoothTask> make_smooth_tasks(const MeshStore& store, const PatchRange& range,
                                          const SmoothTiling& tiling);
/// The same of some patches.
std::vector<SmoothTask> make_smooth_tasks(const MeshStore& store, const PatchRange& range,
                                          const SmoothTiling& tiling, std::vector<std::size_t> patches);

}  // namespace tessera
