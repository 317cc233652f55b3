#include "stream/stages/tiles/tiles_needs.h"

#include <algorithm>
#include <string>

#include "stream/meshes/store_write_stage.h"
#include "stream/stages/decimate/simplify_needs.h"
#include "stream/stages/decimate/simplify_stage.h"
#include "stream/stages/tiles/cluster_stage.h"
#include "stream/stages/tiles/colour_stage.h"
#include "stream/stages/tiles/tile_levels.h"
#include "stream/stages/tiles/tile_points_stage.h"
#include "stream/stages/tiles/tile_texture.h"
#include "stream/stages/tiles/tiles_stage.h"
#include "stream/stages/tiles/tileset_stage.h"

namespace tessera {
namespace {

// Bytes a face, of meshes with colours.
constexpr double kWorkBytes =
    44.0;  ///< while the import has its faces dealt to buckets and the store half made
constexpr double kSiteBytes = 13.0;  ///< with grids finer than 16 bits, where faces would meet by those
constexpr double kNormalBytes = 1.0;
constexpr double kTexturePointBytes = 28.0;  ///< points of all levels, and what sorts the first
constexpr double kTextureSiteBytes = 4.0;
constexpr double kTilesPerLeast = 2.0 * 4.0 / 3.0;  ///< of all levels, for each full one of the first
constexpr double kUsedTexels = 0.7;                 ///< of those of a page, by faces

std::uint64_t bytes_of(std::uint64_t faces, double each) {
  return static_cast<std::uint64_t>(static_cast<double>(faces) * each);
}

}  // namespace

std::vector<StageNeed> tiles_needs(const RunOptions& run, const TilesOptions& options, const MeshSize& mesh,
                                   const PagesSize& pages) {
  std::vector<StageNeed> needs = import_needs(run, {0, kTilesImport}, mesh);
  const auto named = [](int level, const std::string& stage) { return level_folder(level) + "-" + stage; };
  const std::uint64_t tile = std::min(mesh.faces, options.tile_faces);
  const auto add_tiles = [&](int level, std::uint64_t sure, std::uint64_t likely) {
    // Each looks at whole tiles; a level's grids do so before its tiles.
    const StageNeed plain{"", tile_task_bytes(surface_block_bytes(tile / 4)),
                          tile_task_bytes(2 * surface_block_bytes(tile))};
    for (const char* stage : {"grid", "finer-grid"})
      needs.push_back({named(level, stage), plain.sure, plain.likely});
    needs.push_back({named(level, "tiles"), plain.sure + sure, plain.likely + likely});
  };
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
  add_tiles(0, sure, likely);
  const auto tiles =
      static_cast<std::uint64_t>(kTilesPerLeast * static_cast<double>(mesh.faces / (tile + 1)));
  needs.push_back({"tileset", tileset_bytes(0), tileset_bytes(tiles)});
  // Of those below as few stay as is asked for; where borders keep more of them blocks are no larger than they may be.
  std::uint64_t faces = mesh.faces;
  for (int level = 1; level <= kMaxLevels && faces > options.tile_faces; ++level, faces /= 4) {
    needs.push_back({named(level, "tolerance"), level_tolerance_bytes(faces), 0});
    const SimplifyOptions simplify;
    for (StageNeed need : simplify_needs(run, simplify, faces)) {
      const bool proof = need.stage == "certify";
      bool pass = false;
      for (int p = 0; p < kLevelPasses; ++p) pass |= need.stage == SimplifyPass{p, 0, false}.stage_name();
      if (!proof && !pass) continue;
      if (proof) needs.push_back({named(level, "cluster-certify"), 0, need.likely});
      need.stage = named(level, need.stage);
      needs.push_back(need);
    }
    needs.push_back(
        {named(level, "colours"), level_colour_bytes(faces, 1), level_colour_bytes(faces, kMaxAround)});
    // Which of both makes a level is seen when it is there.
    needs.push_back({named(level, "cluster"), 0, level_cluster_bytes(faces, kMaxAround)});
    if (options.has_texture())
      needs.push_back({named(level, "texture-points"), tile_points_bytes(sort_bytes(run), 0), 0});
    add_tiles(level, sure, likely);
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
