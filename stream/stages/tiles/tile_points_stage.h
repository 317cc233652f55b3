/// \file tile_points_stage.h
/// What the textures of tiles are made of: coloured points on the mesh, fewer for every coarser level.
///
/// Those of the finest are the texels of the input's own pages; without pages its vertices, and points on faces so wide that vertices
/// alone would not show what colour they have. Each coarser level has the means of those below in cubes of space
/// (kernels/texture/point_means.h), as much wider as its faces are. A site without pages has on each level the points of two levels
/// below: some sixteen texels a face.
#pragma once
#include <cstdint>
#include <filesystem>
#include <memory>

#include "stream/runtime/stage.h"
#include "stream/stages/tiles/tiles_options.h"

namespace tessera {

/// What textures of a level are made of.
struct TileTextureScale {
  std::filesystem::path points;  ///< TexturePoints
  double texel = 0.0;            ///< scan units
  double spacing = 0.0;          ///< of the points along the surface

  /// \param work  of the job \pre the level has textures
  static TileTextureScale of_level(const std::filesystem::path& work, int level);
};

/// Whether the tiles of a level get textures: vertices lose nothing on the finest. \param work  of the job
bool level_has_texture(const std::filesystem::path& work, const TilesOptions& options, int level);

/// What of memory the stages below take beside reading.
std::uint64_t tile_points_bytes(std::uint64_t sort_bytes, std::uint64_t patches);

/// Stage "texture-points" of the job: the points of the finest level. \pre the mesh is imported
std::unique_ptr<Stage> make_tile_points_stage(const JobState& state, const TilesOptions& options);
/// Stage "texture-points" in the folder of a level, above 0 and there: the means.
std::unique_ptr<Stage> make_level_points_stage(const JobState& state, int level);

}  // namespace tessera
