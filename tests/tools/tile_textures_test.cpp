// tessera tiles --texture as a user runs it: coarse levels keep the picture of the finest, tiles stay small, the same bytes.
#include <catch2/catch.hpp>

#include <algorithm>
#include <cmath>
#include <fstream>
#include <map>
#include <string>
#include <vector>

#include "stream/files/json.h"
#include "stream/formats/texture_image.h"
#include "tests/helpers/command.h"
#include "tests/helpers/killed_command.h"
#include "tests/helpers/mesh_files.h"
#include "tests/helpers/shell.h"
#include "tests/helpers/tiles_site.h"

namespace tile_textures_test {

using namespace tessera;
using namespace tessera::test;

namespace {

namespace fs = std::filesystem;

constexpr int kSide = 160;

std::array<std::uint32_t, 3> paint(int i, int j) {
  return {static_cast<std::uint32_t>(i), static_cast<std::uint32_t>(j),
          (i / 12 + j / 12) % 2 == 0 ? 40u : 220u};
}

/// Shallow waves with a chequered pattern that a level with a sixteenth of the faces cannot hold on its vertices.
fs::path write_cloth(const fs::path& path, bool backwards = false, bool colour = true) {
  WholeMesh mesh;
  for (int j = 0; j <= kSide; ++j)
    for (int i = 0; i <= kSide; ++i) {
      mesh.points.push_back(
          {400.0 + i, 900.0 + j,
           static_cast<double>(static_cast<float>(3.0 * std::sin(0.05 * i) * std::cos(0.07 * j)))});
      const auto c = paint(i, j);
      if (colour) mesh.rgba.push_back(0xff000000u | c[0] | c[1] << 8 | c[2] << 16);
    }
  for (std::uint64_t j = 0; j < kSide; ++j)
    for (std::uint64_t i = 0; i < kSide; ++i) {
      const std::uint64_t a = j * (kSide + 1) + i, b = a + kSide + 1;
      mesh.faces.push_back({a, a + 1, b + 1});
      mesh.faces.push_back({a, b + 1, b});
    }
  if (backwards) std::reverse(mesh.faces.begin(), mesh.faces.end());
  mesh.header.vertices = mesh.points.size();
  mesh.header.faces = mesh.faces.size();
  mesh.header.colour = colour;
  write_whole(path, mesh);
  return path;
}

std::vector<std::string> words(const fs::path& in, const fs::path& out,
                               const std::vector<std::string>& more = {}) {
  std::vector<std::string> w = {"tiles", in.string(),  "-o",   out.string(), "--tile-faces", "3000",
                                "-q",    "--progress", "none", "--texture",  "auto"};
  w.insert(w.end(), more.begin(), more.end());
  return w;
}

Json levels_of(const fs::path& site) {
  return parse_json(file_bytes(site.string() + ".report.json")).at("tiles").at("levels");
}

/// The picture of a tile, and the coordinates of its vertices on it.
struct TilePage {
  TextureImage image;
  std::vector<Double2> uv;
  std::vector<Double3> points;
  bool has_colours = false;
};
TilePage page_of(const fs::path& tile) {
  const std::string glb = file_bytes(tile);
  TilePage page;
  const DecodedTile decoded = decode_tile(glb);
  page.points = decoded.points;
  page.has_colours = !decoded.colours.empty();
  for (const auto& uv : decoded.uv) page.uv.push_back({uv[0] / 65535.0, uv[1] / 65535.0});
  std::uint32_t text = 0;
  std::memcpy(&text, glb.data() + 12, 4);
  const Json all = parse_json(glb.substr(20, text));
  if (!all.contains("images")) return page;
  const Json& view = all.at("bufferViews").at(all.at("images")[0].at("bufferView").get<std::size_t>());
  page.image = read_texture_image(ReadFile(tile), 28 + text + view.at("byteOffset").get<std::uint64_t>(),
                                  view.at("byteLength").get<std::uint64_t>());
  return page;
}

}  // namespace

TEST_CASE("tile textures: pages finer than the cap holds for a tile are told before anything is done",
          "[fault]") {
  const TempFolder folder;
  const fs::path in = write_cloth(folder.path() / "in.ply"), few = folder.path() / "few.ply",
                 baked = folder.path() / "baked.glb", out = folder.path() / "site";
  REQUIRE(tessera_command(
              {"decimate", in.string(), "--target-faces", "2000", "-o", few.string(), "-q", "--no-html"})
              .code == 0);
  const CommandResult bake = tessera_command({"bake", few.string(), "--from", in.string(), "--texel", "0.12",
                                              "-o", baked.string(), "-q", "--no-html"});
  INFO(bake.errors);
  REQUIRE(bake.code == 0);
  const auto tiles = [&](const char* cap) {
    return tessera_command({"tiles", baked.string(), "-o", out.string(), "-q", "--progress", "none",
                            "--texture", "auto", "--memory", cap});
  };
  // 1.8 million texels on 2,000 faces, where four a face were told.
  const CommandResult refused = tiles("160M");
  CHECK(refused.code == 4);
  CHECK(refused.errors.find("task 0") == std::string::npos);
  CHECK(refused.errors.find("level-0-tiles") != std::string::npos);
  CHECK(refused.errors.find("would do is --memory") != std::string::npos);
  CHECK_FALSE(fs::exists(out));
  CHECK(tiles("1G").code == 0);
}

TEST_CASE("tile textures: coarse levels show the pattern that their vertices lost", "[pipeline]") {
  const TempFolder folder;
  const fs::path in = write_cloth(folder.path() / "in.ply"), out = folder.path() / "site";
  const CommandResult r = tessera_command(words(in, out));
  INFO(r.errors);
  REQUIRE(r.code == 0);
  const Json levels = levels_of(out);
  REQUIRE(levels.size() >= 3);
  CHECK_FALSE(levels[0].contains("texture"));  // its vertices have all that there is
  for (std::size_t l = 1; l < levels.size(); ++l) {
    INFO(dump_json(levels[l]));
    const Json& texture = levels[l].at("texture");
    CHECK(texture.at("pages") == levels[l].at("tiles"));
    CHECK(texture.at("without_points").get<int>() == 0);
    // Pages as small as these hold few texels more than margins.
    CHECK(10 * texture.at("pages_with_coarser_texels").get<int>() <= texture.at("pages").get<int>());
    CHECK(texture.at("stretch_l2").get<double>() < 1.05);
    CHECK(texture.at("used_share").get<double>() > 0.45);  // of pages this small much is margin
    // The first two are made of the same points.
    const double wider = texture.at("texel").get<double>() /
                         levels[std::max<std::size_t>(1, l - 1)].at("texture").at("texel").get<double>();
    CHECK((l <= 2 ? wider == 1.0 : wider > 1.5));
  }
  const Json& first = levels[1].at("texture");
  CHECK(first.at("psnr_db").get<double>() > first.at("vertex_colours_psnr_db").get<double>() + 6.0);
  // Colours under vertices of the first level, and coordinates within the page.
  std::size_t seen = 0, far = 0, beyond = 0;
  for (const auto& entry : fs::directory_iterator(out / "tiles" / "1")) {
    if (entry.path().extension() != ".glb") continue;
    const TilePage page = page_of(entry.path());
    CHECK_FALSE(page.has_colours);
    REQUIRE(page.uv.size() == page.points.size());
    const Site site = read_site(out / "tileset.json");
    for (std::size_t v = 0; v < page.uv.size(); ++v) {
      const Double3 p = page.points[v];
      const double x = p[0] + site.transform[12] - 400.0, y = p[1] + site.transform[13] - 900.0;
      beyond += page.uv[v][0] < 0.0 || page.uv[v][0] > 1.0 || page.uv[v][1] < 0.0 || page.uv[v][1] > 1.0;
      // Away from the borders of the pattern.
      const auto amid = [](double at) { return std::fabs(std::fmod(at + 120.0, 12.0) - 5.5) < 2.5; };
      if (!amid(x) || !amid(y)) continue;
      const auto column = static_cast<std::size_t>(page.uv[v][0] * page.image.size.width),
                 row = static_cast<std::size_t>(page.uv[v][1] * page.image.size.height);
      const std::uint8_t* rgb = &page.image.rgb[3 * (row * page.image.size.width + column)];
      const auto want = paint(static_cast<int>(x), static_cast<int>(y));
      ++seen;
      for (std::size_t c = 0; c < 3; ++c)
        far += std::abs(static_cast<int>(rgb[c]) - static_cast<int>(want[c])) > 24;
    }
  }
  CHECK(beyond == 0);
  REQUIRE(seen > 100);
  CHECK(far <= seen / 50);
}

TEST_CASE("tile textures: same bytes over threads, memory, order of the input and kills", "[property]") {
  const TempFolder folder;
  const fs::path in = write_cloth(folder.path() / "in.ply"), out = folder.path() / "site";
  const auto run = [&](const fs::path& mesh, const std::vector<std::string>& more) {
    fs::remove_all(out);
    const CommandResult r = tessera_command(words(mesh, out, more));
    INFO(r.errors);
    REQUIRE(r.code == 0);
    return site_bytes(out);
  };
  const auto want = run(in, {"--threads", "1"});
  CHECK(run(in, {"--threads", "2", "--memory", "200M"}) == want);
  CHECK(run(write_cloth(folder.path() / "back.ply", true), {}) == want);
  fs::remove_all(out);
  const CommandResult r = resumed_after_kills(words(in, out));
  INFO(r.errors);
  REQUIRE(r.code == 0);
  CHECK(site_bytes(out) == want);
}

TEST_CASE("tile textures: pages of the input are baked anew on every level", "[pipeline]") {
  const TempFolder folder;
  const fs::path in = write_cloth(folder.path() / "in.ply"), baked = folder.path() / "baked.glb",
                 out = folder.path() / "site";
  REQUIRE(tessera_command({"decimate", in.string(), "-o", baked.string(), "--tolerance", "0.05", "--texture",
                           "auto", "-q", "--progress", "none"})
              .code == 0);
  const CommandResult told = tessera_command(
      {"tiles", baked.string(), "-o", (folder.path() / "bare").string(), "-q", "--progress", "none"});
  CHECK(told.code == 0);
  CHECK(told.errors.find("its textures are left out; --texture auto bakes them anew") != std::string::npos);
  std::vector<std::string> few = words(baked, out);
  few[5] = "300";
  const CommandResult r = tessera_command(few);
  INFO(r.errors);
  REQUIRE(r.code == 0);
  const Json levels = levels_of(out);
  REQUIRE(levels.size() >= 2);
  for (const Json& level : levels) {
    INFO(dump_json(level));
    CHECK(level.at("texture").at("pages") == level.at("tiles"));
    CHECK(level.at("texture").at("psnr_db").get<double>() > 22.0);
  }
  CHECK(levels[0].at("texture").at("psnr_db").get<double>() > 30.0);
}

TEST_CASE("tile textures: what has no colours, and scans, are refused", "[unit]") {
  const TempFolder folder;
  const fs::path bare = write_cloth(folder.path() / "bare.ply", false, false), out = folder.path() / "site";
  const CommandResult r = tessera_command(words(bare, out));
  CHECK(r.code == 3);
  CHECK(r.errors.find("has no colours, so there is nothing for --texture to show") != std::string::npos);
  CHECK_FALSE(fs::exists(out / "tileset.json"));
  std::ofstream(folder.path() / "scan.xyz") << "x y z r g b\n0 0 0 1 2 3\n1 0 0 1 2 3\n";
  const CommandResult scan = tessera_command({"tiles", (folder.path() / "scan.xyz").string(), "-o",
                                              out.string(), "--texture", "auto", "--progress", "none"});
  CHECK(scan.code == 2);
  CHECK(scan.errors.find("--texture") != std::string::npos);
}

}  // namespace tile_textures_test
