#include "stream/stages/tiles/tiles_stage.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <type_traits>

#include "kernels/mesh/mesh_block_ops.h"
#include "kernels/texture/normal_map.h"
#include "stream/files/direct_file.h"
#include "stream/files/durable_file.h"
#include "stream/files/json.h"
#include "stream/files/read_file.h"
#include "stream/files/task_files.h"
#include "stream/meshes/mesh_store.h"
#include "stream/runtime/journal.h"
#include "stream/stages/tiles/level_stage.h"
#include "stream/stages/tiles/tile_levels.h"
#include "stream/stages/tiles/tile_points_stage.h"
#include "stream/stages/tiles/tile_texture.h"

namespace tessera {
namespace {

namespace fs = std::filesystem;

constexpr const char* kTileTextures = "textures.json";
MeshBox box_around(const MeshBlock& block) {
  MeshBox box{block.position.at(0), block.position.at(0)};
  for (const Double3& p : block.position)
    for (std::size_t k = 0; k < 3; ++k) {
      box.low[k] = std::min(box.low[k], p[k]);
      box.high[k] = std::max(box.high[k], p[k]);
    }
  return box;
}

class TilesStage : public LevelStage {
 public:
  TilesStage(const fs::path& work, const fs::path& output, const TilesOptions& options, int level)
      : LevelStage(work, options, level),
        output_(output),
        normals_(options.normals),
        textured_(level_has_texture(work, options, level)) {
    grid_ = read_grid(work / level_folder(level)).grid;
    if (textured_) {
      texture_ = TileTextureScale::of_level(work, level);
      points_ = std::make_unique<TexturePoints>(texture_.points);
    }
  }

  std::string name() const override { return "tiles"; }

  std::uint64_t task_bytes(std::size_t task) const override {
    std::uint64_t texture = 0;
    for (std::size_t c = first(task); textured_ && c < first(task + 1); ++c)
      texture = std::max(texture, texture_bytes(cells_[c]));
    return LevelStage::task_bytes(task) + texture;
  }

  Json run(std::size_t task, TaskContext& context) const override {
    // An older site loses its name before its first tile goes.
    if (std::error_code ignored; level_ == 0) fs::remove(output_, ignored);
    TileTextureSums sums;
    DirectFile records(context.create(kRecords + task_file_stem(task) + ".bin"), std::size_t{1} << 16);
    for (std::size_t c = first(task); c < first(task + 1); ++c) {
      context.check_stop();
      MeshBlock block = load(cells_[c]);
      TileRecord record;
      record.cell = cells_[c];
      std::vector<Double3> normals;
      if (normals_) normals = star_normals(block, store_.load_box(box_around(block)));
      TilePicture picture;
      if (textured_) split_charts(block, normals, picture, sums);
      const TileMesh tile = quantise_tile(block, grid_, std::move(normals), picture);
      record.bytes = write_tile(tile, c, context);
      record.vertices = tile.position.size();
      record.faces = tile.faces.size();
      std::copy(tile.low.begin(), tile.low.end(), record.low);
      std::copy(tile.high.begin(), tile.high.end(), record.high);
      records.write(&record, sizeof record);
      context.count_read(store_.block_bytes(patches_of(cells_[c])));
      context.count_written(record.bytes);
      context.advance(1);
    }
    context.count_written(records.finish());
    return textured_ ? sums.to_json() : Json::object();
  }

  std::uint64_t finish_bytes() const override {
    return (cells_.size() + 1) * sizeof(TileRecord) + (1u << 20);
  }

  Json finish(const std::vector<Json>& summaries, TaskContext& context) const override {
    Json texture = Json::object();
    if (textured_) {
      TileTextureSums sums;
      for (const Json& s : summaries) sums.merge(TileTextureSums::of_json(s));
      texture = sums.report();
      texture["texel"] = texture_.texel;
    }
    write_text(context.create(kTileTextures), dump_json(texture));
    return {{"level", level_},
            {"tiles", cells_.size()},
            {"faces", store_.face_count()},
            {"bound", bound_},
            {"grid_step", grid_.step}};
  }

 private:
  std::uint64_t write_tile(const TileMesh& tile, std::size_t number, TaskContext& context) const {
    const std::string glb = tile_glb(tile);
    DirectFile file(context.create(kSidecarName + tile_file(level_, number)), std::size_t{1} << 18);
    file.write(glb.data(), glb.size());
    return file.finish();
  }

  /// Vertices where charts meet become several, and the tile gets its picture.
  void split_charts(MeshBlock& block, std::vector<Double3>& normals, TilePicture& picture,
                    TileTextureSums& sums) const {
    TileTexture texture = make_tile_texture(block, *points_, texture_.texel, texture_.spacing, sums);
    MeshBlock split;
    std::vector<Double3> split_normals;
    for (const std::uint32_t v : texture.vertex) {
      split.key.push_back(block.key[v]);
      split.position.push_back(block.position[v]);
      split.vertex_class.push_back(block.vertex_class[v]);
      if (!normals.empty()) split_normals.push_back(normals[v]);
    }
    split.faces = std::move(texture.faces);
    split.face_flags = std::move(block.face_flags);
    block = std::move(split);
    normals = std::move(split_normals);
    picture.uv = std::move(texture.uv);
    picture.jpeg = std::move(texture.jpeg);
  }

  std::uint64_t texture_bytes(const TileCell& cell) const {
    const std::vector<std::size_t> patches = patches_of(cell);
    std::uint64_t faces = 0;
    for (const std::size_t p : patches) faces += store_.patches()[p].faces;
    return tile_texture_bytes(
        faces, points_->count(grown(store_.box_of(patches), tile_texture_radius(texture_.spacing))));
  }

  std::uint64_t loaded_bytes(const TileCell& cell) const override {
    std::uint64_t bytes = LevelStage::loaded_bytes(cell);
    if (normals_) bytes += store_.block_bytes(store_.select(store_.box_of(patches_of(cell))));
    return bytes;
  }

  fs::path output_;
  bool normals_, textured_;
  TileTextureScale texture_;
  std::unique_ptr<TexturePoints> points_;
};

}  // namespace

Double3 tiles_origin(const fs::path& work) {
  return origin_of(open_level(work, 0).box());
}

TileLevel read_tile_level(const fs::path& work, int level) {
  TileLevel out;
  const fs::path folder = work / level_folder(level);
  const LevelGrid grid = read_grid(folder);
  out.grid = grid.grid;
  out.met_by_grid = grid.met;
  out.met_by_first_grid = grid.met_first;
  out.step_bound = level_step_bound(work, level);
  out.tiles = read_records(folder);
  out.texture = parse_json(read_text(folder / kTileTextures));
  return out;
}

std::string tile_file(int level, std::size_t tile) {
  return "tiles/" + std::to_string(level) + "/" + task_file_stem(tile) + ".glb";
}

std::uint64_t tile_task_bytes(std::uint64_t block_bytes) {
  // What is loaded, what of it is kept, and that once more as the tile with its streams; or its faces beside it, and their tree.
  return 3 * block_bytes + (std::uint64_t{1} << 20);
}

std::unique_ptr<Stage> make_tiles_stage(const JobState& state, const TilesOptions& options, int level) {
  return std::make_unique<TilesStage>(state.work.parent_path(), state.output, options, level);
}

}  // namespace tessera
