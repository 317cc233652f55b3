#include "stream/stages/surface/dense_bricks.h"

#include <algorithm>
#include <utility>

#include "kernels/field/field_parts.h"
#include "stream/stages/surface/surface_stage.h"

namespace tessera {
namespace {

/// Room for points, however small the limit: parts with fewer read their halos again and again.
constexpr std::uint64_t kMinPointBytes = 16u << 20;

std::uint64_t room_for_points(std::uint64_t bytes_limit, std::uint64_t band) {
  return std::max(kMinPointBytes, bytes_limit - std::min(band, bytes_limit));
}

/// `use(corner)` of every part.
template <class Use>
void for_each_part(const Tile& tile, int edge, const Use& use) {
  const Int3 low = tile.corner(), size = tile.edges();
  for (int z = 0; z < size[2]; z += edge)
    for (int y = 0; y < size[1]; y += edge)
      for (int x = 0; x < size[0]; x += edge) use(Int3{low[0] + x, low[1] + y, low[2] + z});
}

}  // namespace

TileCut cut_tile(const PointStore& store, const BrickSectionStore* closing, const Tile& tile, int halo_cells,
                 std::uint64_t bytes_limit) {
  const std::uint64_t band = tile_band_bytes(store.bricks(), closing, tile, halo_cells);
  const std::uint64_t room = room_for_points(bytes_limit, band);
  const std::uint64_t told = tile_bytes(store.bricks(), closing, tile, halo_cells);
  if (tile.bricks > 1 || told - band <= room) return {0, told};
  const auto points = [&](const Int3& corner, int edge) {
    return tile_point_bytes(store.count_bound(corner, {edge, edge, edge}, halo_cells), closing);
  };
  TileCut cut{0, band + points(tile.corner(), kBrickCells)};
  // What closes holes is summed up for a tile as a whole.
  if (closing) return cut;
  for (int edge = kBrickCells / 2; cut.bytes - band > room && edge >= kLeafCells; edge /= 2) {
    std::uint64_t largest = 0;
    for_each_part(tile, edge, [&](const Int3& corner) { largest = std::max(largest, points(corner, edge)); });
    cut = {edge, band + largest};
  }
  return cut;
}

std::uint64_t expected_tile_bytes(std::span<const BrickEntry> bricks, const BrickSectionStore* closing,
                                  const Tile& tile, int halo_cells, std::uint64_t bytes_limit) {
  // A part of 8^3 cells with its halo holds a 25th of the cells that the brick needs, and of a plane an eighth.
  constexpr double kMargin = 2.0, kSmallestPart = 0.25;
  const std::uint64_t told = tile_bytes(bricks, closing, tile, halo_cells);
  const std::uint64_t band = tile_band_bytes(bricks, closing, tile, halo_cells);
  const std::uint64_t room = room_for_points(bytes_limit, band);
  if (tile.bricks > 1 || told - band <= room) return told;
  double points = 0.0;
  for (int d = 0; d < 27; ++d) {
    const Int3 step = {d % 3 - 1, d / 3 % 3 - 1, d / 9 - 1};
    double share = step == Int3{0, 0, 0} ? 1.0 : kMargin;
    Int3 at;
    for (std::size_t a = 0; a < 3; ++a) {
      at[a] = tile.brick[a] + step[a];
      if (step[a] != 0) share *= std::min(1.0, static_cast<double>(halo_cells) / kBrickCells);
    }
    if (at[0] < 0 || at[1] < 0 || at[2] < 0) continue;
    if (const BrickEntry* brick = find_brick(bricks, brick_key(at)))
      points += std::min(1.0, share) * static_cast<double>(brick->points);
  }
  const auto bytes_of_points = [&](double count) {
    return tile_point_bytes(static_cast<std::uint64_t>(count), closing);
  };
  const std::uint64_t whole = std::min(told - band, bytes_of_points(points));
  if (closing) return band + whole;
  return band + std::min(whole, std::max(room, bytes_of_points(kSmallestPart * points)));
}

DirectedField field_in_parts(const PointStore& store, const Tile& tile, int edge, const FieldOptions& options,
                             std::uint64_t& own_points, TaskContext& context) {
  const auto evaluate = [&](const Int3& corner, const Int3& cells) {
    context.check_stop();
    const PointBlock points = store.load(corner, cells, field_halo_cells(options));
    if (points.size() == 0) return DirectedField();
    own_points += core_points(points);
    context.count_read(points.size() * sizeof(PointRecord));
    return evaluate_field(points, options);
  };
  if (edge == 0) return evaluate(tile.corner(), tile.edges());
  FieldParts parts(tile.corner(), tile.edges());
  for_each_part(tile, edge, [&](const Int3& corner) {
    DirectedField part = evaluate(corner, {edge, edge, edge});
    if (!part.leaves.empty()) parts.add(std::move(part));
  });
  return std::move(parts).take();
}

}  // namespace tessera
