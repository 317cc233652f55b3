// tessera resurface and tessera csg as a user runs them.
#include <catch2/catch.hpp>

#include <cmath>

#include "kernels/mesh/closest_face.h"
#include "octree/error.h"
#include "octree/portable_math.h"
#include "stream/files/json.h"
#include "stream/formats/meshes/mesh_io.h"
#include "stream/stages/solid/csg_job.h"
#include "tests/helpers/block_meshes.h"
#include "tests/helpers/command.h"
#include "tests/helpers/killed_command.h"
#include "tests/helpers/made_meshes.h"
#include "tests/helpers/mesh_files.h"
#include "tests/helpers/random.h"
#include "tests/helpers/skip.h"
#include "tests/helpers/solid_command.h"
#include "tests/helpers/temp_folder.h"

namespace solids_test {

namespace {

using namespace tessera;
using namespace tessera::test;
namespace fs = std::filesystem;

/// A ball without its cap, every triangle with corners of its own, and a box through it.
std::string dirty_stl_like() {
  std::string text = "OFF\n";
  std::vector<Double3> v;
  const int rings = 40, sectors = 80;
  const auto at = [&](int r, int s) {
    const SinCos a = sin_cos(kPi * r / rings), b = sin_cos(2.0 * kPi * s / sectors);
    return Double3{a.sin * b.cos, a.sin * b.sin, -a.cos};
  };
  const auto add = [&](const Double3& a, const Double3& b, const Double3& c) {
    v.insert(v.end(), {a, b, c});
  };
  for (int r = 0; r < rings - 6; ++r)
    for (int s = 0; s < sectors; ++s) {
      if (r > 0) add(at(r, s), at(r, s + 1), at(r + 1, s));
      add(at(r, s + 1), at(r + 1, s + 1), at(r + 1, s));
    }
  const auto corner = [](int c) {
    return Double3{c & 1 ? 1.5 : 0.2, c & 2 ? 0.4 : -0.4, c & 4 ? 0.3 : -0.3};
  };
  for (const auto& f : std::vector<std::array<int, 3>>{{0, 2, 1},
                                                       {1, 2, 3},
                                                       {4, 5, 6},
                                                       {5, 7, 6},
                                                       {0, 1, 4},
                                                       {1, 5, 4},
                                                       {2, 6, 3},
                                                       {3, 6, 7},
                                                       {0, 4, 2},
                                                       {2, 4, 6},
                                                       {1, 3, 5},
                                                       {3, 7, 5}})
    add(corner(f[0]), corner(f[1]), corner(f[2]));
  text += std::to_string(v.size()) + " " + std::to_string(v.size() / 3) + " 0\n";
  for (const Double3& p : v) {
    char line[96];
    std::snprintf(line, sizeof line, "%.9g %.9g %.9g\n", p[0], p[1], p[2]);
    text += line;
  }
  for (std::size_t f = 0; f < v.size(); f += 3)
    text += "3 " + std::to_string(f) + " " + std::to_string(f + 1) + " " + std::to_string(f + 2) + "\n";
  return text;
}

}  // namespace

TEST_CASE("resurface: a dirty mesh becomes one closed one, the same bytes whatever runs", "[pipeline]") {
  const TempFolder folder;
  const std::string in = folder.write("dirty.off", dirty_stl_like()).string();
  const std::string first = (folder / "a.ply").string();
  REQUIRE(solid_command({"resurface", in, "-o", first, "--resolution", "0.01"}).code == 0);
  const WholeMesh mesh = read_whole(first);
  CHECK(is_closed(mesh));
  CHECK(mesh.faces.size() > 100'000);
  // Ball and box overlap: their union, less the cap.
  CHECK(volume(mesh) > 4.0);
  CHECK(volume(mesh) < 4.0 / 3.0 * kPi + 0.5 * 0.8 * 0.6);
  const std::string bytes = file_bytes(first);
  const std::string again = (folder / "b.ply").string();
  for (const std::vector<std::string>& how : {std::vector<std::string>{"-t", "1", "--tile-size", "64"},
                                              {"-t", "2", "--tile-size", "128"},
                                              {"--memory", "96M"}}) {
    std::vector<std::string> words = {"resurface", in, "-o", again, "--resolution", "0.01", "--force"};
    words.insert(words.end(), how.begin(), how.end());
    const CommandResult r = solid_command(words);
    CAPTURE(r.errors);
    REQUIRE(r.code == 0);
    CHECK(file_bytes(again) == bytes);
    if (how[0] == "--memory") CHECK(r.peak_bytes < (std::uint64_t{96} << 20));
  }
}

TEST_CASE("resurface: edges that bend or lie within a cell of others are met, the same bytes whatever runs",
          "[pipeline]") {
  // A stack of three plates of twelve sides, turned; their sides bend by 30 degrees every 3.2 cells, the middle one's are
  // 1.4 cells inside of the others'.
  std::vector<Double3> at;
  const double turn = 0.4, lean = 0.7;
  const std::vector<std::array<double, 2>> rings = {{3.1, 0},   {3.1, 2.3}, {2.4, 2.3},
                                                    {2.4, 4.1}, {3.1, 4.1}, {3.1, 6.2}};
  for (const auto& [radius, z] : rings)
    for (int i = 0; i < 12; ++i) {
      const SinCos t = sin_cos(kPi * i / 6.0 + turn), l = sin_cos(lean);
      const Double3 p = {radius * t.cos, radius * t.sin, z};
      at.push_back({p[0], p[1] * l.cos - p[2] * l.sin, p[1] * l.sin + p[2] * l.cos});
    }
  std::vector<std::array<std::uint32_t, 3>> faces;
  for (std::uint32_t i = 2; i < 12; ++i) {
    faces.push_back({0, i, i - 1});
    faces.push_back({60, 60 + i - 1, 60 + i});
  }
  for (std::uint32_t r = 0; r < 60; r += 12)
    for (std::uint32_t i = 0; i < 12; ++i) {
      const std::uint32_t j = i == 11 ? 0 : i + 1;
      faces.push_back({r + i, r + j, r + 12 + j});
      faces.push_back({r + i, r + 12 + j, r + 12 + i});
    }
  std::string text = "OFF\n72 " + std::to_string(faces.size()) + " 0\n";
  for (const Double3& p : at) {
    char line[96];
    std::snprintf(line, sizeof line, "%.9g %.9g %.9g\n", p[0], p[1], p[2]);
    text += line;
  }
  for (const auto& f : faces)
    text += "3 " + std::to_string(f[0]) + " " + std::to_string(f[1]) + " " + std::to_string(f[2]) + "\n";
  const TempFolder folder;
  const std::string in = folder.write("stack.off", text).string(), out = (folder / "a.ply").string(),
                    again = (folder / "b.ply").string();
  REQUIRE(solid_command({"resurface", in, "-o", out, "--resolution", "0.5"}).code == 0);
  const WholeMesh mesh = read_whole(out);
  CHECK(is_closed(mesh));
  std::vector<std::array<std::uint32_t, 3>> made;
  for (const MeshFace& f : mesh.faces)
    made.push_back({static_cast<std::uint32_t>(f[0]), static_cast<std::uint32_t>(f[1]),
                    static_cast<std::uint32_t>(f[2])});
  const ClosestFaces there(mesh.points, made, {0, 0, 0});
  int all = 0, beyond = 0;
  const auto look = [&](std::uint32_t a, std::uint32_t b) {
    for (int i = 0; i <= 40; ++i, ++all)
      beyond += there.closest(at[a] + (at[b] - at[a]) * (i / 40.0), 100.0, ClosestFaces::kNone).square >
                0.01 * 0.01;
  };
  for (std::uint32_t r = 0; r < 72; r += 12)
    for (std::uint32_t i = 0; i < 12; ++i) {
      look(r + i, r + (i == 11 ? 0 : i + 1));
      if (r < 60 && r != 12 && r != 36) look(r + i, r + 12 + i);
    }
  CAPTURE(all, beyond);
  CHECK(20 * beyond < all);
  for (const std::vector<std::string>& how :
       {std::vector<std::string>{"-t", "1", "--tile-size", "64"}, {"-t", "2"}}) {
    std::vector<std::string> words = {"resurface", in, "-o", again, "--resolution", "0.5", "--force"};
    words.insert(words.end(), how.begin(), how.end());
    REQUIRE(solid_command(words).code == 0);
    CHECK(file_bytes(again) == file_bytes(out));
  }
}

TEST_CASE("resurface: killed at any moment it goes on to the same bytes", "[fault]") {
  const TempFolder folder;
  const std::string in = folder.write("dirty.off", dirty_stl_like()).string();
  const std::string whole = (folder / "a.ply").string(), part = (folder / "b.ply").string();
  REQUIRE(solid_command({"resurface", in, "-o", whole, "--resolution", "0.015"}).code == 0);
  REQUIRE(resumed_after_kills(
              {"resurface", in, "-o", part, "--resolution", "0.015", "--no-html", "--progress", "none"})
              .code == 0);
  CHECK(file_bytes(part) == file_bytes(whole));
}

TEST_CASE("resurface: what cannot work is told", "[pipeline]") {
  const TempFolder folder;
  // A wavy sheet has no inside.
  std::string sheet = "OFF\n441 800 0\n";
  for (int j = 0; j <= 20; ++j)
    for (int i = 0; i <= 20; ++i)
      sheet += std::to_string(i) + " " + std::to_string(j) + " " +
               std::to_string(sin_cos(0.4 * i + 0.3 * j).sin) + "\n";
  for (int j = 0; j < 20; ++j)
    for (int i = 0; i < 20; ++i) {
      const int a = i + 21 * j;
      sheet += "3 " + std::to_string(a) + " " + std::to_string(a + 1) + " " + std::to_string(a + 22) +
               "\n3 " + std::to_string(a) + " " + std::to_string(a + 22) + " " + std::to_string(a + 21) +
               "\n";
    }
  const std::string out = (folder / "o.ply").string();
  const CommandResult open = solid_command(
      {"resurface", folder.write("sheet.off", sheet).string(), "-o", out, "--resolution", "0.3"});
  CHECK(open.code == 5);
  CHECK(open.errors.find("without an inside") != std::string::npos);
  // Told before its surface is computed.
  const auto reported = parse_json(file_bytes(out + ".report.json"));
  CHECK(reported.at("stages").back().at("name") == "lines");
  CHECK_FALSE(fs::exists(out));
  // A slab of a hundredth of a cell encloses a node of the lattice here and there.
  WholeMesh slab;
  const MeshBlock cube = cube_block(1);
  for (const Double3& p : cube.position) {
    const Double3 q = {p[0], p[1], 1e-4 * p[2]};
    slab.points.push_back({0.8 * q[0] - 0.6 * q[2], 0.96 * q[1] - 0.28 * (0.6 * q[0] + 0.8 * q[2]),
                           0.28 * q[1] + 0.96 * (0.6 * q[0] + 0.8 * q[2])});
  }
  for (const auto& f : cube.faces) slab.faces.push_back({f[0], f[1], f[2]});
  slab.header.vertices = slab.points.size();
  slab.header.faces = slab.faces.size();
  slab.header.double_positions = true;
  write_whole(folder / "slab.ply", slab);
  const fs::path none = folder / "thin.ply";
  const CommandResult thin = solid_command(
      {"resurface", (folder / "slab.ply").string(), "-o", none.string(), "--resolution", "0.005"});
  CHECK(thin.code == 5);
  CHECK(thin.errors.find("crumbs") != std::string::npos);
  CHECK_FALSE(fs::exists(none));
  const std::string tetra = folder
                                .write("t.off",
                                       "OFF\n4 4 0\n0 0 0\n1 0 0\n0 1 0\n0 0 1\n3 0 2 1\n3 0 1 3\n3 0 3 2\n"
                                       "3 1 2 3\n")
                                .string();
  CHECK(solid_command({"resurface", tetra, "-o", out, "--resolution", "1e-7"}).code == 2);
  CHECK(solid_command({"resurface", tetra, "-o", out, "--resolution", "-1"}).code == 2);
  CHECK(solid_command({"resurface", (folder / "none.off").string(), "-o", out}).code == 3);
}

TEST_CASE("resurface: two sheets without sides are the plate between them, whichever way they show",
          "[pipeline]") {
  const TempFolder folder;
  constexpr int kSide = 80;
  const auto plate = [&](bool turned) {
    std::string text = "OFF\n" + std::to_string(2 * (kSide + 1) * (kSide + 1)) + " " +
                       std::to_string(4 * kSide * kSide) + " 0\n";
    for (const double depth : {0.0, 3.0})
      for (int j = 0; j <= kSide; ++j)
        for (int i = 0; i <= kSide; ++i) {
          char line[96];
          std::snprintf(line, sizeof line, "%d %d %.9g\n", i, j,
                        4.0 * sin_cos(0.1 * i + 0.03 * j).sin + 0.1 * i - depth);
          text += line;
        }
    for (const int sheet : {0, 1})
      for (int j = 0; j < kSide; ++j)
        for (int i = 0; i < kSide; ++i) {
          const int a = sheet * (kSide + 1) * (kSide + 1) + i + (kSide + 1) * j, b = a + kSide + 1;
          for (std::array<int, 3> f : {std::array{a, a + 1, b + 1}, std::array{a, b + 1, b}}) {
            if ((sheet == 1) != turned) std::swap(f[1], f[2]);
            text +=
                "3 " + std::to_string(f[0]) + " " + std::to_string(f[1]) + " " + std::to_string(f[2]) + "\n";
          }
        }
    const fs::path in = folder.path() / (turned ? "turned.off" : "plate.off"), out = in.string() + ".ply";
    std::ofstream(in) << text;
    const CommandResult r =
        solid_command({"resurface", in.string(), "-o", out.string(), "--resolution", "0.4"});
    CAPTURE(r.errors);
    REQUIRE(r.code == 0);
    const WholeMesh mesh = read_whole(out);
    CHECK(is_closed(mesh));
    CHECK(volume(mesh) == Approx(3.0 * kSide * kSide).epsilon(0.05));  // what closes its sides bulges
    return file_bytes(out);
  };
  CHECK((plate(false) == plate(true)));
}

TEST_CASE("resurface: offsets and shells have their volumes, the same bytes whatever runs", "[pipeline]") {
  const TempFolder folder;
  const std::string box = (folder / "box.ply").string(), out = (folder / "o.ply").string();
  REQUIRE(solid_command(
              {"csg", folder.write("b.json", R"({"box": [-1,-1,-1, 1,1,1], "rotate": [1,2,3, 33]})").string(),
               "-o", box, "--resolution", "0.05"})
              .code == 0);
  const struct {
    std::vector<std::string> how;
    double volume;
  } cases[] = {
      // Steiner: what grows by d has V + A d + (edges' lengths / 4) pi d^2 + 4/3 pi d^3.
      {{"--offset", "0.3"}, 8.0 + 24.0 * 0.3 + 6.0 * kPi * 0.09 + 4.0 / 3.0 * kPi * 0.027},
      {{"--offset", "-0.3"}, 1.4 * 1.4 * 1.4},
      {{"--shell", "0.2"}, 8.0 - 1.6 * 1.6 * 1.6},
      {{"--offset", "0.2", "--shell", "0.3"},
       8.0 + 24.0 * 0.2 + 6.0 * kPi * 0.04 + 4.0 / 3.0 * kPi * 0.008 - 1.8 * 1.8 * 1.8},
  };
  for (const auto& c : cases) {
    std::vector<std::string> words = {"resurface", box, "-o", out, "--resolution", "0.031", "--force"};
    words.insert(words.end(), c.how.begin(), c.how.end());
    CAPTURE(c.how);
    const CommandResult r = solid_command(words);
    CAPTURE(r.errors);
    REQUIRE(r.code == 0);
    const WholeMesh mesh = read_whole(out);
    CHECK(is_closed(mesh));
    CHECK(volume(mesh) == Approx(c.volume).epsilon(2e-3));
  }
  const std::string bytes = file_bytes(out);
  for (const std::vector<std::string>& how :
       {std::vector<std::string>{"-t", "1", "--tile-size", "64"}, {"--memory", "200M"}}) {
    std::vector<std::string> words = {"resurface", box,   "-o",      out,   "--resolution", "0.031",
                                      "--offset",  "0.2", "--shell", "0.3", "--force"};
    words.insert(words.end(), how.begin(), how.end());
    REQUIRE(solid_command(words).code == 0);
    CHECK(file_bytes(out) == bytes);
  }
  const CommandResult gone =
      solid_command({"resurface", box, "-o", out, "--resolution", "0.05", "--offset", "-1.2", "--force"});
  CHECK(gone.code == 5);
  CHECK(gone.errors.find("nothing is left") != std::string::npos);
  CHECK(solid_command({"resurface", box, "-o", out, "--resolution", "0.05", "--shell", "0.06", "--force"})
            .code == 2);
}

TEST_CASE("csg: shapes have their volumes, within a thousandth", "[pipeline]") {
  const TempFolder folder;
  const struct {
    const char* scene;
    double volume;
  } cases[] = {
      {R"({"difference": [{"box": [-1,-1,-1, 1,1,1]}, {"cylinder": [0,0,-2, 0,0,2, 0.5]}]})",
       8.0 - 2.0 * kPi * 0.25},
      {R"({"union": [{"sphere": [0,0,0, 1]}, {"sphere": [3,0,0, 0.7]}]})", 4.0 / 3.0 * kPi * (1.0 + 0.343)},
      {R"({"intersection": [{"sphere": [0,0,0, 1]}, {"halfspace": [0,0,0.2, 0,0,1]}]})",
       4.0 / 3.0 * kPi - kPi * 0.64 * (3.0 - 0.8) / 3.0},
      {R"({"torus": [0,0,0, 0,0,1, 1, 0.5], "rotate": [1,2,3, 40], "translate": [5,6,7]})",
       2.0 * kPi * kPi * 0.25},
      {R"({"cone": [0,0,0, 1,1,1, 0.8, 0.2], "scale": 2})",
       8.0 * kPi * std::sqrt(3.0) / 3.0 * (0.64 + 0.16 + 0.04)},
      {R"({"sphere": [0,0,0, 1], "scale": [1, 2, 0.5], "rotate": [0,1,0, 30]})", 4.0 / 3.0 * kPi},
      {R"({"cone": [0,0,0, 1,1,1, 0.8, 0.2], "scale": [-1, 1, 1]})",
       kPi * std::sqrt(3.0) / 3.0 * (0.64 + 0.16 + 0.04)},
      {R"({"difference": [{"box": [0,0,0, 2,2,2], "rotate": [1,1,0, 25]}, {"union": [{"box": [0.5,0.5,-1, 1.5,1.5,3],
          "rotate": [1,1,0, 25]}, {"sphere": [9,9,9, 0.5]}]}]})",
       6.0},
  };
  for (const auto& c : cases) {
    CAPTURE(c.scene);
    const std::string out = (folder / "o.ply").string();
    const CommandResult r = solid_command(
        {"csg", folder.write("s.json", c.scene).string(), "-o", out, "--resolution", "0.03", "--force"});
    CAPTURE(r.errors);
    REQUIRE(r.code == 0);
    const WholeMesh mesh = read_whole(out);
    CHECK(is_closed(mesh));
    CHECK(volume(mesh) == Approx(c.volume).epsilon(1e-3));
  }
}

TEST_CASE("csg: mirror images of meshes keep their inside", "[pipeline]") {
  const TempFolder folder;
  // No symmetry of its own: a wedge.
  folder.write("wedge.off",
               "OFF\n6 8 0\n0 0 0\n2 0 0\n0 1 0\n0 0 1\n2 0 1\n0 1 1\n3 0 2 1\n3 3 4 5\n3 0 1 4\n3 0 4 3\n"
               "3 1 2 5\n3 1 5 4\n3 2 0 3\n3 2 3 5\n");
  const std::string out = (folder / "o.ply").string();
  const auto made = [&](const std::string& scene) {
    const CommandResult r = solid_command(
        {"csg", folder.write("s.json", scene).string(), "-o", out, "--resolution", "0.05", "--force"});
    CAPTURE(scene, r.errors);
    REQUIRE(r.code == 0);
    const Json report = parse_json(file_bytes(out + ".report.json"));
    for (const Json& operand : report.at("solids").at("operands")) CHECK(operand.at("inside_out") == false);
    const WholeMesh mesh = read_whole(out);
    CHECK(is_closed(mesh));
    return volume(mesh);
  };
  CHECK(made(R"({"mesh": "wedge.off", "scale": [-1, 1, 1]})") == Approx(1.0).epsilon(1e-3));
  CHECK(made(R"({"mesh": "wedge.off", "matrix": [0,1,0,0, 1,0,0,0, 0,0,1,0]})") == Approx(1.0).epsilon(1e-3));
  // A part and its mirror image: side by side, and one out of the other.
  CHECK(made(R"({"union": [{"mesh": "wedge.off"}, {"mesh": "wedge.off", "scale": [-1, 1, 1]}]})") ==
        Approx(2.0).epsilon(1e-3));
  CHECK(made(R"({"difference": [{"mesh": "wedge.off"},
        {"mesh": "wedge.off", "scale": [-1, 1, 1], "translate": [2, 0, 0]}]})") == Approx(0.5).epsilon(1e-3));
  CHECK(made(R"({"union": [{"mesh": "wedge.off", "scale": [1, -1, 1]}, {"box": [5,5,0, 6,6,1]}],
        "scale": [-1, 1, 1]})") == Approx(2.0).epsilon(1e-3));
}

TEST_CASE("csg: words and scenes of meshes agree, new edges lie on both", "[pipeline]") {
  const TempFolder folder;
  // Meshes of shapes, then combined again.
  const std::string box = (folder / "box.ply").string(), rod = (folder / "rod.ply").string();
  REQUIRE(solid_command({"csg", folder.write("b.json", R"({"box": [-1,-1,-1, 1,1,1]})").string(), "-o", box,
                         "--resolution", "0.031"})
              .code == 0);
  REQUIRE(solid_command({"csg", folder.write("r.json", R"({"cylinder": [0,0,-2, 0,0,2, 0.5]})").string(),
                         "-o", rod, "--resolution", "0.011"})
              .code == 0);
  const std::string words = (folder / "w.ply").string(), scene = (folder / "s.ply").string();
  REQUIRE(solid_command({"csg", box, "-", rod, "-o", words, "--resolution", "0.02"}).code == 0);
  const WholeMesh mesh = read_whole(words);
  CHECK(is_closed(mesh));
  CHECK(volume(mesh) == Approx(8.0 - 2.0 * kPi * 0.25).epsilon(1e-3));
  // The rim of the bore: vertices within a cell of both surfaces lie on one of them, those on both on the circle.
  double worst = 0.0;
  std::size_t boundary = 0;
  for (const Double3& p : mesh.points) {
    const double radius = std::sqrt(p[0] * p[0] + p[1] * p[1]);
    if (std::fabs(radius - 0.5) > 0.01 || std::fabs(std::fabs(p[2]) - 1.0) > 0.01) continue;
    worst = std::max(worst, std::min(std::fabs(radius - 0.5), std::fabs(std::fabs(p[2]) - 1.0)));
    boundary += std::fabs(radius - 0.5) < 0.02 * 0.02 && std::fabs(std::fabs(p[2]) - 1.0) < 0.02 * 0.02;
  }
  CHECK(worst < 0.02 * 0.02);
  CHECK(boundary > 200);
  REQUIRE(
      solid_command(
          {"csg",
           folder.write("m.json", R"({"difference": [{"mesh": "box.ply"}, {"mesh": "rod.ply"}]})").string(),
           "-o", scene, "--resolution", "0.02", "-t", "1", "--tile-size", "64"})
          .code == 0);
  CHECK(read_whole(scene).faces == mesh.faces);
  CHECK(read_whole(scene).points == mesh.points);
}

TEST_CASE("csg: a milling tool takes away what it sweeps", "[pipeline]") {
  const TempFolder folder;
  folder.write("slot.txt", "# through the middle\n-5, 5, 6\n\n25 5 6\n");
  folder.write("cross.txt", "-5 5 6\n25 5 6\n25 5 6\n10 5 6\n10 -5 6\n10 15 6\n");
  folder.write("hole.txt", "10 5 12\n10 5 4\n");
  const std::string out = (folder / "o.ply").string();
  const auto scene = [&](const std::string& tool) {
    return folder.write("s.json", R"({"difference": [{"box": [0,0,0, 20,10,10]}, {"mill": {)" + tool + "}}]}")
        .string();
  };
  const struct {
    const char* tool;
    double gone;
  } cases[] = {
      {R"("ball": 2, "length": 30, "path": "slot.txt")", 20.0 * (4.0 * 2.0 + 2.0 * kPi)},
      {R"("flat": 2, "length": 30, "path": "slot.txt")", 20.0 * 16.0},
      {R"("bull": [2, 1], "length": 30, "path": "slot.txt")", 20.0 * (4.0 * 3.0 + 2.0 + 0.5 * kPi)},
      {R"("flat": 2, "length": 3, "path": "hole.txt")", 6.0 * 4.0 * kPi},  // it plunged
      // It stood still, came back and crossed itself.
      {R"("flat": 2, "length": 30, "path": "cross.txt")", 20.0 * 16.0 + 10.0 * 16.0 - 64.0},
      {R"("ball": 2, "length": 9, "path": "hole.txt")", 4.0 * 4.0 * kPi + 16.0 / 3.0 * kPi},
  };
  for (const auto& c : cases) {
    CAPTURE(c.tool);
    const CommandResult r =
        solid_command({"csg", scene(c.tool), "-o", out, "--resolution", "0.25", "--force"});
    CAPTURE(r.errors);
    REQUIRE(r.code == 0);
    const WholeMesh mesh = read_whole(out);
    CHECK(is_closed(mesh));
    CHECK(volume(mesh) == Approx(2000.0 - c.gone).epsilon(1e-3));
  }
  const std::string bytes = file_bytes(out);
  REQUIRE(solid_command({"csg", scene(cases[5].tool), "-o", out, "--resolution", "0.25", "--force", "-t", "1",
                         "--tile-size", "64"})
              .code == 0);
  CHECK(file_bytes(out) == bytes);
  const auto code_of = [&](const std::string& tool) {
    return solid_command({"csg", scene(tool), "-o", (folder / "x.ply").string()}).code;
  };
  CHECK(code_of(R"("ball": 2, "length": 30)") == 3);
  CHECK(code_of(R"("ball": 2, "flat": 2, "length": 30, "path": "slot.txt")") == 3);
  CHECK(code_of(R"("bull": [2, 3], "length": 30, "path": "slot.txt")") == 3);
  CHECK(code_of(R"("ball": 2, "length": 30, "path": "none.txt")") == 3);
  folder.write("torn.txt", "1 2 3\n4 5\n");
  CHECK(code_of(R"("ball": 2, "length": 30, "path": "torn.txt")") == 3);
  folder.write("empty.txt", "# nothing\n");
  CHECK(code_of(R"("ball": 2, "length": 30, "path": "empty.txt")") == 3);
}

TEST_CASE("csg: scenes with any bytes changed are read or told", "[property]") {
  const TempFolder folder;
  const std::string scene =
      R"({"difference": [{"mesh": "box.ply", "scale": [1, 2, 3]}, {"union": [{"cylinder": [0,0,0, 0,0,9, 1.5],)"
      R"( "rotate": [0, 1, 0, 30]}, {"mill": {"bull": [2, 0.5], "length": 9, "path": "p.txt"}, "translate": [1, 2, 3]}]},)"
      R"( {"halfspace": [0,0,0, 0,0,1], "matrix": [1,0,0,0, 0,1,0,0, 0,0,1,0]}]})";
  Random random(11);
  std::size_t read = 0, reported = 0;
  for (int round = 0; round < 4000; ++round) {
    std::string text = scene;
    for (std::uint64_t changes = random.below(3) + 1; changes > 0; --changes) {
      const std::size_t at = random.below(text.size());
      const std::uint64_t kind = random.below(4);
      if (kind == 0) text[at] = static_cast<char>(random.below(256));
      if (kind == 1) text[at] = "0123456789-.e{}[],:\""[random.below(20)];
      if (kind == 2) text.erase(at, random.below(20) + 1);
      if (kind == 3) text.insert(at, text.substr(random.below(text.size()), random.below(40)));
      if (text.empty()) text = "0";
    }
    try {
      CsgOptions options;
      options.program = read_csg_scene(folder.write("s.json", text)).program;
      csg_model(options);
      ++read;
    } catch (const InputError&) {
      ++reported;
    }
  }
  CHECK(read > 30);
  CHECK(reported > 1000);
}

TEST_CASE("csg: scenes that make no sense are told", "[pipeline]") {
  const TempFolder folder;
  const std::string out = (folder / "o.ply").string();
  const auto code_of = [&](const std::string& scene) {
    const CommandResult r = solid_command({"csg", folder.write("s.json", scene).string(), "-o", out});
    CHECK_FALSE(fs::exists(out));
    CHECK(std::count(r.errors.begin(), r.errors.end(), '\n') == 1);
    return r.code;
  };
  CHECK(code_of("{}") == 3);
  CHECK(code_of("[") == 3);
  CHECK(code_of(R"({"union": []})") == 3);
  CHECK(code_of(R"({"teapot": [1]})") == 3);
  CHECK(code_of(R"({"sphere": [0,0,0]})") == 3);
  CHECK(code_of(R"({"sphere": [0,0,0,-1]})") == 3);
  CHECK(code_of(R"({"sphere": [0,0,0,1], "scale": 0})") == 3);
  CHECK(code_of(R"({"scene": "s.json"})") == 3);
  CHECK(code_of(R"({"sphere": {"radius": 444E4444}})") == 3);  // read, and told, as no number
  CHECK(code_of(R"({"halfspace": [0,0,0, 0,0,1]})") == 3);
  CHECK(code_of(R"({"mesh": "none.ply"})") == 3);
  CHECK(code_of(R"({"intersection": [{"sphere": [0,0,0,1]}, {"sphere": [9,0,0,1]}]})") == 5);
  std::string deep;
  for (int i = 0; i < 100'000; ++i) deep += R"({"union": [)";
  CHECK(code_of(deep) == 3);
  deep += R"({"sphere": [0,0,0,1]})";
  for (int i = 0; i < 100'000; ++i) deep += "]}";
  CHECK(code_of(deep) == 3);
  CHECK(solid_command({"csg", "a.ply", "+", "-o", out}).code == 2);
  CHECK(solid_command({"csg", "a.ply", "b.ply", "-o", out}).code == 2);
}

TEST_CASE("resurface: bodies, parts and needles in four formats come out closed", "[pipeline]") {
  const TempFolder folder;
  const std::pair<const char*, WholeMesh> meshes[] = {{"open.ply", made_open_body(4)},
                                                      {"bracket.obj", made_bracket(8)},
                                                      {"body.glb", made_body(4)},
                                                      {"cylinder.stl", made_cylinder(180, 1.0, 9.0)}};
  for (const auto& [name, mesh] : meshes) {
    CAPTURE(name);
    const std::string in = (folder / name).string(), out = in + ".ply";
    write_whole(in, mesh);
    REQUIRE(solid_command({"resurface", in, "-o", out}).code == 0);
    CHECK(is_closed(read_whole(out)));
  }
}

TEST_CASE("resurface: meshes of the catalogue come out closed", "[pipeline][.shared]") {
  if (!has_shared_data()) return;
  const fs::path data = kSharedData / "meshes";
  const TempFolder folder;
  for (const char* name : {"bunny.ply", "fandisk.obj", "casting-10k.off", "tray.stl"}) {
    CAPTURE(name);
    const std::string out = (folder / (std::string(name) + ".ply")).string();
    REQUIRE(solid_command({"resurface", (data / name).string(), "-o", out}).code == 0);
    CHECK(is_closed(read_whole(out)));
  }
}

}  // namespace solids_test
