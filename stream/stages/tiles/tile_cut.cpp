#include "stream/stages/tiles/tile_cut.h"

#include <algorithm>

#include "octree/lattice.h"

namespace tessera {
namespace {

class Cutter {
 public:
  Cutter(const BrickFaces& level, std::uint64_t tile_faces) : level_(level), tile_faces_(tile_faces) {
    sum_.push_back(0);
    for (const std::uint64_t f : level.faces) sum_.push_back(sum_.back() + f);
  }

  /// \param below  cells inside the node `code` of `depth`, ascending; at least one
  void cut(std::span<const TileCell> below, std::uint64_t code, std::uint32_t depth) {
    if ((below.size() == 1 && below[0].depth == depth) || faces(code, depth) <= tile_faces_) {
      cells.push_back({code, depth, below.front().first, below.back().last});
      return;
    }
    while (!below.empty()) {
      const auto child_of = [&](const TileCell& c) { return c.code >> 3 * (depth - 1 - c.depth); };
      const std::uint64_t child = child_of(below[0]);
      const auto end =
          std::find_if(below.begin(), below.end(), [&](const TileCell& c) { return child_of(c) != child; });
      const auto count = static_cast<std::size_t>(end - below.begin());
      cut(below.first(count), child, depth - 1);
      below = below.subspan(count);
    }
  }

  std::vector<TileCell> cells;

 private:
  std::uint64_t faces(std::uint64_t code, std::uint32_t depth) const {
    const auto index = [&](std::uint64_t key) {
      return static_cast<std::size_t>(std::lower_bound(level_.key.begin(), level_.key.end(), key) -
                                      level_.key.begin());
    };
    return sum_[index((code + 1) << 3 * depth)] - sum_[index(code << 3 * depth)];
  }

  const BrickFaces& level_;
  std::uint64_t tile_faces_;
  std::vector<std::uint64_t> sum_;
};

}  // namespace

std::vector<TileCell> cut_level(std::span<const std::uint64_t> level0, const BrickFaces& level,
                                std::span<const TileCell> below, std::uint64_t tile_faces) {
  std::vector<TileCell> bricks;
  if (below.empty()) {
    for (std::size_t p = 0; p < level0.size(); ++p) bricks.push_back({level0[p], 0, p, p + 1});
    below = bricks;
  }
  Cutter cutter(level, tile_faces);
  if (!below.empty()) cutter.cut(below, 0, kMaxCellBits);  // the node that holds every brick
  return std::move(cutter.cells);
}

}  // namespace tessera
