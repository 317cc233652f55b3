// --texture of reconstruct and decimate as a user runs them: one job whose result has textures.
#include <catch2/catch.hpp>

#include <algorithm>
#include <cmath>
#include <fstream>
#include <string>
#include <vector>

#include "stream/files/json.h"
#include "stream/formats/meshes/mesh_io.h"
#include "stream/formats/texture_image.h"
#include "tests/helpers/command.h"
#include "tests/helpers/killed_command.h"
#include "tests/helpers/mesh_files.h"
#include "tests/helpers/shell.h"

namespace texture_jobs_test {

using namespace tessera;
using namespace tessera::test;

namespace {

namespace fs = std::filesystem;

constexpr int kSide = 80;

double relief(double x, double y) {
  return 0.8 * std::sin(0.3 * x) * std::cos(0.2 * y);
}

/// Red along x, green along y, a border in blue.
std::array<int, 3> paint(double x, double y) {
  return {static_cast<int>(12.0 * x), static_cast<int>(12.0 * y), x < 10.1 ? 20 : 220};
}

/// Sixteen points a unit of area.
fs::path write_painted_scan(const fs::path& path) {
  std::string text = "x y z r g b\n";
  for (int j = 0; j <= kSide; ++j)
    for (int i = 0; i <= kSide; ++i) {
      const double x = 0.25 * i, y = 0.25 * j;
      const std::array<int, 3> c = paint(x, y);
      text += std::to_string(x) + " " + std::to_string(y) + " " + std::to_string(relief(x, y)) + " " +
              std::to_string(c[0]) + " " + std::to_string(c[1]) + " " + std::to_string(c[2]) + "\n";
    }
  std::ofstream(path) << text;
  return path;
}

/// The same as a mesh with colours of vertices.
fs::path write_painted_mesh(const fs::path& path, bool coloured = true) {
  WholeMesh mesh;
  for (int j = 0; j <= kSide; ++j)
    for (int i = 0; i <= kSide; ++i) {
      const double x = 0.25 * i, y = 0.25 * j;
      mesh.points.push_back({x, y, static_cast<double>(static_cast<float>(relief(x, y)))});
      const std::array<int, 3> c = paint(x, y);
      if (coloured)
        mesh.rgba.push_back(0xff000000u | static_cast<std::uint32_t>(c[0]) |
                            static_cast<std::uint32_t>(c[1]) << 8 | static_cast<std::uint32_t>(c[2]) << 16);
    }
  for (std::uint64_t j = 0; j < kSide; ++j)
    for (std::uint64_t i = 0; i < kSide; ++i) {
      const std::uint64_t a = j * (kSide + 1) + i, b = a + kSide + 1;
      mesh.faces.push_back({a, a + 1, b + 1});
      mesh.faces.push_back({a, b + 1, b});
    }
  mesh.header.vertices = mesh.points.size();
  mesh.header.faces = mesh.faces.size();
  mesh.header.colour = coloured;
  write_whole(path, mesh);
  return path;
}

std::vector<std::string> words(const std::string& command, const fs::path& in, const fs::path& out,
                               const std::vector<std::string>& more = {}) {
  std::vector<std::string> w = {command, in.string(),  "-o",   out.string(), "--tolerance",
                                "0.02",  "--progress", "none", "-q"};
  w.insert(w.end(), more.begin(), more.end());
  return w;
}

std::string bytes_of_run(const std::vector<std::string>& w, const fs::path& out) {
  fs::remove(out);
  const CommandResult r = tessera_command(w);
  INFO(r.errors);
  REQUIRE(r.code == 0);
  CHECK_FALSE(fs::exists(out.string() + ".tessera"));
  return file_bytes(out);
}

}  // namespace

TEST_CASE(
    "texture: reconstruct and decimate end with textures, the same bytes over threads, memory and kills",
    "[property]") {
  const TempFolder folder;
  const fs::path scan = write_painted_scan(folder.path() / "in.xyz"),
                 mesh = write_painted_mesh(folder.path() / "in.ply"), out = folder.path() / "out.glb";
  for (const auto& [command, in] : {std::pair{"reconstruct", scan}, std::pair{"decimate", mesh}}) {
    INFO(command);
    const std::string want =
        bytes_of_run(words(command, in, out, {"--texture", "auto", "--threads", "1"}), out);
    const Json report = parse_json(file_bytes(out.string() + ".report.json"));
    CHECK(report.at("texture").at("texels").at("psnr_db").get<double>() > 32.0);
    CHECK(report.at("texture").at("texels").at("psnr_db").get<double>() >
          report.at("texture").at("texels").at("vertex_colours_psnr_db").get<double>());
    CHECK(report.at("texture").at("charts").at("overlapping").get<int>() == 0);
    CHECK(report.at("certificate").at("certified_max").get<double>() <= 0.02);
    std::uint64_t faces = 0;
    open_mesh_file(out)->read_faces([&](std::span<const MeshFace> batch) { faces += batch.size(); });
    CHECK(faces == report.at("mesh").at("faces").get<std::uint64_t>());
    CHECK(faces < kSide * kSide);
    CHECK(bytes_of_run(words(command, in, out, {"--texture", "auto", "--threads", "2", "--memory", "220M"}),
                       out) == want);
    const fs::path killed = folder.path() / (std::string(command) + ".glb");
    const CommandResult r = resumed_after_kills(words(command, in, killed, {"--texture", "auto"}));
    INFO(r.errors);
    REQUIRE(r.code == 0);
    CHECK(file_bytes(killed) == want);
  }
}

namespace {

/// Share of the texels of a normal map that lean by more than some five degrees.
double leaning_share(const fs::path& map) {
  const TextureImage image = read_texture_image(ReadFile(map), 0, fs::file_size(map));
  const std::size_t texels = image.rgb.size() / 3;
  std::size_t leaning = 0;
  for (std::size_t i = 0; i < texels; ++i)
    leaning += std::hypot(image.rgb[3 * i] - 127.5, image.rgb[3 * i + 1] - 127.5) > 11.0;
  return static_cast<double>(leaning) / static_cast<double>(texels);
}

}  // namespace

TEST_CASE("texture: normal maps beside it hold what decimation takes away, and change no colour",
          "[property]") {
  const TempFolder folder;
  const fs::path scan = write_painted_scan(folder.path() / "in.xyz"),
                 mesh = write_painted_mesh(folder.path() / "in.ply"), out = folder.path() / "out.obj";
  for (const auto& [command, in] : {std::pair{"reconstruct", scan}, std::pair{"decimate", mesh}}) {
    INFO(command);
    std::vector<std::string> w = words(command, in, out, {"--texture", "auto"});
    w[5] = "0.3";  // of a relief of 0.8, whose slopes are up to 14 degrees
    bytes_of_run(w, out);
    const std::string colours = file_bytes(folder.path() / "out_0.png");
    w.push_back("--normal-map");
    const fs::path map = folder.path() / "out_0_normal.png";
    const std::string want = bytes_of_run(w, out);
    CHECK(file_bytes(folder.path() / "out_0.png") == colours);
    CHECK(file_bytes(folder.path() / "out.mtl").find("norm out_0_normal.png") != std::string::npos);
    CHECK(leaning_share(map) > 0.2);
    const std::string normals = file_bytes(map);
    std::vector<std::string> other = w;
    other.insert(other.end(), {"--threads", "2", "--memory", "220M"});
    CHECK(bytes_of_run(other, out) == want);
    CHECK(file_bytes(map) == normals);
    fs::remove(out);
    const CommandResult r = resumed_after_kills(w);
    INFO(r.errors);
    REQUIRE(r.code == 0);
    CHECK(file_bytes(out) == want);
    CHECK(file_bytes(map) == normals);
    // Where next to nothing is taken away, next to nothing leans.
    w[5] = "0.001";
    bytes_of_run(w, out);
    CHECK(leaning_share(map) < 0.02);
    fs::remove(out);
  }
  // A mesh without colours has directions all the same.
  const fs::path plain = write_painted_mesh(folder.path() / "plain.ply", false);
  std::vector<std::string> w = words("decimate", plain, out, {"--texture", "auto", "--normal-map"});
  w[5] = "0.3";
  bytes_of_run(w, out);
  CHECK(leaning_share(folder.path() / "out_0_normal.png") > 0.2);
}

TEST_CASE("texture: what bake makes of the decimated mesh, decimate --texture makes at once", "[pipeline]") {
  const TempFolder folder;
  const fs::path mesh = write_painted_mesh(folder.path() / "in.ply");
  const fs::path small = folder.path() / "small.ply", baked = folder.path() / "baked.obj",
                 at_once = folder.path() / "at_once.obj";
  bytes_of_run(words("decimate", mesh, small, {"--colour-tolerance", "0"}), small);
  const CommandResult r = tessera_command({"bake", small.string(), "--from", mesh.string(), "-o",
                                           baked.string(), "--texel", "0.1", "--progress", "none", "-q"});
  INFO(r.errors);
  REQUIRE(r.code == 0);
  bytes_of_run(words("decimate", mesh, at_once, {"--texture", "0.1"}), at_once);
  const auto sorted_points = [](const fs::path& path) {
    std::vector<Double3> points = read_whole(path).points;
    std::sort(points.begin(), points.end());
    return points;
  };
  const bool same = sorted_points(baked) == sorted_points(at_once);
  CHECK(same);
  CHECK(read_whole(baked).faces.size() == read_whole(at_once).faces.size());
  CHECK(fs::exists(folder.path() / "at_once_0.png"));
  CHECK(fs::exists(folder.path() / "at_once.mtl"));
  const auto texel = [](const fs::path& out) {
    return parse_json(file_bytes(out.string() + ".report.json")).at("texture").at("scale").at("texel");
  };
  CHECK(texel(baked) == texel(at_once));
}

TEST_CASE("texture: what cannot have textures is refused before anything runs", "[pipeline]") {
  const TempFolder folder;
  const fs::path scan = write_painted_scan(folder.path() / "in.xyz"),
                 plain = write_painted_mesh(folder.path() / "plain.ply", false),
                 mesh = write_painted_mesh(folder.path() / "in.ply"), bare = folder.path() / "bare.xyz";
  std::ofstream(bare) << "0 0 0\n1 0 0\n0 1 0\n1 1 0\n";
  const auto refusal = [&](const std::vector<std::string>& w, int code) {
    const CommandResult r = tessera_command(w);
    INFO(r.errors);
    CHECK(r.code == code);
    CHECK_FALSE(fs::exists(folder.path() / "out.glb.tessera"));
    return r.errors;
  };
  const fs::path out = folder.path() / "out.glb";
  CHECK(refusal(words("decimate", plain, out, {"--texture", "auto"}), 3).find("no colours") !=
        std::string::npos);
  CHECK(refusal(words("reconstruct", bare, out, {"--texture", "auto"}), 3).find("no colours") !=
        std::string::npos);
  CHECK(refusal({"reconstruct", scan.string(), "-o", out.string(), "--texture", "auto"}, 2)
            .find("--tolerance") != std::string::npos);
  CHECK(refusal(words("reconstruct", scan, folder.path() / "out.stl", {"--texture", "auto"}), 2)
            .find(".glb, .obj or .ply") != std::string::npos);
  CHECK(refusal(words("decimate", mesh, out, {"--normal-map"}), 2).find("--texture auto") !=
        std::string::npos);
  CHECK(
      refusal(words("reconstruct", scan, folder.path() / "out.ply", {"--texture", "auto", "--normal-map"}), 2)
          .find("PLY has no normal maps") != std::string::npos);
}

TEST_CASE(
    "texture: textures of the input are baked anew, from OBJ, PLY and GLB alike, or told to be left out",
    "[pipeline]") {
  const TempFolder folder;
  const fs::path scan = write_painted_scan(folder.path() / "in.xyz"),
                 plain = write_painted_mesh(folder.path() / "plain.ply", false);
  for (const char* name : {"a.obj", "b.ply", "c.glb"}) {
    INFO(name);
    const fs::path textured = folder.path() / name, out = folder.path() / "out.glb";
    const CommandResult r = tessera_command({"bake", plain.string(), "--from", scan.string(), "-o",
                                             textured.string(), "--progress", "none", "-q"});
    INFO(r.errors);
    REQUIRE(r.code == 0);
    bytes_of_run(words("decimate", textured, out, {"--texture", "auto"}), out);
    const Json texture = parse_json(file_bytes(out.string() + ".report.json")).at("texture");
    CHECK(texture.at("texels").at("psnr_db").get<double>() > 35.0);  // against the texels of the input
    CHECK(texture.at("texels").at("without_points").get<int>() == 0);
    // The texels of the input are so far apart.
    CHECK(texture.at("scale").at("spacing").get<double>() > 0.4 * 0.25);
    CHECK(texture.at("scale").at("spacing").get<double>() < 0.8 * 0.25);
    fs::remove(out);
    const CommandResult dropped = tessera_command(words("decimate", textured, out));
    CHECK(dropped.code == 0);
    CHECK(dropped.errors.find("--texture auto bakes them anew") != std::string::npos);
    fs::remove(out);
  }
}

TEST_CASE("texture: check tells what is wrong with textures, and passes what we write", "[pipeline]") {
  const TempFolder folder;
  const fs::path scan = write_painted_scan(folder.path() / "in.xyz"),
                 plain = write_painted_mesh(folder.path() / "plain.ply", false);
  const auto check = [&](const fs::path& mesh, const std::string& text = "") {
    if (!text.empty()) std::ofstream(mesh) << text;
    const fs::path json = folder.path() / "check.json";
    const CommandResult r = tessera_command(
        {"check", mesh.string(), "--textures", "--weld", "--strict", "--json", json.string(), "--force"});
    INFO(r.errors);
    return std::pair{r.code, parse_json(file_bytes(json)).at("textures")};
  };
  for (const char* name : {"a.obj", "b.ply", "c.glb"}) {
    INFO(name);
    const fs::path out = folder.path() / name;
    const CommandResult r = tessera_command({"bake", plain.string(), "--from", scan.string(), "-o",
                                             out.string(), "--page-size", "128", "--progress", "none", "-q"});
    INFO(r.errors);
    REQUIRE(r.code == 0);
    const auto [code, found] = check(out);
    CHECK(code == 0);
    CHECK(found.at("faces") == 2 * kSide * kSide);
    CHECK(found.at("pages").get<int>() > 1);
    CHECK(found.at("used_share").get<double>() == Approx(parse_json(file_bytes(out.string() + ".report.json"))
                                                             .at("texture")
                                                             .at("pack")
                                                             .at("used_share")
                                                             .get<double>())
                                                      .epsilon(0.01));
  }
  // Two triangles of a square, on a page of their own.
  fs::copy_file(folder.path() / "a_0.png", folder.path() / "page.png");
  const std::string square = "mtllib m.mtl\nv 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\n";
  const fs::path mesh = folder.path() / "m.obj";
  std::ofstream(folder.path() / "m.mtl") << "newmtl a\nmap_Kd page.png\n";
  const std::string good = "vt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\nusemtl a\n";
  CHECK(check(mesh, square + good + "f 1/1 2/2 3/3\nf 1/1 3/3 4/4\n").first == 0);
  const auto counts = [&](const std::string& text, const char* key) {
    const auto [code, found] = check(mesh, square + text);
    CHECK(code == 6);
    return found.at(key).get<int>();
  };
  CHECK(counts(good + "f 1/1 2/2 3/3\nf 1/1 3/3 4/2\n", "flipped_faces") == 1);
  CHECK(counts(good + "f 1/1 2/2 3/3\nf 1/1 3/2 4/4\n", "overlapping_faces") == 1);
  CHECK(counts("vt 0 0\nvt 1.5 0\nvt 1 1\nvt 0 1\nusemtl a\nf 1/1 2/2 3/3\nf 1/1 3/3 4/4\n",
               "outside_faces") == 1);
  std::ofstream(folder.path() / "m.mtl") << "newmtl a\nmap_Kd lost.png\n";
  const auto [code, found] = check(mesh, square + good + "f 1/1 2/2 3/3\nf 1/1 3/3 4/4\n");
  CHECK(code == 6);
  CHECK(found.at("missing_pages") == Json::array({"lost.png"}));
}

}  // namespace texture_jobs_test
