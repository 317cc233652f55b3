#include "stream/stages/tiles/level_stage.h"

#include <cmath>
#include <type_traits>

#include "kernels/mesh/mesh_block_ops.h"
#include "stream/files/json.h"
#include "stream/files/read_file.h"
#include "stream/files/task_files.h"
#include "stream/stages/tiles/tile_levels.h"

namespace tessera {
namespace {

namespace fs = std::filesystem;

constexpr std::uint64_t kTaskFaces = 1u << 19;  ///< a task is worth a file from here
constexpr std::uint64_t kMaxTasks = 400;
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

/// Proven: between this level and level 0, as both are without grids.
double level_bound(const fs::path& work, int level) {
  double sum = 0.0;
  for (int l = 1; l <= level; ++l) sum += level_step_bound(work, l);
  return sum;
}

}  // namespace

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

LevelStage::LevelStage(const fs::path& work, const TilesOptions& options, int level)
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

MeshBlock LevelStage::load(const TileCell& cell) const {
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

void LevelStage::choose_grid() {
  grid_.origin = origin_of(level0_.box());
  std::vector<double> extents;
  for (const TileCell& cell : cells_) extents.push_back(kSides * largest_extent(box_of(cell)));
  std::sort(extents.begin(), extents.end());
  const auto at = static_cast<std::size_t>(kNarrowShare * static_cast<double>(extents.size() - 1));
  // At the least every tile fits the 24 bits of a float.
  const double whole = largest_extent(level0_.box());
  grid_.step = power_above(std::max({extents[at] / 65535.0, whole * 0x1p-22, finest_step(level0_.box())}));
}

}  // namespace tessera
