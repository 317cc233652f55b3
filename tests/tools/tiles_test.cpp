// tessera tiles as a user runs it: the rules of 3D Tiles, cracks against the errors told, the same bytes whatever must not
// matter, clear refusals.
#include <catch2/catch.hpp>

#include <algorithm>
#include <cmath>
#include <map>
#include <set>
#include <string>
#include <vector>

#include "kernels/mesh/block_contacts.h"
#include "kernels/mesh/closest_face.h"
#include "octree/portable_math.h"
#include "stream/files/json.h"
#include "tests/helpers/command.h"
#include "tests/helpers/killed_command.h"
#include "tests/helpers/made_meshes.h"
#include "tests/helpers/mesh_files.h"
#include "tests/helpers/random.h"
#include "tests/helpers/shell.h"
#include "tests/helpers/skip.h"
#include "tests/helpers/tiles_site.h"

namespace tiles_test {

using namespace tessera;
using namespace tessera::test;

namespace {

namespace fs = std::filesystem;

constexpr int kSide = 240;

/// Waves that end in noise on one side, far from zero; `backwards` writes vertices and faces from the last to the first.
fs::path write_waves(const fs::path& path, bool backwards = false) {
  const auto wave = [](int i, int j) {
    const double u = i / 25.0, v = j / 40.0;
    const double noise = to_unit(random_bits(7, 1, static_cast<std::uint64_t>(j * 1000 + i))) - 0.5;
    Double3 p = {5000.0 + i, 3000.0 + j, 6.0 * sin_cos(u).sin * sin_cos(v).cos + (i > 160 ? noise : 0.0)};
    for (double& c : p) c = static_cast<double>(static_cast<float>(c));
    return p;
  };
  write_sheet(path, kSide, wave, backwards);
  return path;
}

/// What decimation cannot make one piece: 3,600 islands of eight faces at all heights, above strips and a floor with holes.
void write_litter(const fs::path& path) {
  Random random(3);
  WholeMesh mesh;
  const auto sheet = [&](Double3 at, int nx, int ny, bool holes) {
    const std::uint64_t first = mesh.points.size(), row = static_cast<std::uint64_t>(nx) + 1;
    for (int j = 0; j <= ny; ++j)
      for (int i = 0; i <= nx; ++i) {
        Double3 p = at + Double3{static_cast<double>(i), static_cast<double>(j), random.in(-0.1, 0.1)};
        for (double& c : p) c = static_cast<double>(static_cast<float>(c));
        mesh.points.push_back(p);
      }
    for (std::uint64_t j = 0; j < static_cast<std::uint64_t>(ny); ++j)
      for (std::uint64_t i = 0; i < static_cast<std::uint64_t>(nx); ++i) {
        if (holes && i % 4 == 2 && j % 4 == 2) continue;
        const std::uint64_t a = first + j * row + i;
        mesh.faces.push_back({a, a + 1, a + row + 1});
        mesh.faces.push_back({a, a + row + 1, a + row});
      }
  };
  for (int j = 0; j < 60; ++j)
    for (int i = 0; i < 60; ++i)
      sheet({6.0 * i + random.in(0, 3), 6.0 * j + random.in(0, 3), random.in(0, 12)}, 2, 2, false);
  for (int k = 0; k < 12; ++k) sheet({0.0, 30.0 * k, -5.0}, 360, 1, false);
  sheet({100.0, 100.0, -9.0}, 120, 120, true);
  write_whole(path, counted(std::move(mesh)));
}

/// A closed plate of n x n squares of side 1 on either side, so thick, far less than a square.
void write_plate(const fs::path& path, int n, double thick) {
  WholeMesh mesh;
  const auto row = static_cast<std::uint64_t>(n) + 1, sheet = row * row;
  for (const double z : {0.0, thick})
    for (int j = 0; j <= n; ++j)
      for (int i = 0; i <= n; ++i) mesh.points.push_back({static_cast<double>(i), static_cast<double>(j), z});
  const auto quad = [&](std::uint64_t a, std::uint64_t b, std::uint64_t c, std::uint64_t d) {
    mesh.faces.push_back({a, b, c});
    mesh.faces.push_back({a, c, d});
  };
  for (std::uint64_t j = 0; j + 1 < row; ++j)
    for (std::uint64_t i = 0; i + 1 < row; ++i) {
      const std::uint64_t a = j * row + i, b = sheet + a;
      quad(a, a + row, a + row + 1, a + 1);
      quad(b, b + 1, b + row + 1, b + row);
    }
  for (std::uint64_t i = 0; i + 1 < row; ++i) {
    const auto wall = [&](std::uint64_t a, std::uint64_t b) { quad(a, b, sheet + b, sheet + a); };
    wall(i, i + 1);
    wall(sheet - 1 - i, sheet - 2 - i);
    wall((i + 1) * row, i * row);
    wall(i * row + row - 1, (i + 1) * row + row - 1);
  }
  write_whole(path, counted(std::move(mesh)));
}

std::vector<std::string> words(const fs::path& in, const fs::path& out,
                               const std::vector<std::string>& more = {}) {
  std::vector<std::string> w = {"tiles", in.string(), "-o", out.string(), "--progress", "none", "-q"};
  w.insert(w.end(), more.begin(), more.end());
  return w;
}

/// Every file of a site made anew.
std::map<std::string, std::string> bytes_of_site(const fs::path& in, const fs::path& out,
                                                 const std::vector<std::string>& more) {
  fs::remove_all(out);
  const CommandResult r = tessera_command(words(in, out, more));
  INFO(r.errors);
  REQUIRE(r.code == 0);
  return site_bytes(out);
}

/// Points and faces of a mesh in the frame of the site.
struct LocalMesh {
  std::vector<Double3> points;
  std::vector<std::array<std::uint32_t, 3>> faces;
  LocalMesh(const fs::path& path, const Site& site) {
    const WholeMesh mesh = read_whole(path);
    for (const Double3& p : mesh.points)
      points.push_back({p[0] - site.transform[12], p[1] - site.transform[13], p[2] - site.transform[14]});
    for (const MeshFace& f : mesh.faces)
      faces.push_back({static_cast<std::uint32_t>(f[0]), static_cast<std::uint32_t>(f[1]),
                       static_cast<std::uint32_t>(f[2])});
  }
};

double distance(const ClosestFaces& to, const Double3& p) {
  constexpr double kFar = 1e30;
  return std::sqrt(to.closest(p, kFar, ClosestFaces::kNone).square);
}

/// What 3D Tiles asks of every site, and that leaves hold the input.
void check_rules(const fs::path& folder, const fs::path& input) {
  const Site site = read_site(folder / "tileset.json");
  REQUIRE(site.transform.size() == 16);
  std::set<fs::path> named(site.files.begin(), site.files.end());
  CHECK(named.size() == site.files.size());
  for (const auto& entry : fs::recursive_directory_iterator(folder)) {
    INFO(entry.path());
    if (entry.is_regular_file()) CHECK(named.count(entry.path().lexically_normal()) == 1);
  }
  std::size_t outside = 0, rising = 0, content_outside = 0, leaf_faces = 0;
  for (const SiteTile& tile : site.tiles) {
    if (&tile != &site.tiles[0]) {
      const SiteTile& parent = site.tiles[tile.parent];
      rising += tile.error >= parent.error;
      for (std::size_t k = 0; k < 3; ++k)
        outside += tile.low[k] < parent.low[k] || tile.high[k] > parent.high[k];
    }
    if (tile.content.empty()) continue;
    const DecodedTile decoded = decode_tile(file_bytes(tile.content));
    for (const Double3& p : decoded.points)
      for (std::size_t k = 0; k < 3; ++k) content_outside += p[k] < tile.low[k] || p[k] > tile.high[k];
    if (tile.children.empty()) leaf_faces += decoded.faces.size();
  }
  CHECK(outside == 0);
  CHECK(rising == 0);
  CHECK(content_outside == 0);
  CHECK(leaf_faces == read_whole(input).faces.size());
}

struct Cracks {
  double worst = 0.0;        ///< share of the error told that was found between tiles of different levels
  double worst_cover = 0.0;  ///< share of it that the input is away from the tile shown for it
  std::size_t mixed = 0;     ///< places where tiles of different levels meet
};

/// Shows tiles at random, as viewers do, and measures at the vertices of the input. \param seed of the choice
Cracks measure_cracks(const Site& site, std::uint64_t seed) {
  std::vector<std::size_t> shown(site.tiles.size());  // of every tile: itself or what is shown in its stead
  for (std::size_t t = 0; t < shown.size(); ++t) {
    const std::size_t parent = site.tiles[t].parent;
    const bool refined = t == 0 || (shown[parent] == parent && (site.tiles[parent].content.empty() ||
                                                                random_bits(seed, 3, parent) % 3 != 0));
    shown[t] = refined ? t : shown[parent];
  }
  std::map<std::size_t, ClosestFaces> faces;
  std::map<Double3, std::set<std::size_t>>
      at;  // vertices of leaves, and what is shown of the leaves they are in
  Cracks out;
  for (std::size_t t = 0; t < shown.size(); ++t) {
    if (!site.tiles[t].children.empty()) continue;
    const std::size_t now = shown[t];
    if (faces.count(now) == 0) {
      const DecodedTile tile = decode_tile(file_bytes(site.tiles[now].content));
      faces.emplace(now, ClosestFaces(tile.points, tile.faces, {0, 0, 0}));
    }
    for (const Double3& p : decode_tile(file_bytes(site.tiles[t].content)).points) {
      at[p].insert(now);
      out.worst_cover = std::max(out.worst_cover, distance(faces[now], p) / site.tiles[now].error);
    }
  }
  // Vertices of leaves lie on their grid, that far from where they were.
  double grid = site.tiles[0].error;
  for (const SiteTile& tile : site.tiles) grid = std::min(grid, tile.error);
  for (const auto& [p, tiles] : at) {
    bool mixed = false;
    for (const std::size_t a : tiles)
      for (const std::size_t b : tiles) {
        const double error = site.tiles[a].error;
        if (!(error > site.tiles[b].error)) continue;
        mixed = true;
        const double gap =
            std::max(0.0, distance(faces[a], p) - grid) + std::max(0.0, distance(faces[b], p) - grid);
        out.worst = std::max(out.worst, gap / error);
      }
    out.mixed += mixed;
  }
  return out;
}

void check_cracks(const fs::path& folder, const fs::path& input) {
  const Site site = read_site(folder / "tileset.json");
  // A point that two tiles share: from it each of them is no farther than its bound, and both bounds are in the error.
  std::size_t mixed = 0;
  for (std::uint64_t seed = 1; seed <= 6; ++seed) {
    const Cracks cracks = measure_cracks(site, seed);
    INFO("worst crack " << cracks.worst << " of the error told, cover " << cracks.worst_cover << ", at "
                        << cracks.mixed << " places");
    CHECK(cracks.worst <= 1.0);
    CHECK(cracks.worst_cover <= 1.0);
    mixed += cracks.mixed;
  }
  CHECK(mixed > 0);
  const LocalMesh mesh(input, site);
  const ClosestFaces reference(mesh.points, mesh.faces, {0, 0, 0});
  double worst = 0.0;
  for (const SiteTile& tile : site.tiles)
    if (!tile.content.empty())
      for (const Double3& p : decode_tile(file_bytes(tile.content)).points)
        worst = std::max(worst, distance(reference, p) / tile.error);
  CHECK(worst <= 1.0);
}

/// Tiles of one level fit each other without a gap: together they have no border edge but that of the whole.
void check_levels(const fs::path& folder) {
  const Site site = read_site(folder / "tileset.json");
  std::map<double, std::set<std::array<Double3, 3>>> levels;  // by error: faces, each once
  for (const SiteTile& tile : site.tiles) {
    if (tile.content.empty()) continue;
    const DecodedTile decoded = decode_tile(file_bytes(tile.content));
    for (const auto& f : decoded.faces) {
      std::array<Double3, 3> corners = {decoded.points[f[0]], decoded.points[f[1]], decoded.points[f[2]]};
      std::rotate(corners.begin(), std::min_element(corners.begin(), corners.end()), corners.end());
      levels[tile.error].insert(corners);
    }
  }
  CHECK(levels.size() > 2);
  for (const auto& [error, faces] : levels) {
    std::map<std::pair<Double3, Double3>, int> edges;
    for (const auto& f : faces)
      for (std::size_t k = 0; k < 3; ++k) {
        ++edges[{f[k], f[(k + 1) % 3]}];
        --edges[{f[(k + 1) % 3], f[k]}];
      }
    std::size_t inside = 0;
    for (const auto& [edge, count] : edges) {
      const auto on_side = [&](const Double3& p) {
        const double x = p[0] + site.transform[12] - 5000.0, y = p[1] + site.transform[13] - 3000.0;
        constexpr double kNear = 0.1;  // the grid
        return x < kNear || x > kSide - kNear || y < kNear || y > kSide - kNear;
      };
      inside += count > 0 && !(on_side(edge.first) && on_side(edge.second));
    }
    INFO("level of error " << error << " with " << faces.size() << " faces");
    CHECK(inside == 0);
  }
}

}  // namespace

TEST_CASE(
    "tiles: the rules of the specification, no cracks inside a level, cracks below the errors between them",
    "[pipeline]") {
  const TempFolder folder;
  const fs::path in = write_waves(folder.path() / "in.ply"), out = folder.path() / "site";
  const CommandResult r = tessera_command(words(in, out, {"--tile-faces", "3000"}));
  INFO(r.errors);
  REQUIRE(r.code == 0);
  CHECK_FALSE(fs::exists(out / "tileset.json.tessera"));
  CHECK(read_site(out / "tileset.json").tiles.size() > 30);
  check_rules(out, in);
  check_levels(out);
  check_cracks(out, in);
}

TEST_CASE("tiles: a body of several levels: rules and cracks", "[pipeline]") {
  const TempFolder folder;
  const fs::path in = folder.path() / "body.ply", out = folder.path() / "site";
  write_whole(in, made_open_body(5));
  const CommandResult r = tessera_command(words(in, out, {"--tile-faces", "600"}));
  INFO(r.errors);
  REQUIRE(r.code == 0);
  check_rules(out, in);
  check_cracks(out, in);
}

TEST_CASE("tiles: islands, strips and holes end in one tile, within errors that hold", "[pipeline]") {
  const TempFolder folder;
  const fs::path in = folder.path() / "litter.ply", out = folder.path() / "site";
  write_litter(in);
  const auto bytes = bytes_of_site(in, out, {"--tile-faces", "2000", "-t", "1"});
  CHECK((bytes_of_site(in, out, {"--tile-faces", "2000", "-t", "3", "--memory", "96M"}) == bytes));
  CHECK((bytes_of_site(in, out, {"--tile-faces", "2000", "-t", "2", "--processes"}) == bytes));
  check_rules(out, in);
  check_cracks(out, in);
  const Site site = read_site(out / "tileset.json");
  REQUIRE_FALSE(site.tiles[0].content.empty());
  const std::size_t root_faces = decode_tile(file_bytes(site.tiles[0].content)).faces.size();
  CHECK(root_faces > 0);
  CHECK(root_faces <= 2000);
  const Json report = parse_json(file_bytes(out.string() + ".report.json"));
  std::uint64_t below = 0;
  std::size_t clustered = 0;
  for (const Json& level : report.at("tiles").at("levels")) {
    const auto faces = level.at("faces_of_level").get<std::uint64_t>();
    if (below > 0) CHECK(static_cast<double>(faces) <= 0.35 * static_cast<double>(below));
    below = faces;
    clustered += level.at("method") == "clustering";
  }
  CHECK(clustered > 0);
}

TEST_CASE("tiles: a real mesh of several levels: rules and cracks", "[pipeline][.shared]") {
  if (!has_shared_data()) return;
  const TempFolder folder;
  const fs::path in = kSharedData / "meshes" / "bunny.ply", out = folder.path() / "site";
  const CommandResult r = tessera_command(words(in, out, {"--tile-faces", "2000"}));
  INFO(r.errors);
  REQUIRE(r.code == 0);
  check_rules(out, in);
  check_cracks(out, in);
}

TEST_CASE("tiles: same bytes over threads, memory, processes, order of the input and kills", "[property]") {
  const TempFolder folder;
  const fs::path in = write_waves(folder.path() / "in.ply");
  const auto run = [&](const fs::path& from, std::vector<std::string> more) {
    more.insert(more.end(), {"--tile-faces", "6000"});
    return bytes_of_site(from, folder.path() / "site", more);
  };
  const auto bytes = run(in, {"-t", "1", "--memory", "1G"});
  CHECK(bytes.size() > 20);
  CHECK((run(in, {"-t", "4", "--memory", "96M"}) == bytes));
  CHECK((run(in, {"-t", "2", "--processes"}) == bytes));
  CHECK((run(write_waves(folder.path() / "in.ply", true), {"-t", "2"}) == bytes));

  // Killed at commits, the same command goes on, and nothing bears the name of the tileset before all of it is there.
  const fs::path out = folder.path() / "site";
  fs::remove_all(out);
  const auto again = [&](const std::string& fault) {
    return tessera_command(words(in, out, {"-t", "2", "--tile-faces", "6000"}), 0, fault);
  };
  const int kills = killed_at_commits(31, 5, again, [&] {
    // Killed between the last name and its journal, the site is whole.
    if (!fs::exists(out / "tileset.json")) return;
    const auto so_far = site_bytes(out);
    for (const auto& [name, content] : bytes) {
      INFO(name);
      REQUIRE(so_far.count(name) == 1);
      CHECK((so_far.at(name) == content));
    }
  });
  CHECK(kills > 3);
  CHECK((site_bytes(out) == bytes));
  // An older site in the folder goes with --force, without it nothing changes.
  const fs::path other = folder.path() / "other.ply";
  write_whole(other, made_body(4));
  CHECK(tessera_command(words(other, out)).code == 2);
  CHECK((site_bytes(out) == bytes));
  REQUIRE(tessera_command(words(other, out, {"--force"})).code == 0);
  check_rules(out, other);
}

TEST_CASE("tiles: sheets nearer than a step of 16 bits get a finer grid and do not meet", "[pipeline]") {
  const TempFolder folder;
  const fs::path in = folder.path() / "plate.ply", out = folder.path() / "site";
  constexpr double kThin = 0x1p-13;
  write_plate(in, 60, kThin);
  const auto run = [&](std::vector<std::string> more) {
    more.insert(more.end(), {"--tile-faces", "1500"});
    return bytes_of_site(in, out, more);
  };
  const auto bytes = run({"-t", "1", "--memory", "1G"});
  const Json report = parse_json(file_bytes(out.string() + ".report.json"));
  const Json& finest = report.at("tiles").at("levels").at(0);
  CHECK(finest.at("tiles") > 1);
  CHECK(finest.at("met_by_first_grid") > 1000);
  CHECK(finest.at("met_by_grid") == 0);
  CHECK(finest.at("grid_step").get<double>() <= 2.0 * kThin);
  CHECK(dump_json(report.at("tiles").at("warnings")).find("by the grid") == std::string::npos);
  check_rules(out, in);
  std::size_t wide = 0;
  for (const auto& entry : fs::directory_iterator(out / "tiles" / "0")) {
    if (entry.path().extension() != ".glb") continue;
    const DecodedTile tile = decode_tile(file_bytes(entry.path()));
    MeshBlock block;
    block.position = tile.points;
    block.faces = tile.faces;
    CHECK(count_contacts(block) == 0);
    wide += tile.position_type == "float";
  }
  CHECK(wide > 0);

  CHECK((run({"-t", "3", "--memory", "96M"}) == bytes));
  CHECK((run({"-t", "2", "--processes"}) == bytes));
  fs::remove_all(out);
  const auto again = [&](const std::string& fault) {
    return tessera_command(words(in, out, {"-t", "2", "--tile-faces", "1500"}), 0, fault);
  };
  CHECK(killed_at_commits(23, 4, again) > 3);
  CHECK((site_bytes(out) == bytes));
}

TEST_CASE("tiles: peak memory stays below the cap", "[memory]") {
  const TempFolder folder;
  const fs::path in = write_waves(folder.path() / "in.ply");
  const CommandResult r = tessera_command(words(in, folder.path() / "site", {"--memory", "96M"}));
  INFO(r.errors);
  REQUIRE(r.code == 0);
  CHECK(r.peak_bytes <= std::uint64_t{96} << 20);
}

TEST_CASE("tiles: colours arrive as linear light, normals along the surface", "[pipeline]") {
  const TempFolder folder;
  WholeMesh mesh;
  mesh.points = {{0, 0, 0}, {2, 0, 0}, {2, 2, 0}, {0, 2, 0}};
  mesh.faces = {{0, 1, 2}, {0, 2, 3}};
  mesh.rgba = {0xff0000ffu, 0xff00ff00u, 0xffff0000u, 0xff808080u};
  mesh.header.vertices = 4, mesh.header.faces = 2, mesh.header.colour = true;
  const fs::path in = folder.path() / "in.ply", out = folder.path() / "site";
  write_whole(in, mesh);
  const CommandResult r = tessera_command(words(in, out, {"--normals"}));
  INFO(r.errors);
  REQUIRE(r.code == 0);
  const Site site = read_site(out / "tileset.json");
  REQUIRE(site.tiles.size() == 1);
  const DecodedTile tile = decode_tile(file_bytes(site.tiles[0].content));
  REQUIRE(tile.points.size() == 4);
  REQUIRE(tile.colours.size() == 4);
  REQUIRE(tile.normals.size() == 4);
  for (std::size_t v = 0; v < 4; ++v) {
    const Double3 world = {tile.points[v][0] + site.transform[12], tile.points[v][1] + site.transform[13],
                           tile.points[v][2] + site.transform[14]};
    CHECK(norm(tile.normals[v] - Double3{0, 0, 1}) < 0.02);
    for (std::size_t i = 0; i < 4; ++i) {
      if (norm(world - mesh.points[i]) > 0.1) continue;
      const auto linear = [](std::uint32_t byte) { return byte == 0x80 ? 14146 : byte == 0xff ? 65535 : 0; };
      for (std::size_t k = 0; k < 3; ++k) CHECK(tile.colours[v][k] == linear(mesh.rgba[i] >> 8 * k & 255));
    }
  }
}

TEST_CASE("tiles: colours of coarse levels are means, not those of the vertices that stay", "[pipeline]") {
  const TempFolder folder;
  WholeMesh mesh = read_whole(write_waves(folder.path() / "waves.ply"));
  for (std::size_t v = 0; v < mesh.points.size(); ++v)
    mesh.rgba.push_back((v / (kSide + 1) + v % (kSide + 1)) % 2 == 0 ? 0xffffffffu : 0xff000000u);
  mesh.header.colour = true;
  const fs::path in = folder.path() / "in.ply", out = folder.path() / "site";
  write_whole(in, mesh);
  const auto bytes = bytes_of_site(in, out, {"--tile-faces", "3000", "-t", "1"});
  CHECK((bytes_of_site(in, out, {"--tile-faces", "3000", "-t", "3", "--memory", "96M"}) == bytes));
  std::size_t pure = 0, all = 0;
  for (const SiteTile& tile : read_site(out / "tileset.json").tiles) {
    if (tile.children.empty()) continue;
    for (const auto& colour : decode_tile(file_bytes(tile.content)).colours) {
      pure += colour[0] < 500 || colour[0] > 60000;  // linear light: a grey of 128 is 14,146
      ++all;
    }
  }
  INFO(pure << " of " << all << " vertices are black or white");
  CHECK(all > 1000);
  CHECK(static_cast<double>(pure) < 0.2 * static_cast<double>(all));
}

TEST_CASE("tiles: a system beside the mesh puts the site on Earth, one that is none is warned of",
          "[pipeline]") {
  const TempFolder folder;
  const fs::path in = write_waves(folder.path() / "in.ply"), out = folder.path() / "site";
  const auto frame = [&](const std::string& crs, const std::string& sidecar = "in.ply.prj") {
    fs::remove(folder.path() / "in.prj");
    spill(in.string() + ".prj", "");
    spill(folder.path() / sidecar, crs);
    fs::remove_all(out);
    const CommandResult r = tessera_command({"tiles", in.string(), "-o", out.string(), "--progress", "none"});
    INFO(r.errors);
    REQUIRE(r.code == 0);
    const auto report = parse_json(file_bytes(out.string() + ".report.json"));
    CHECK(report.at("tiles").at("frame").at("transform") == read_site(out / "tileset.json").transform);
    const bool known = crs.starts_with("PROJCS");
    REQUIRE(report.at("warnings").size() == (known ? 0u : 1u));
    // Whoever is without a system is told, not only who has one of no use.
    if (!known) CHECK_THAT(r.errors, Catch::Contains(report.at("warnings")[0].get<std::string>()));
    if (crs.empty()) CHECK_THAT(r.errors, Catch::Contains("no coordinate system is known"));
    return report.at("tiles").at("frame");
  };
  const std::string lambert =
      R"(PROJCS["Lambert-93",GEOGCS["RGF93",DATUM["RGF93",SPHEROID["GRS 1980",6378137,298.257222101]],)"
      R"(PRIMEM["Greenwich",0],UNIT["degree",0.0174532925199433]],PROJECTION["Lambert_Conformal_Conic_2SP"],)"
      R"(PARAMETER["standard_parallel_1",49],PARAMETER["standard_parallel_2",44],)"
      R"(PARAMETER["latitude_of_origin",46.5],PARAMETER["central_meridian",3],PARAMETER["false_easting",5120],)"
      R"(PARAMETER["false_northing",3120],UNIT["metre",1]])";
  const Json placed = frame(lambert);
  CHECK(placed.at("geocentric") == true);
  const auto transform = placed.at("transform").get<std::vector<double>>();
  const Double3 at = {transform[12], transform[13], transform[14]};
  CHECK(norm(at - Double3{4391871.0, 230169.0, 4603706.0}) <
        2000.0);  // three degrees east, 46.5 degrees north
  CHECK(placed.at("misfit_m").get<double>() < 0.1);
  CHECK(frame("nothing known").at("geocentric") == false);
  CHECK(frame("").at("geocentric") == false);
  CHECK(frame(lambert, "in.prj") == placed);  // as other programs name it
}

TEST_CASE("tiles: SIGTERM ends it with a clean journal, and the same command goes on", "[fault]") {
  const TempFolder folder;
  const fs::path in = write_waves(folder.path() / "in.ply"), out = folder.path() / "site";
  const std::vector<std::string> line = words(in, out, {"--tile-faces", "3000"});
  for (const char* look : {"1", "30", "100", "200"}) {
    CAPTURE(look);
    const CommandResult stopped = tessera_command(line, 0, "TESSERA_FAULT=stop:" + std::string(look));
    INFO(stopped.errors);
    CHECK(stopped.code == 128 + SIGTERM);
    CHECK_FALSE(fs::exists(out / "tileset.json"));
  }
  CHECK(tessera_command(line).code == 0);
  check_rules(out, in);
}

TEST_CASE("tiles: what cannot be is refused at once and changes nothing", "[unit]") {
  const TempFolder folder;
  const fs::path in = write_waves(folder.path() / "in.ply");
  const auto refused = [&](const fs::path& from, const fs::path& to, int code, const std::string& word) {
    const CommandResult r = tessera_command(words(from, to));
    INFO(r.errors);
    CHECK(r.code == code);
    CHECK(r.errors.find(word) != std::string::npos);
    CHECK(std::count(r.errors.begin(), r.errors.end(), '\n') == 1);
  };
  refused(in, in, 2, "a file");
  const fs::path full = folder.path() / "full";
  fs::create_directory(full);
  spill(full / "notes.txt", "mine");
  refused(in, full, 2, "not empty");
  CHECK(site_bytes(full) == std::map<std::string, std::string>{{"notes.txt", "mine"}});
  refused(in, folder.path() / "no" / "such", 2, "cannot be made");
  refused(folder.write("in.txt", "no mesh"), folder.path() / "new", 3, "in.txt");
  refused(folder.write("empty.off", "OFF 0 0 0\n"), folder.path() / "new", 5, "");
  CHECK_FALSE(fs::exists(folder.path() / "new"));
  const fs::path site = folder.path() / "site" / "tiles" / "0";
  fs::create_directories(site);
  fs::copy_file(in, site / "in.ply");
  refused(site / "in.ply", folder.path() / "site", 2, "among the tiles");
  const CommandResult r = tessera_command(words(in, folder.path() / "new", {"--tile-faces", "3"}));
  CHECK(r.code == 2);
}

}  // namespace tiles_test
