#include "stream/stages/tiles/tiles_needs.h"

#include <algorithm>
#include <string>

#include "stream/meshes/store_write_stage.h"
#include "stream/stages/decimate/simplify_needs.h"
#include "stream/stages/decimate/simplify_stage.h"
#include "stream/stages/tiles/tile_levels.h"
#include "stream/stages/tiles/tile_points_stage.h"
#include "stream/stages/tiles/tile_texture.h"
#include "stream/stages/tiles/tiles_stage.h"

namespace tessera {
namespace {

// Bytes a face, of meshes with colours.
constexpr double kWorkBytes =
    44.0;  ///< while the import has its faces dealt to buckets and the store half made
constexpr double kSiteBytes = 13.0;  ///< with grids finer than 16 bits, where faces would meet by those
constexpr double kNormalBytes = 1.0;
constexpr double kTexturePointBytes = 28.0;  ///< points of all levels, and what sorts the first
constexpr double kTextureSiteBytes = 4.0;
constexpr double kUsedTexels = 0.7;  ///< of those of a page, by faces

std::uint64_t bytes_of(std::uint64_t faces, double each) {
  return static_cast<std::uint64_t>(static_cast<double>(faces) * each);
}

}  // namespace

std::vector<StageNeed> tiles_needs(const RunOptions& run, const TilesOptions& options, const MeshSize& mesh,
                                   const PagesSize& pages) {
  std::vector<StageNeed> needs = import_needs(run, {0, kTilesImport}, mesh);
  const auto named = [](int level, const std::string& stage) { return level_folder(level) + "-" + stage; };
  const std::uint64_t tile = std::min(mesh.faces, options.tile_faces);
  // The parent of a cell has more faces than a tile may: of a surface, the cell a quarter of them.
  std::uint64_t sure = 0, likely = 0;
  if (options.has_texture()) {
    const std::uint64_t page = pages.texels > 0 ? texture_colours_bytes(mesh.vertices, run, pages) : 0;
    needs.push_back({"texture-points", tile_points_bytes(sort_bytes(run), 0) + page, 0});
    // Of the first level with pictures every vertex of the level below is a point, or every texel of a page.
    const double share =
        static_cast<double>(tile) / static_cast<double>(std::max<std::uint64_t>(mesh.faces, 1));
    const std::uint64_t texels = bytes_of(pages.texels, share);
    sure = tile_texture_bytes(tile, std::max(4 * tile, bytes_of(texels, kUsedTexels)));
    likely = std::max(2 * tile_texture_bytes(tile, 4 * tile),
                      tile_texture_bytes(tile, std::min(2 * texels, pages.texels)));
  }
  needs.push_back({named(0, "tiles"), tile_task_bytes(surface_block_bytes(tile / 4)) + sure,
                   tile_task_bytes(2 * surface_block_bytes(tile)) + likely});
  if (mesh.faces <= options.tile_faces) return needs;
  needs.push_back({named(1, "tolerance"), level_tolerance_bytes(mesh.faces), 0});
  const SimplifyOptions simplify;
  for (StageNeed need : simplify_needs(run, simplify, mesh.faces)) {
    const bool proof = need.stage == "certify";
    bool pass = false;
    for (int p = 0; p < kLevelPasses; ++p) pass |= need.stage == SimplifyPass{p, 0, false}.stage_name();
    if (!proof && !pass) continue;
    need.stage = named(1, need.stage);
    needs.push_back(need);
  }
  return needs;
}

TilesDisk tiles_disk(const TilesOptions& options, const MeshSize& mesh) {
  const bool textured = options.has_texture();
  return {bytes_of(mesh.faces, kWorkBytes + (textured ? kTexturePointBytes : 0.0)),
          bytes_of(mesh.faces, kSiteBytes + (options.normals ? kNormalBytes : 0.0) +
                                   (textured ? kTextureSiteBytes : 0.0))};
}

std::vector<DiskNeed> tiles_disk_needs(const TilesDisk& disk, const std::filesystem::path& site,
                                       const std::filesystem::path& work) {
  const auto left = [](std::uint64_t bytes, const std::filesystem::path& folder) {
    return bytes - std::min(bytes, bytes_below(folder));
  };
  return {{site, left(disk.site, site / "tiles"), "the site " + site.string()},
          {work, left(disk.work, work), "its work directory " + work.string()}};
}

}  // namespace tessera
