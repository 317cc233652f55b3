/// \file level_stage.h
/// What the stages have in common that go over the tiles of a level.
#pragma once
#include <algorithm>
#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include "stream/meshes/mesh_store.h"
#include "stream/stages/tiles/tiles_stage.h"

namespace tessera {

inline constexpr const char* kRecords = "records/";
inline constexpr const char* kGrid = "grid.json";
inline constexpr const char* kFinerGrid = "finer-grid.json";  ///< there where faces meet by the first grid

/// Of the tiles of a level that are written.
std::vector<TileRecord> read_records(const std::filesystem::path& folder);
/// Where the origin of the grids of a mesh with this box lies.
Double3 origin_of(const MeshBox& box);
/// No grid is finer than doubles are there.
double finest_step(const MeshBox& box);

struct LevelGrid {
  TileGrid grid;
  std::uint64_t met = 0, met_first = 0;
};

/// The finer grid where there is one. \pre the grid stages in this folder are done
LevelGrid read_grid(const std::filesystem::path& folder);

/// A level cut into tiles, and the first grid of their positions.
class LevelStage : public Stage {
 public:
  LevelStage(const std::filesystem::path& work, const TilesOptions& options, int level);

  std::size_t task_count() const override { return (cells_.size() + per_task_ - 1) / per_task_; }
  std::uint64_t units() const override { return cells_.size(); }
  std::string unit_name() const override { return "tiles"; }

  std::uint64_t task_bytes(std::size_t task) const override {
    std::uint64_t maximum = 0;
    for (std::size_t c = first(task); c < first(task + 1); ++c)
      maximum = std::max(maximum, loaded_bytes(cells_[c]));
    return tile_task_bytes(maximum);
  }
  std::uint64_t finish_bytes() const override { return std::uint64_t{1} << 20; }

 protected:
  std::size_t first(std::size_t task) const { return std::min(cells_.size(), task * per_task_); }
  std::vector<std::size_t> bricks_of(const TileCell& cell) const {
    std::vector<std::size_t> patches(cell.last - cell.first);
    for (std::size_t k = 0; k < patches.size(); ++k) patches[k] = cell.first + k;
    return patches;
  }
  /// Of what level 0 has in the cell.
  MeshBox box_of(const TileCell& cell) const { return level0_.box_of(bricks_of(cell)); }
  /// All that the tile may hold faces of.
  std::vector<std::size_t> patches_of(const TileCell& cell) const {
    return level_ == 0 ? bricks_of(cell) : store_.select(grown(box_of(cell), bound_));
  }

  virtual std::uint64_t loaded_bytes(const TileCell& cell) const {
    return store_.block_bytes(patches_of(cell));
  }

  MeshBlock load(const TileCell& cell) const;

  int level_;
  double bound_;
  MeshStore level0_;
  MeshStore store_;
  std::vector<TileCell> cells_;
  TileGrid grid_;

 private:
  void choose_grid();

  std::size_t per_task_ = 1;
};

}  // namespace tessera
