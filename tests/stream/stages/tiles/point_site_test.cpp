// Scans as 3D Tiles: every point is in one tile, in its box, and coarse tiles are as sparse as they say.
#include <catch2/catch.hpp>

#include <algorithm>
#include <cmath>
#include <map>
#include <string>
#include <vector>

#include "octree/error.h"
#include "stream/stages/tiles/point_site.h"
#include "tests/helpers/random.h"
#include "tests/helpers/temp_folder.h"
#include "tests/helpers/tiles_site.h"

namespace tessera::point_site_test {
namespace {

constexpr double kEast = 691600.0, kNorth = 5334700.0;

/// Waves of points, coloured by their place; every second one in another file.
std::vector<Double3> write_scans(const test::TempFolder& folder, std::size_t count) {
  test::Random random(5);
  std::vector<Double3> points;
  std::array<std::string, 2> text = {"x y z r g b\n", "x y z r g b\n"};
  char line[128];
  for (std::size_t i = 0; i < count; ++i) {
    const double x = kEast + std::floor(random.in(0, 80'000)) * 0.01,
                 y = kNorth + std::floor(random.in(0, 50'000)) * 0.01,
                 z = std::floor(random.in(0, 300) + 2000 * std::sin(x * 0.02)) * 0.01;
    points.push_back({x, y, z});
    std::snprintf(line, sizeof line, "%.2f %.2f %.2f %d 20 30\n", x, y, z, x < kEast + 400 ? 0 : 255);
    text[i % 2] += line;
  }
  text[0] += "nan 0 0 0 0 0\n";
  folder.write("a.xyz", text[0]);
  folder.write("b.xyz", text[1]);
  return points;
}

PointSiteReport write(const test::TempFolder& folder, const char* site, std::vector<const char*> inputs,
                      int threads, std::uint64_t memory) {
  PointSiteOptions options;
  for (const char* input : inputs) options.inputs.push_back(folder / input);
  options.site = folder / site;
  options.memory_bytes = memory;
  options.threads = threads;
  return write_point_site(options);
}

}  // namespace

TEST_CASE("point site: all points once, in the boxes of their tiles, coarse ones sparse", "[pipeline]") {
  const test::TempFolder folder;
  std::vector<Double3> want = write_scans(folder, 300'000);
  const PointSiteReport report = write(folder, "site", {"a.xyz", "b.xyz"}, 1, std::uint64_t{32} << 20);
  CHECK(report.points == want.size());
  CHECK(report.not_finite == 1);
  CHECK(report.colour);
  CHECK(report.levels >= 3);
  const test::Site site = test::read_site(folder / "site/tileset.json");
  REQUIRE(site.tiles.size() == report.tiles);
  CHECK(site.files.size() == test::site_bytes(folder / "site").size());
  const Double3 origin = {site.transform.at(12), site.transform.at(13), site.transform.at(14)};
  std::vector<Double3> got;
  std::size_t root_points = 0;
  bool inside = true, nested = true, finer = true, colours = true;
  for (std::size_t t = 0; t < site.tiles.size(); ++t) {
    const test::SiteTile& tile = site.tiles[t];
    const test::DecodedTile decoded = test::decode_tile(test::file_bytes(tile.content));
    CHECK(decoded.faces.empty());
    REQUIRE(decoded.colours.size() == decoded.points.size());
    for (std::size_t i = 0; i < decoded.points.size(); ++i) {
      Double3 p = decoded.points[i];
      for (std::size_t a = 0; a < 3; ++a) inside = inside && p[a] >= tile.low[a] && p[a] <= tile.high[a];
      got.push_back(p + origin);
      colours = colours && (std::abs(got.back()[0] - kEast - 400) < 0.02 ||
                            (decoded.colours[i][0] == 0) == (got.back()[0] < kEast + 400));
    }
    if (t == 0) root_points = got.size();
    finer = finer && (tile.children.empty() ? tile.error == 0.0 : tile.error > 0.0);
    for (const std::size_t c : tile.children) {
      for (std::size_t a = 0; a < 3; ++a)
        nested = nested && site.tiles[c].low[a] >= tile.low[a] && site.tiles[c].high[a] <= tile.high[a];
      finer = finer && site.tiles[c].error <= 0.5 * tile.error;
    }
  }
  CHECK(inside);
  CHECK(nested);
  CHECK(finer);
  CHECK(colours);
  CHECK(site.tiles[0].error == report.spacing);
  // Each lies where a point is: to the centimetre below the root, whose steps of a 64th of a metre may move one to the next.
  REQUIRE(got.size() == want.size());
  using Centimetres = std::array<long, 3>;
  const auto centimetres = [](const Double3& p) {
    return Centimetres{std::lround((p[0] - kEast) * 100), std::lround((p[1] - kNorth) * 100),
                       std::lround(p[2] * 100)};
  };
  std::map<Centimetres, int> left;
  for (const Double3& p : want) ++left[centimetres(p)];
  const auto take = [&](const Centimetres& c) {
    const auto at = left.find(c);
    if (at == left.end()) return false;
    if (--at->second == 0) left.erase(at);
    return true;
  };
  std::size_t lost = 0;
  for (std::size_t i = got.size(); i-- > root_points;) lost += take(centimetres(got[i])) ? 0 : 1;
  for (std::size_t i = 0; i < root_points; ++i) {
    bool found = false;
    for (int k = 0; k < 27 && !found; ++k) {
      Centimetres c = centimetres(got[i]);
      c[0] += k % 3 - 1, c[1] += k / 3 % 3 - 1, c[2] += k / 9 - 1;
      found = take(c);
    }
    lost += found ? 0 : 1;
  }
  CHECK(lost == 0);
  CHECK(left.empty());

  SECTION("the same bytes in any order, on any threads, with any memory; an older site goes") {
    folder.write("site/tiles/9.glb", "old");
    write(folder, "site", {"b.xyz", "a.xyz"}, 2, std::uint64_t{1} << 30);
    const auto first = test::site_bytes(folder / "site");
    CHECK(first.count("tiles/9.glb") == 0);
    write(folder, "other", {"a.xyz", "b.xyz"}, 2, std::uint64_t{64} << 20);
    CHECK(test::site_bytes(folder / "other") == first);
    std::size_t folders = 0;  // no scratch beside them
    for (const auto& entry : std::filesystem::directory_iterator(folder.path()))
      folders += entry.is_directory();
    CHECK(folders == 2);
  }
}

TEST_CASE("point site: nothing is written of scans without points", "[unit]") {
  const test::TempFolder folder;
  folder.write("a.xyz", "x y z\nnan 1 2\n");
  CHECK_THROWS_AS(write(folder, "site", {"a.xyz"}, 1, std::uint64_t{1} << 30), EmptyError);
  CHECK_FALSE(std::filesystem::exists(folder / "site"));
}

TEST_CASE("point site: many tiles are tilesets in tilesets", "[unit]") {
  const test::TempFolder folder;
  // A full octree of four levels, without contents.
  std::vector<CopcNode> nodes;
  for (std::int32_t level = 0; level < 4; ++level)
    for (std::int32_t k = 0; k < 1 << (3 * level); ++k) {
      const std::int32_t mask = (1 << level) - 1;
      nodes.push_back({level, {k & mask, k >> level & mask, k >> (2 * level) & mask}, 1, 0});
    }
  std::array<double, 16> transform{};
  transform[0] = transform[5] = transform[10] = transform[15] = 1.0;
  std::map<std::string, std::string> files;
  write_point_tilesets(nodes, {{-8, -8, -8}, 16.0}, transform, 100,
                       [&](const std::string& name, const std::string& text) { files[name] = text; });
  CHECK(files.size() == 1 + 8);
  std::size_t tiles = 0;
  for (const auto& [name, text] : files) {
    for (std::size_t at = text.find(".glb"); at != std::string::npos; at = text.find(".glb", at + 1)) ++tiles;
    CHECK(text.find("\"refine\":\"ADD\"") != std::string::npos);
    folder.write("x", text);
    const std::filesystem::path to = folder / (name.empty() ? "tileset.json" : name);
    std::filesystem::create_directories(to.parent_path());
    std::filesystem::rename(folder / "x", to);
  }
  CHECK(tiles == nodes.size());
  std::map<int, int> number;
  for (const CopcNode& n : nodes) {
    std::filesystem::create_directories(folder / "tiles" / std::to_string(n.level));
    char name[64];
    std::snprintf(name, sizeof name, "tiles/%d/%06d.glb", n.level, number[n.level]++);
    folder.write(name, "x");
  }
  const test::Site site = test::read_site(folder / "tileset.json");
  CHECK(site.tiles.size() == nodes.size());
}

}  // namespace tessera::point_site_test
