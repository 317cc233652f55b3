/// \file tiles_needs.h
/// What a job of tiles will take, told from the size of the mesh before the job begins.
#pragma once
#include <cstdint>
#include <filesystem>
#include <vector>

#include "stream/import/import_needs.h"
#include "stream/runtime/disk_space.h"
#include "stream/runtime/stage.h"
#include "stream/stages/bake/texture_colours.h"
#include "stream/stages/tiles/tiles_options.h"

namespace tessera {

/// Memory of the import and of all levels. Of levels that are clustered instead of decimated nothing is sure.
/// \param pages  of the mesh, where textures are made of them
std::vector<StageNeed> tiles_needs(const RunOptions& run, const TilesOptions& options, const MeshSize& mesh,
                                   const PagesSize& pages = {});

/// Disk, by rates measured on meshes of scans: within a fifth where faces lie as there.
struct TilesDisk {
  std::uint64_t work = 0;  ///< most that lies in the work directory at one time
  std::uint64_t site = 0;  ///< the site
};
TilesDisk tiles_disk(const TilesOptions& options, const MeshSize& mesh);

/// The folders of a site and of its work directory, by what is not there yet. \pre both are there
std::vector<DiskNeed> tiles_disk_needs(const TilesDisk& disk, const std::filesystem::path& site,
                                       const std::filesystem::path& work);

}  // namespace tessera
