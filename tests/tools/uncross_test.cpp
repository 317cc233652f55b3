// What commands extract does not cross itself: features and borders that would make faces cross give way.
#include <catch2/catch.hpp>

#include <cmath>

#include "octree/portable_math.h"
#include "stream/files/json.h"
#include "tests/helpers/block_meshes.h"
#include "tests/helpers/command.h"
#include "tests/helpers/mesh_files.h"
#include "tests/helpers/random.h"
#include "tests/helpers/reconstruct_command.h"

namespace uncross_test {

namespace {

using namespace tessera;
using namespace tessera::test;
namespace fs = std::filesystem;

/// A ball of which every vertex was moved, by `roughness` as a standard deviation: no two faces of it lie in one plane, so most cells hold a feature.
WholeMesh rough_ball(double roughness = 0.03, std::uint64_t seed = 3) {
  constexpr int kRings = 60, kAround = 2 * kRings;
  Random random(seed);
  WholeMesh mesh;
  for (int i = 0; i <= kRings; ++i)
    for (int j = 0; j < kAround; ++j) {
      const double polar = 180.0 * i / kRings, round = 360.0 * j / kAround,
                   r = 1.0 + roughness * random.gaussian();
      const double flat = cosine_of_degrees(90.0 - polar);
      mesh.points.push_back({r * flat * cosine_of_degrees(round), r * flat * cosine_of_degrees(90.0 - round),
                             r * cosine_of_degrees(polar)});
    }
  for (int i = 0; i < kRings; ++i)
    for (int j = 0; j < kAround; ++j) {
      const auto at = [&](int k, int l) { return static_cast<std::uint64_t>(k * kAround + l % kAround); };
      if (i > 0) mesh.faces.push_back({at(i, j), at(i + 1, j), at(i, j + 1)});
      if (i + 1 < kRings) mesh.faces.push_back({at(i, j + 1), at(i + 1, j), at(i + 1, j + 1)});
    }
  mesh.header.vertices = mesh.points.size();
  mesh.header.faces = mesh.faces.size();
  return mesh;
}

/// Pairs that cross, overlap or touch, by the command.
Json crossings_of(const fs::path& mesh) {
  const fs::path report = mesh.string() + ".check.json";
  const CommandResult r =
      tessera_command({"check", mesh.string(), "--crossings", "--report", report.string(), "--force"});
  INFO(r.errors);
  REQUIRE(r.code == 0);
  return parse_json(file_bytes(report)).at("crossings");
}

std::uint64_t pairs_found(const fs::path& mesh) {
  const Json report = parse_json(file_bytes(mesh.string() + ".report.json"));
  return stage_result(report, "uncross-1").at("crossing_pairs").get<std::uint64_t>();
}

void check_sound(const fs::path& mesh) {
  const Json crossings = crossings_of(mesh);
  INFO(dump_json(crossings));
  CHECK(crossings.at("cross") == 0);
  CHECK(crossings.at("overlap") == 0);
  CHECK(crossings.at("touch") == 0);
}

}  // namespace

TEST_CASE("uncross: a solid full of features does not cross itself, the same bytes whatever runs",
          "[property]") {
  const TempFolder folder;
  write_whole(folder / "ball.ply", rough_ball());
  const fs::path out = folder / "out.ply";
  const auto run = [&](std::vector<std::string> more) {
    more.insert(more.begin(), {"resurface", (folder / "ball.ply").string(), "-o", out.string(), "--force",
                               "--resolution", "0.03", "--progress", "none", "-q"});
    const CommandResult r = tessera_command(more);
    INFO(r.errors);
    REQUIRE(r.code == 0);
    return file_bytes(out);
  };
  const std::string bytes = run({"-t", "1"});
  CHECK(pairs_found(out) > 300);
  check_sound(out);
  CHECK(run({"-t", "2", "--tile-size", "64", "--memory", "160M"}) == bytes);
  CHECK(run({"-t", "2", "--tile-size", "128", "--processes"}) == bytes);
}

TEST_CASE("uncross: vertices go back until none of their faces meets the next one", "[pipeline]") {
  const TempFolder folder;
  write_whole(folder / "ball.ply", rough_ball(0.16, 1));
  const fs::path out = folder / "out.ply";
  const CommandResult r = tessera_command({"resurface", (folder / "ball.ply").string(), "-o", out.string(),
                                           "--resolution", "0.016", "--progress", "none", "-q"});
  INFO(r.errors);
  REQUIRE(r.code == 0);
  const Json report = parse_json(file_bytes(out.string() + ".report.json"));
  CHECK(stage_result(report, "uncross-4").at("crossing_pairs").get<std::uint64_t>() > 0);
  check_sound(out);
}

TEST_CASE("uncross: faces are apart as they are written, and at the sides of cells and bricks",
          "[pipeline]") {
  const TempFolder folder;
  const fs::path in = folder / "in.ply";
  const auto run = [&](const Double3& by, double snap, const std::string& name) {
    WholeMesh mesh = rough_ball();
    for (Double3& p : mesh.points)
      for (std::size_t a = 0; a < 3; ++a)
        p[a] = by[a] + (snap > 0.0 ? std::round(5.0 * p[a] / snap) * snap : 5.0 * p[a]);
    mesh.header.double_positions = true;
    write_whole(in, mesh);
    const fs::path to = folder / name;
    const CommandResult r = tessera_command({"resurface", in.string(), "-o", to.string(), "--resolution",
                                             "0.2", "--no-html", "-q", "--force", "--progress", "none"});
    INFO(r.errors);
    REQUIRE(r.code == 0);
    CHECK(pairs_found(to) > 100);
    check_sound(to);
  };
  // Floats step by a thousandth of a cell there: feature samples that hardly leave their cells cross others when they are rounded.
  run({3000, 3000, 3000}, 0.0, "far.ply");
  run({3000, 3000, 3000}, 0.0, "far.glb");
  // Corners at nodes of the lattice, features in the sides of cells, where what is on both sides would touch.
  run({0, 0, 0}, 0.2, "snapped.ply");
}

TEST_CASE("uncross: what rounding of the written floats makes meet does not", "[pipeline]") {
  const TempFolder folder;
  WholeMesh ball = rough_ball();
  for (Double3& p : ball.points) p = p + Double3{250, 250, 250};
  ball.header.double_positions = true;
  write_whole(folder / "ball.ply", ball);
  for (const std::string name : {"out.ply", "out.stl"}) {
    const fs::path out = folder / name;
    const CommandResult r = tessera_command({"resurface", (folder / "ball.ply").string(), "-o", out.string(),
                                             "--resolution", "0.03", "--progress", "none", "-q"});
    INFO(r.errors);
    REQUIRE(r.code == 0);
    check_sound(out);
  }
  CHECK_FALSE(read_whole(folder / "out.ply").header.double_positions);
}

TEST_CASE("uncross: solids that touch along an edge, and walls in the sides of bricks, do not touch",
          "[pipeline]") {
  const TempFolder folder;
  WholeMesh cubes;
  for (const Double3& at : {Double3{-0.5, -0.5, -0.5}, Double3{0.5, 0.5, -0.5}}) {
    const MeshBlock cube = cube_block(1);
    const auto first = static_cast<std::uint64_t>(cubes.points.size());
    for (const Double3& p : cube.position) cubes.points.push_back(p + at);
    for (const auto& f : cube.faces) cubes.faces.push_back({first + f[0], first + f[1], first + f[2]});
  }
  cubes.header.vertices = cubes.points.size();
  cubes.header.faces = cubes.faces.size();
  const std::string in = (folder / "cubes.ply").string();
  write_whole(in, cubes);
  const fs::path out = folder / "out.ply";
  for (const std::string h : {"0.017", "0.03", "0.015625"}) {
    CAPTURE(h);
    const CommandResult r = tessera_command(
        {"csg", in, "+", in, "-o", out.string(), "--force", "--resolution", h, "--progress", "none", "-q"});
    INFO(r.errors);
    REQUIRE(r.code == 0);
    check_sound(out);
  }
}

TEST_CASE("uncross: a noisy scan with torn borders does not cross itself, the same bytes whatever runs",
          "[property]") {
  const TempFolder folder;
  const std::string scan = (folder / "scan.ply").string();
  REQUIRE(tessera_command({"synth", "--scene", "city", "--points", "60k", "--noise", "1.5s", "--noise-length",
                           "4s", "-o", scan})
              .code == 0);
  const fs::path out = folder / "out.ply";
  for (const std::string border : {"auto", "raw"}) {
    CAPTURE(border);
    const auto run = [&](std::vector<std::string> more) {
      more.insert(more.end(), {"--border", border, "--force"});
      reconstructed(scan, out, more);
      return file_bytes(out);
    };
    const std::string bytes = run({"-t", "1"});
    CHECK(pairs_found(out) > 0);
    check_sound(out);
    if (border == "auto") {  // borders of holes move for their fillings
      const Json report = parse_json(file_bytes(out.string() + ".report.json"));
      CHECK(stage_result(report, "blunt").at("moved_vertices").get<int>() > 0);
      CHECK(stage_result(report, "holes").at("rounded").get<int>() > 0);
    }
    CHECK(run({"-t", "2", "--tile-size", "64"}) == bytes);
  }
}

TEST_CASE(
    "uncross: a surface that is decimated in memory does not cross itself, the same bytes whatever runs",
    "[property]") {
  const TempFolder folder;
  const std::string scan = (folder / "scan.ply").string();
  REQUIRE(tessera_command({"synth", "--scene", "city", "--points", "60k", "--noise", "1.5s", "--noise-length",
                           "4s", "-o", scan})
              .code == 0);
  const fs::path out = folder / "out.ply";
  const auto run = [&](std::vector<std::string> more) {
    more.insert(more.end(), {"--tolerance", "auto", "--border", "raw", "--force"});
    reconstructed(scan, out, more);
    return file_bytes(out);
  };
  const std::string bytes = run({"-t", "1"});
  const Json report = parse_json(file_bytes(out.string() + ".report.json"));
  CHECK(stage_result(report, "surface").at("first_pass").at("crossing_pairs").get<std::uint64_t>() > 0);
  check_sound(out);
  CHECK(run({"-t", "2", "--tile-size", "64"}) == bytes);
}

TEST_CASE(
    "uncross: faces that cross at the sides of the blocks of the first pass do not in the end, the same "
    "bytes whatever runs",
    "[property]") {
  const TempFolder folder;
  const std::string scan = (folder / "scan.ply").string();
  REQUIRE(tessera_command({"synth", "--scene", "indoor", "--points", "200k", "--noise", "1.5s",
                           "--noise-length", "4s", "-o", scan})
              .code == 0);
  const fs::path out = folder / "out.ply";
  const auto run = [&](std::vector<std::string> more) {
    more.insert(more.end(),
                {"--resolution", "0.04", "--tolerance", "auto", "--border", "raw", "--keep-raw", "--force"});
    reconstructed(scan, out, more);
    return file_bytes(out) + file_bytes(folder / "out.raw.ply");
  };
  const std::string bytes = run({"-t", "1"});
  const Json report = parse_json(file_bytes(out.string() + ".report.json"));
  CHECK(stage_result(report, "sides-1").at("crossing_pairs").get<std::uint64_t>() > 10);
  CHECK(stage_result(report, "prune").at("vertices_back").get<std::uint64_t>() > 4);
  CHECK(stage_result(report, "prune").at("blocks_anew").get<std::uint64_t>() > 1);
  CHECK(stage_result(report, "mend").at("left_pairs") == 0);
  check_sound(out);
  check_sound(folder / "out.raw.ply");
  CHECK(run({"-t", "2", "--tile-size", "64", "--memory", "300M"}) == bytes);
}

TEST_CASE("uncross: decimating and remeshing a mesh of thin walls make none cross", "[property]") {
  const TempFolder folder;
  const fs::path sheets = folder / "sheets.ply", out = folder / "out.ply";
  // Four shells inside each other, a tenth of an edge of the result apart.
  WholeMesh mesh;
  for (int shell = 0; shell < 4; ++shell) {
    WholeMesh ball = rough_ball();
    const auto first = static_cast<std::uint64_t>(mesh.points.size());
    for (Double3& p : ball.points) {
      const double r = norm(p);
      mesh.points.push_back(p * ((1.0 + 0.012 * shell + 0.04 * (r - 1.0)) / r));
    }
    for (const auto& f : ball.faces) mesh.faces.push_back({f[0] + first, f[1] + first, f[2] + first});
  }
  mesh.header.vertices = mesh.points.size();
  mesh.header.faces = mesh.faces.size();
  write_whole(sheets, mesh);
  check_sound(sheets);
  const std::string given = sheets.string(), made = out.string();
  const auto run = [&](std::vector<std::string> words) {
    words.insert(words.end(), {"-o", made, "--force", "--progress", "none", "-q"});
    const CommandResult r = tessera_command(words);
    INFO(r.errors);
    REQUIRE(r.code == 0);
  };
  run({"decimate", given, "--tolerance", "0.02"});
  check_sound(out);
  run({"decimate", given, "--tolerance", "0.02", "--crossings", "keep"});
  CHECK(crossings_of(out).at("cross").get<std::uint64_t>() > 0);
  run({"remesh", given, "--edge", "0.12"});
  check_sound(out);
}

}  // namespace uncross_test
