#include "stream/stages/tiles/tiles_stage.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numeric>
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
#include "stream/runtime/serial_stage.h"
#include "stream/stages/tiles/grid_contacts.h"
#include "stream/stages/tiles/tile_levels.h"
#include "stream/stages/tiles/tile_points_stage.h"
#include "stream/stages/tiles/tile_texture.h"

namespace tessera {
namespace {

namespace fs = std::filesystem;

constexpr std::uint64_t kTaskFaces = 1u << 19;  ///< a task is worth a file from here
constexpr std::uint64_t kMaxTasks = 400;
constexpr const char* kRecords = "records/";
constexpr const char* kGrid = "grid.json";
constexpr const char* kFinerGrid = "finer-grid.json";  ///< there where faces meet by the first grid
constexpr const char* kTileTextures = "textures.json";
/// Of the tiles of a level, so many fit the 16 bits of their grid; wider ones have floats.
constexpr double kNarrowShare = 0.9;
constexpr double kSides = 1.125;  ///< for the rows of faces that a tile shares with its neighbours

static_assert(std::is_trivially_copyable_v<TileRecord>, "records are kept as they lie in memory");

double largest_extent(const MeshBox& box) {
  double widest = 0.0;
  for (std::size_t k = 0; k < 3; ++k) widest = std::max(widest, box.high[k] - box.low[k]);
  return widest;
}

/// Smallest power of two above `value` > 0.
double power_above(double value) {
  int exponent = 0;
  std::frexp(value, &exponent);
  return std::ldexp(1.0, exponent);
}

MeshBox box_around(const MeshBlock& block) {
  MeshBox box{block.position.at(0), block.position.at(0)};
  for (const Double3& p : block.position)
    for (std::size_t k = 0; k < 3; ++k) {
      box.low[k] = std::min(box.low[k], p[k]);
      box.high[k] = std::max(box.high[k], p[k]);
    }
  return box;
}

/// A tile has fewer steps (quantise_tile).
constexpr std::int64_t kMaxSteps = std::int64_t{1} << 24;

/// No grid is finer than doubles are there.
double finest_step(const MeshBox& box) {
  double step = std::ldexp(1.0, -900);
  for (std::size_t k = 0; k < 3; ++k) step = std::max(step, 0x1p-46 * std::abs(box.low[k]));
  return step;
}

std::vector<TileRecord> read_records(const fs::path& folder) {
  std::vector<TileRecord> all;
  for (const fs::path& path : list_task_files(folder / kRecords, ".bin")) {
    const ReadFile file(path);
    const std::size_t before = all.size();
    all.resize(before + file.size() / sizeof(TileRecord));
    file.read_at(0, all.data() + before, (all.size() - before) * sizeof(TileRecord));
  }
  return all;
}

struct LevelGrid {
  TileGrid grid;
  std::uint64_t met = 0, met_first = 0;
};

/// The finer grid where there is one.
LevelGrid read_grid(const fs::path& folder) {
  const Json first = parse_json(read_text(folder / kGrid));
  const Json chosen = fs::exists(folder / kFinerGrid) ? parse_json(read_text(folder / kFinerGrid)) : first;
  return {{first.at("origin").get<Double3>(), chosen.at("step").get<double>()},
          chosen.at("met_by_grid").get<std::uint64_t>(),
          first.at("met_by_grid").get<std::uint64_t>()};
}

Double3 origin_of(const MeshBox& box) {
  double maximum = largest_extent(box);
  for (std::size_t k = 0; k < 3; ++k) maximum = std::max(maximum, 0x1p-30 * std::abs(box.low[k]));
  const double unit = power_above(maximum) * 0x1p-8;
  Double3 origin;
  for (std::size_t k = 0; k < 3; ++k)
    origin[k] = std::floor(0.5 * (box.low[k] + box.high[k]) / unit + 0.5) * unit;
  return origin;
}

/// A level cut into tiles, and the first grid of their positions.
class LevelStage : public Stage {
 public:
  LevelStage(const fs::path& work, const TilesOptions& options, int level)
      : level_(level),
        bound_(level_bound(work, level)),
        level0_(open_level(work, 0)),
        store_(level > 0 ? open_level(work, level) : open_level(work, 0)) {
    std::vector<std::uint64_t> keys;
    for (const MeshPatchEntry& p : level0_.patches()) keys.push_back(p.key);
    BrickFaces bricks;
    for (const MeshPatchEntry& p : store_.patches()) {
      bricks.key.push_back(p.key);
      bricks.faces.push_back(p.faces);
    }
    std::vector<TileCell> below;
    if (level > 0)
      for (const TileRecord& r : read_records(work / level_folder(level - 1))) below.push_back(r.cell);
    cells_ = cut_level(keys, bricks, below, options.tile_faces);
    choose_grid();
    // Bricks that hold no face of level 0 count nowhere here; their faces are in tiles all the same.
    const std::uint64_t each =
        std::max<std::uint64_t>(1, store_.face_count() / std::max<std::size_t>(1, cells_.size()));
    const std::uint64_t target = std::max(kTaskFaces, store_.face_count() / kMaxTasks);
    per_task_ = static_cast<std::size_t>(std::max<std::uint64_t>(1, target / each));
  }

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
    std::iota(patches.begin(), patches.end(), cell.first);
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

  MeshBlock load(const TileCell& cell) const {
    if (level_ == 0) return store_.load(bricks_of(cell));
    const MeshBlock near = store_.load_box(grown(box_of(cell), bound_));
    std::vector<MeshBox> covered;
    for (std::uint64_t p = cell.first; p < cell.last; ++p)
      covered.push_back(grown(level0_.patches()[p].box, bound_));
    std::vector<std::uint8_t> keep(near.faces.size(), 0);
    std::size_t last = 0;  // neighbours in the order of faces meet the same box
    for (std::size_t f = 0; f < keep.size(); ++f) {
      MeshBox box{near.position[near.faces[f][0]], near.position[near.faces[f][0]]};
      for (const std::uint32_t v : near.faces[f])
        for (std::size_t k = 0; k < 3; ++k) {
          box.low[k] = std::min(box.low[k], near.position[v][k]);
          box.high[k] = std::max(box.high[k], near.position[v][k]);
        }
      if (overlap(box, covered[last])) {
        keep[f] = 1;
        continue;
      }
      for (std::size_t b = 0; b < covered.size() && keep[f] == 0; ++b)
        if (overlap(box, covered[b])) {
          keep[f] = 1;
          last = b;
        }
    }
    return select_faces(near, keep);
  }

  int level_;
  double bound_;
  MeshStore level0_;
  MeshStore store_;
  std::vector<TileCell> cells_;
  TileGrid grid_;

 private:
  /// Proven: between this level and level 0, as both are without grids.
  static double level_bound(const fs::path& work, int level) {
    double sum = 0.0;
    for (int l = 1; l <= level; ++l) sum += level_step_bound(work, l);
    return sum;
  }

  void choose_grid() {
    grid_.origin = origin_of(level0_.box());
    std::vector<double> extents;
    for (const TileCell& cell : cells_) extents.push_back(kSides * largest_extent(box_of(cell)));
    std::sort(extents.begin(), extents.end());
    const auto at = static_cast<std::size_t>(kNarrowShare * static_cast<double>(extents.size() - 1));
    // At the least every tile fits the 24 bits of a float.
    const double whole = largest_extent(level0_.box());
    grid_.step = power_above(std::max({extents[at] / 65535.0, whole * 0x1p-22, finest_step(level0_.box())}));
  }

  std::size_t per_task_ = 1;
};

/// What meets by the first grid.
class GridStage : public LevelStage {
 public:
  using LevelStage::LevelStage;
  std::string name() const override { return "grid"; }

  Json run(std::size_t task, TaskContext& context) const override {
    std::uint64_t met = 0;
    std::int64_t widest = 0;
    for (std::size_t c = first(task); c < first(task + 1); ++c) {
      context.check_stop();
      const MeshBlock block = load(cells_[c]);
      const TileMesh tile = quantise_tile(block, grid_, {});
      met += pairs_met_by_grid(block, tile);
      for (std::size_t k = 0; k < 3; ++k) widest = std::max(widest, tile.high[k] - tile.low[k]);
      context.count_read(loaded_bytes(cells_[c]));
      context.advance(1);
    }
    return {{"met_by_grid", met}, {"widest", widest}};
  }

  Json finish(const std::vector<Json>& summaries, TaskContext& context) const override {
    std::int64_t widest = 0;
    std::uint64_t met = 0;
    for (const Json& s : summaries) {
      met += s.at("met_by_grid").get<std::uint64_t>();
      widest = std::max(widest, s.at("widest").get<std::int64_t>());
    }
    write_durably(
        context.create(kGrid),
        dump_json(
            Json{{"step", grid_.step}, {"origin", grid_.origin}, {"met_by_grid", met}, {"widest", widest}}));
    return {{"level", level_}, {"grid_step", grid_.step}, {"met_by_grid", met}};
  }
};

/// Counts what meets on every grid that is finer by a power of two, and chooses one.
class FinerGridStage : public LevelStage {
 public:
  FinerGridStage(const fs::path& work, const TilesOptions& options, int level)
      : LevelStage(work, options, level) {
    const Json first = parse_json(read_text(work / level_folder(level) / kGrid));
    met_ = first.at("met_by_grid").get<std::uint64_t>();
    // A vertex lies up to half a step of the first grid outside of where it has the tile.
    const auto widest = first.at("widest").get<std::int64_t>() + 1;
    const double finest = finest_step(level0_.box());
    while ((widest << (halvings_ + 1)) < kMaxSteps && step(halvings_ + 1) >= finest) ++halvings_;
  }
  std::string name() const override { return "finer-grid"; }

  Json run(std::size_t task, TaskContext& context) const override {
    std::vector<std::uint64_t> met(halvings_, 0);
    for (std::size_t c = first(task); c < first(task + 1); ++c) {
      const MeshBlock block = load(cells_[c]);
      for (std::size_t h = 0; h < halvings_; ++h) {
        context.check_stop();
        met[h] += pairs_met_by_grid(block, quantise_tile(block, {grid_.origin, step(h + 1)}, {}));
      }
      context.count_read(loaded_bytes(cells_[c]));
      context.advance(1);
    }
    return {{"met", met}};
  }

  Json finish(const std::vector<Json>& summaries, TaskContext& context) const override {
    std::vector<std::uint64_t> met(halvings_ + 1, 0);
    met[0] = met_;
    for (const Json& s : summaries)
      for (std::size_t h = 1; h < met.size(); ++h) met[h] += s.at("met").at(h - 1).get<std::uint64_t>();
    // The coarsest of the best: finer ones make larger files.
    const auto best = static_cast<std::size_t>(std::min_element(met.begin(), met.end()) - met.begin());
    write_durably(context.create(kFinerGrid),
                  dump_json(Json{{"step", step(best)}, {"met_by_grid", met[best]}}));
    return {{"level", level_}, {"grid_step", step(best)}, {"met_by_grid", met}};
  }

 private:
  double step(std::size_t halvings) const { return std::ldexp(grid_.step, -static_cast<int>(halvings)); }

  std::uint64_t met_ = 0;
  std::size_t halvings_ = 0;
};

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
    write_durably(context.create(kTileTextures), dump_json(texture));
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

std::unique_ptr<Stage> make_grid_stage(const JobState& state, const TilesOptions& options, int level) {
  return std::make_unique<GridStage>(state.work.parent_path(), options, level);
}

std::unique_ptr<Stage> make_finer_grid_stage(const JobState& state, const TilesOptions& options, int level) {
  if (parse_json(read_text(state.work / kGrid)).at("met_by_grid") == 0) return make_idle_stage("finer-grid");
  return std::make_unique<FinerGridStage>(state.work.parent_path(), options, level);
}

std::unique_ptr<Stage> make_tiles_stage(const JobState& state, const TilesOptions& options, int level) {
  return std::make_unique<TilesStage>(state.work.parent_path(), state.output, options, level);
}

}  // namespace tessera
