/// \file distance_tiles.h
/// How the space around the surface of solids is cut into tiles, and what of the surface lies near one. Tiles carry no
/// meaning: nodes ask for distances that no tile can change.
#pragma once
#include <cstdint>
#include <vector>

#include "kernels/solid/offset_field.h"
#include "stream/meshes/mesh_store.h"
#include "stream/points/plan.h"
#include "stream/runtime/stage.h"
#include "stream/stages/surface/surface_stage.h"

namespace tessera {

class DistanceTiles {
 public:
  /// \param halo  how far from a tile faces matter, cells  \param value_bytes  what a leaf of the tile takes beside
  DistanceTiles(const JobState& state, double halo, std::uint64_t value_bytes);

  /// Cubes of bricks by task, in Morton order.
  const std::vector<std::vector<std::uint64_t>>& groups() const { return groups_; }
  std::uint64_t cubes() const;
  TileGroup tiles_of(std::uint64_t cube) const;
  /// Upper bound of what the faces near any tile of a task take, and its leaves.
  std::uint64_t task_bytes(std::size_t task) const;
  /// The same of a tile of one brick with so many faces near it, told before there is a surface.
  static std::uint64_t brick_task_bytes(std::uint64_t faces, std::uint64_t value_bytes);
  /// Faces near a tile, in cells from its corner; none where nothing is near.
  MeshBlock load(const Tile& tile) const;
  const RowSigns& signs() const { return signs_; }
  const Plan& plan() const { return plan_; }
  std::size_t mesh_files() const { return mesh_files_; }  ///< of the surface

 private:
  MeshBox surroundings(const Tile& tile) const;
  std::vector<std::uint64_t> find_cubes() const;
  std::uint64_t tile_bytes(const Tile& tile) const;

  Plan plan_;
  double halo_;  ///< units of the meshes
  std::uint64_t value_bytes_;
  MeshStore mesh_;
  RowSigns signs_;
  std::vector<std::vector<std::uint64_t>> groups_;
  std::size_t mesh_files_ = 0;
  int edge_ = 1;  ///< of a tile, bricks
};

}  // namespace tessera
