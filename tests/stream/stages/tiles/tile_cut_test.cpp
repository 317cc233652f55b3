// Which tiles a level has: cells within the limit, nested from level to level.
#include "stream/stages/tiles/tile_cut.h"

#include <catch2/catch.hpp>

#include <numeric>
#include <set>

#include "octree/portable_math.h"

namespace tile_cut_test {

using namespace tessera;

namespace {

/// Bricks at random places of an octree of depth 4, with 1 to 100 faces each.
BrickFaces bricks_of(std::uint64_t seed) {
  std::set<std::uint64_t> keys;
  for (std::uint64_t i = 0; i < 600; ++i) keys.insert(random_bits(seed, 1, i) % 4096);
  BrickFaces out;
  for (const std::uint64_t key : keys) {
    out.key.push_back(key);
    out.faces.push_back(1 + random_bits(seed, 2, key) % 100);
  }
  return out;
}

std::uint64_t faces_in(const BrickFaces& level, const TileCell& cell) {
  std::uint64_t sum = 0;
  for (std::size_t i = 0; i < level.key.size(); ++i)
    if (level.key[i] >> 3 * cell.depth == cell.code) sum += level.faces[i];
  return sum;
}

}  // namespace

TEST_CASE("tile cut: cells hold every brick once, none could be larger", "[property]") {
  const BrickFaces level = bricks_of(GENERATE(1, 2, 3));
  const std::uint64_t limit = GENERATE(50, 400, 100000);
  const std::vector<TileCell> cells = cut_level(level.key, level, {}, limit);
  std::uint64_t next = 0;
  for (const TileCell& cell : cells) {
    CHECK(cell.first == next);
    next = cell.last;
    for (std::uint64_t p = cell.first; p < cell.last; ++p) CHECK(level.key[p] >> 3 * cell.depth == cell.code);
    CHECK((cell.depth == 0 || faces_in(level, cell) <= limit));
    TileCell parent = cell;
    ++parent.depth, parent.code >>= 3;
    if (cells.size() > 1) CHECK(faces_in(level, parent) > limit);
  }
  CHECK(next == level.key.size());
}

TEST_CASE("tile cut: cells of a level consist of whole cells of the level below, up to one", "[property]") {
  const BrickFaces level0 = bricks_of(GENERATE(4, 5, 6));
  std::vector<TileCell> below = cut_level(level0.key, level0, {}, 300);
  BrickFaces level = level0;
  for (int l = 1; l < 12 && below.size() > 1; ++l) {
    // Faces shrink, in some places not at all; some move to bricks where nothing was.
    for (std::size_t i = 0; i < level.key.size(); ++i)
      if (l > 6 || random_bits(9, static_cast<std::uint64_t>(l), i) % 4 != 0)
        level.faces[i] = (level.faces[i] + 2) / 3;
    const std::vector<TileCell> cells = cut_level(level0.key, level, below, 300);
    std::size_t b = 0;
    for (const TileCell& cell : cells) {
      REQUIRE(b < below.size());
      CHECK(below[b].first == cell.first);
      while (b < below.size() && below[b].last <= cell.last) ++b;
      CHECK(below[b - 1].last == cell.last);
    }
    CHECK(b == below.size());
    CHECK(cells.size() <= below.size());
    below = cells;
  }
  level.faces.assign(level.faces.size(), 0);
  CHECK(cut_level(level0.key, level, below, 300).size() == 1);
}

}  // namespace tile_cut_test
