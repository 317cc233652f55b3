// The tree of tiles and its JSON, in one file or in many.
#include "stream/stages/tiles/tileset.h"
#include "stream/files/json.h"

#include <catch2/catch.hpp>

#include "tests/helpers/tiles_site.h"

namespace tileset_test {

using namespace tessera;
using namespace tessera::test;

namespace {

/// A row of bricks, halved from level to level; level 0 has 64 tiles.
std::vector<TileLevel> row_of_tiles() {
  std::vector<TileLevel> levels;
  for (std::uint32_t l = 0; l < 7; ++l) {
    TileLevel level;
    level.grid.step = 0x1p-6 * (1 << l);
    level.step_bound = l == 0 ? 0.0 : 0.01 * (1 << l);
    for (std::uint64_t t = 0; t < (64u >> l); ++t) {
      TileRecord r;
      r.cell = {t, l, t << l, (t + 1) << l};
      r.low[0] = static_cast<std::int64_t>(64 * t) - 1;
      r.high[0] = static_cast<std::int64_t>(64 * (t + 1));
      level.tiles.push_back(r);
    }
    levels.push_back(level);
  }
  return levels;
}

}  // namespace

TEST_CASE("tileset: one file or many, the same tree", "[unit]") {
  const std::size_t maximum = GENERATE(2, 5, 30, 1000);
  const std::vector<TileLevel> levels = row_of_tiles();
  const TileTree tree = make_tile_tree(levels, maximum);
  const TempFolder folder;
  std::size_t files = 0;
  std::string last;
  write_tilesets(tree, {1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 10, 20, 30, 1}, 100.0,
                 [&](const std::string& name, const std::string& text) {
                   const auto path = folder.path() / (name.empty() ? "tileset.json" : name);
                   std::filesystem::create_directories(path.parent_path());
                   folder.write(path.lexically_relative(folder.path()).string(), text);
                   const auto all = parse_json(text);
                   ++files;
                   last = name;
                 });
  CHECK(last.empty());
  CHECK((files > 1) == (maximum < 127));
  for (std::size_t l = 0; l < levels.size(); ++l)
    for (std::size_t t = 0; t < levels[l].tiles.size(); ++t) {
      const auto path = folder.path() / tile_file(static_cast<int>(l), t);
      std::filesystem::create_directories(path.parent_path());
      folder.write(path.lexically_relative(folder.path()).string(), "");
    }
  const Site site = read_site(folder.path() / "tileset.json");
  CHECK(site.tiles.size() == 127);
  CHECK(site.transform[13] == 20.0);
  CHECK(site.tiles[0].low[0] == -1.0);  // the step of the root, beyond all others
  CHECK(site.tiles[0].high[0] == 64.0);
  for (const SiteTile& tile : site.tiles) CHECK((tile.children.size() == 2 || tile.children.empty()));
}

TEST_CASE("tileset: the error of a level holds its bound and that of the level below, and rises", "[unit]") {
  std::vector<TileLevel> levels = row_of_tiles();
  const TileTree tree = make_tile_tree(levels, 1000);
  double sum = 0.0, before = 0.0;
  for (std::size_t l = 0; l < levels.size(); ++l) {
    sum += levels[l].step_bound;
    const double bound = sum + levels[l].grid.error();
    CHECK(tree.error[l] >= bound + before);
    CHECK(tree.error[l] == Approx(bound + before));
    if (l > 0) CHECK(tree.error[l] > tree.error[l - 1]);
    before = bound;
  }
  for (TileLevel& level : levels)
    level.step_bound = 0.0, level.grid.step = 0x1p-6;  // nothing tells levels apart
  const TileTree flat = make_tile_tree(levels, 1000);
  for (std::size_t l = 1; l < levels.size(); ++l) CHECK(flat.error[l] > flat.error[l - 1]);
}

TEST_CASE("tileset: where nothing shrinks any more, a root without content holds what is left", "[unit]") {
  std::vector<TileLevel> levels = row_of_tiles();
  levels.resize(3);
  const TempFolder folder;
  std::string text;
  write_tilesets(make_tile_tree(levels, 1000), {1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1}, 100.0,
                 [&](const std::string&, const std::string& t) { text = t; });
  const auto all = parse_json(text);
  CHECK_FALSE(all.at("root").contains("content"));
  CHECK(all.at("root").at("children").size() == 16);
  CHECK(all.at("root").at("geometricError") == 100.0);
}

}  // namespace tileset_test
