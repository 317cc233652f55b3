#include "stream/stages/solid/distance_tiles.h"

#include <algorithm>
#include <cmath>

#include "stream/files/task_files.h"
#include "stream/stages/solid/solid_stages.h"

namespace tessera {
namespace {

constexpr std::size_t kMaxCubeGroups = 400;
constexpr int kSuper = 4;  ///< tasks are made of cubes of so many bricks
constexpr int kSuperBits = 6;
constexpr std::uint64_t kTileTaskBytes = std::uint64_t{12} << 20;  ///< write buffers

}  // namespace

DistanceTiles::DistanceTiles(const JobState& state, double halo, std::uint64_t value_bytes)
    : plan_(Plan::of_work(state.work)),
      halo_(halo * plan_.lattice.h),
      value_bytes_(value_bytes),
      mesh_(open_solid_mesh(state.work)),
      signs_(load_solid_signs(state.work)),
      mesh_files_(list_task_files(state.work / "solid", ".tmm").size()) {
  const std::vector<std::uint64_t> cubes = find_cubes();
  const std::size_t each = (cubes.size() + kMaxCubeGroups - 1) / kMaxCubeGroups;
  for (std::size_t first = 0; first < cubes.size(); first += each)
    groups_.emplace_back(cubes.begin() + static_cast<std::ptrdiff_t>(first),
                         cubes.begin() + static_cast<std::ptrdiff_t>(std::min(first + each, cubes.size())));
  const std::uint64_t share = state.run.memory_bytes / 2 / static_cast<std::uint64_t>(state.run.threads);
  edge_ = state.run.tile_cells >= 2 * kBrickCells || state.run.tile_cells <= 0 ? 2 : 1;
  for (std::size_t g = 0; g < groups_.size() && edge_ > 1; ++g)
    if (task_bytes(g) > share) edge_ = 1;
}

std::uint64_t DistanceTiles::cubes() const {
  std::uint64_t sum = 0;
  for (const auto& group : groups_) sum += group.size();
  return sum;
}

MeshBox DistanceTiles::surroundings(const Tile& tile) const {
  MeshBox box;
  const Int3 corner = tile.corner(), edges = tile.edges();
  for (std::size_t a = 0; a < 3; ++a) {
    box.low[a] = plan_.lattice.world(static_cast<int>(a), corner[a]);
    box.high[a] = plan_.lattice.world(static_cast<int>(a), corner[a] + edges[a]);
  }
  return grown(box, halo_);
}

std::vector<std::uint64_t> DistanceTiles::find_cubes() const {
  std::vector<std::uint64_t> cubes;
  const auto unique = [&] {
    std::sort(cubes.begin(), cubes.end());
    cubes.erase(std::unique(cubes.begin(), cubes.end()), cubes.end());
  };
  const double edge = plan_.lattice.h * kBrickCells * kSuper;
  std::size_t sorted = 0;
  for (const MeshPatchEntry& e : mesh_.patches()) {
    const MeshBox box = grown(e.box, halo_);
    Int3 low, high;
    for (std::size_t a = 0; a < 3; ++a) {
      const double origin = plan_.lattice.world(static_cast<int>(a), 0.0);
      low[a] = static_cast<int>(std::max(0.0, std::floor((box.low[a] - origin) / edge)));
      high[a] = static_cast<int>(std::max(0.0, std::floor((box.high[a] - origin) / edge)));
    }
    for (int z = low[2]; z <= high[2]; ++z)
      for (int y = low[1]; y <= high[1]; ++y)
        for (int x = low[0]; x <= high[0]; ++x) cubes.push_back(brick_key({x, y, z}));
    if (cubes.size() < 2 * sorted + (1u << 16)) continue;
    unique();
    sorted = cubes.size();
  }
  unique();
  return cubes;
}

TileGroup DistanceTiles::tiles_of(std::uint64_t cube) const {
  const Int3 corner = brick_of_key(cube << kSuperBits);
  const int tiles = kSuper / edge_;
  TileGroup out;
  for (std::uint64_t t = 0; t < static_cast<std::uint64_t>(tiles * tiles * tiles); ++t) {
    const Int3 at = brick_of_key(t);
    out.push_back({{corner[0] + edge_ * at[0], corner[1] + edge_ * at[1], corner[2] + edge_ * at[2]}, edge_});
  }
  return out;
}

std::uint64_t DistanceTiles::tile_bytes(const Tile& tile) const {
  const std::vector<std::size_t> near = mesh_.select(surroundings(tile));
  if (near.empty()) return 0;
  std::uint64_t vertices = 0, faces = 0;
  for (const std::size_t p : near) vertices += mesh_.patches()[p].vertices, faces += mesh_.patches()[p].faces;
  const auto edge = static_cast<std::uint64_t>(tile.bricks) * kBrickCells / kLeafCells + 2;
  return mesh_.block_bytes(near) + OffsetSampler::bytes(vertices, faces) + edge * edge * edge * value_bytes_;
}

std::uint64_t DistanceTiles::brick_task_bytes(std::uint64_t faces, std::uint64_t value_bytes) {
  constexpr std::uint64_t kEdge = kBrickCells / kLeafCells + 2;
  const std::uint64_t vertices = faces / 2;
  return MeshStore::block_bytes(vertices, faces) + OffsetSampler::bytes(vertices, faces) +
         kEdge * kEdge * kEdge * value_bytes + kTileTaskBytes;
}

std::uint64_t DistanceTiles::task_bytes(std::size_t task) const {
  std::uint64_t maximum = 0;
  for (const std::uint64_t cube : groups_[task])
    for (const Tile& tile : tiles_of(cube)) maximum = std::max(maximum, tile_bytes(tile));
  return maximum + signs_.bytes() + kTileTaskBytes;
}

MeshBlock DistanceTiles::load(const Tile& tile) const {
  const MeshBox box = surroundings(tile);
  MeshBlock block;
  if (!mesh_.select(box).empty()) block = mesh_.load_box(box);
  quantise_cells(plan_.lattice, tile.corner(), block);
  return block;
}

}  // namespace tessera
