// The top surface as a user meets it: crowns over ground become one smooth skin, with nothing given, and the ground stays.
#include <catch2/catch.hpp>

#include <algorithm>
#include <array>
#include <cmath>
#include <string>
#include <vector>

#include "octree/vector.h"
#include "stream/files/json.h"
#include "tests/helpers/command.h"
#include "tests/helpers/killed_command.h"
#include "tests/helpers/mesh_files.h"
#include "tests/helpers/random.h"
#include "tests/helpers/reconstruct_command.h"

namespace top_surface_model_test {

using namespace tessera::test;

namespace {

constexpr int kSide = 80;

/// A field with a wood on a third of it and a hole of 3 x 3 beside it, one point a line. \param up_is_y  turned on its side
std::string wood(const TempFolder& folder, bool up_is_y = false) {
  Random random(5);
  std::string text;
  const auto point = [&](double x, double y, double z) {
    for (const double c : {x, up_is_y ? z : y, up_is_y ? -y : z}) text += std::to_string(c) + " ";
    text += "\n";
  };
  for (int i = 0; i < 100000; ++i) {
    const double x = random.in(0, kSide), y = random.in(0, kSide);
    if (std::fabs(x - 55) > 1.5 || std::fabs(y - 40) > 1.5) point(x, y, 0.5 * std::sin(0.2 * x));
  }
  for (int tree = 0; tree < 80; ++tree) {
    const double x = random.in(3, 27), y = random.in(3, kSide - 3), z = random.in(10, 13);
    for (int i = 0; i < 1500; ++i)
      point(x + 1.5 * random.gaussian(), y + 1.5 * random.gaussian(), z + 1.2 * random.gaussian());
  }
  return folder.write(up_is_y ? "turned.xyz" : "wood.xyz", text);
}

/// A noisy cliff over a field, a part of it unseen. A gap in it of 3.5 x 30 has a border that no brick sees whole. One point a
/// line.
std::string cliff(const TempFolder& folder) {
  Random random(8);
  std::string text;
  const auto point = [&](double x, double y, double z) {
    for (const double c : {x, y, z}) text += std::to_string(c + 0.05 * random.gaussian()) + " ";
    text += "\n";
  };
  for (int i = 0; i < 60000; ++i) {
    point(random.in(0, 40), random.in(0, 60), 0.0);
    point(random.in(40, 80), random.in(0, 60), 30.0);
    const double up = random.in(0, 30), y = random.in(0, 60);
    if (y < 45 && (std::fabs(up - 15) > 1.75 || std::fabs(y - 25) > 15)) point(40, y, up);
  }
  return folder.write("cliff.xyz", text);
}

/// A field, the floor below a flat roof of 20 x 20 and its walls, a line a point; `reversed` from the last to the first.
std::string hall(const TempFolder& folder, bool reversed = false) {
  Random random(6);
  std::vector<std::string> lines;
  const auto point = [&](double x, double y, double z) {
    lines.push_back(std::to_string(x) + " " + std::to_string(y) + " " + std::to_string(z) + "\n");
  };
  for (int i = 0; i < 100000; ++i) point(random.in(0, kSide), random.in(0, kSide), 0.0);
  for (int i = 0; i < 8000; ++i) point(random.in(30, 50), random.in(30, 50), 8.0);
  for (int i = 0; i < 3000; ++i) point(random.in(0, 1) < 0.5 ? 30 : 50, random.in(30, 50), random.in(0, 8));
  if (reversed) std::reverse(lines.begin(), lines.end());
  std::string text;
  for (const std::string& line : lines) text += line;
  return folder.write(reversed ? "reversed.xyz" : "hall.xyz", text);
}

/// A slope with a house of 20 x 20 on it, and trees on its left side, below which one point in thirty reaches the ground; one
/// point a line, `reversed` from the last to the first.
std::string grove(const TempFolder& folder, bool reversed = false) {
  Random random(9);
  std::vector<std::string> lines;
  const auto point = [&](double x, double y, double z) {
    lines.push_back(std::to_string(x) + " " + std::to_string(y) + " " + std::to_string(z) + "\n");
  };
  std::vector<std::array<double, 2>> trees;
  for (int tree = 0; tree < 40; ++tree) trees.push_back({random.in(4, 27), random.in(4, kSide - 4)});
  for (int i = 0; i < 100000; ++i) {
    const double x = random.in(0, kSide), y = random.in(0, kSide);
    const bool house = x > 50 && x < 70 && y > 30 && y < 50;
    bool hidden = false;
    for (const auto& [tx, ty] : trees)
      hidden = hidden || (std::hypot(x - tx, y - ty) < 3.5 && random.in(0, 30) > 1.0);
    if (!hidden) point(x, y, house ? 6.0 : 0.01 * x);
  }
  for (const auto& [tx, ty] : trees)
    for (int i = 0; i < 1500; ++i)
      point(tx + 1.2 * random.gaussian(), ty + 1.2 * random.gaussian(), 9.0 + 1.2 * random.gaussian());
  if (reversed) std::reverse(lines.begin(), lines.end());
  std::string text;
  for (const std::string& line : lines) text += line;
  return folder.write(reversed ? "reversed.xyz" : "grove.xyz", text);
}

/// A field, and three wires 1.5 apart over it, or a roof as wide as they are together, a line a point.
std::string field_below(const TempFolder& folder, bool roof) {
  Random random(7);
  std::string text;
  const auto point = [&](double x, double y, double z) {
    text += std::to_string(x) + " " + std::to_string(y) + " " + std::to_string(z) + "\n";
  };
  for (int i = 0; i < 26000; ++i) {
    const double x = random.in(0, kSide), y = random.in(0, kSide);
    if (!roof || std::fabs(y - 40) > 1.5) point(x, y, 0.3 * std::sin(0.1 * x));
  }
  for (int wire = -1; wire <= 1; ++wire)
    for (int i = 0; i < 800; ++i)
      point(random.in(0, kSide), 40 + (roof ? random.in(-1.5, 1.5) : 1.5 * wire + 0.02 * random.gaussian()),
            10 + 0.02 * random.gaussian());
  return folder.write(roof ? "roof.xyz" : "wires.xyz", text);
}

/// Share of the squares of one of [x0, x1) x [y0, y1) over which vertices of the mesh lie between two heights.
double covered(const WholeMesh& mesh, int x0, int x1, int y0, int y1, double low, double high) {
  std::vector<char> seen(kSide * kSide, 0);
  for (const auto& p : mesh.points)
    if (p[2] > low && p[2] < high && p[0] >= 0 && p[1] >= 0 && p[0] < kSide && p[1] < kSide)
      seen[static_cast<std::size_t>(p[1]) * kSide + static_cast<std::size_t>(p[0])] = 1;
  double n = 0;
  for (int y = y0; y < y1; ++y)
    for (int x = x0; x < x1; ++x) n += seen[static_cast<std::size_t>(y * kSide + x)];
  return n / ((x1 - x0) * (y1 - y0));
}

/// Share of the area that shows downwards.
double downwards(const WholeMesh& mesh) {
  using namespace tessera;  // vectors
  double down = 0, all = 0;
  for (const auto& f : mesh.faces) {
    const Double3 n = cross(mesh.points[f[1]] - mesh.points[f[0]], mesh.points[f[2]] - mesh.points[f[0]]);
    all += norm(n);
    if (n[2] < -0.3 * norm(n)) down += norm(n);
  }
  return down / all;
}

}  // namespace

TEST_CASE("top surface: crowns become one smooth skin, the ground stays, holes are filled", "[pipeline]") {
  const TempFolder folder;
  const auto in = wood(folder);
  const auto out = folder.path() / "mesh.ply";
  const tessera::Json report = reconstructed(in, out, {});
  CHECK(stage_result(report, "orient").at("scene") == "from above");
  CHECK(stage_result(report, "orient").at("vegetation").at("as") == "top");
  const tessera::Json top = stage_result(report, "top");
  INFO(tessera::dump_json(top));
  CHECK(top.at("columns").get<int>() > 1000);
  CHECK(top.at("filled_columns").get<int>() > 10);
  const WholeMesh mesh = read_whole(out);
  CHECK(covered(mesh, 6, 25, 6, kSide - 6, 6, 20) > 0.95);
  CHECK(covered(mesh, 34, kSide - 1, 1, kSide - 1, -1, 1) > 0.999);
  CHECK(downwards(mesh) < 0.01);
  const auto dropped = folder.path() / "dropped.ply";
  const tessera::Json ground = reconstructed(in, dropped, {"--vegetation", "drop"});
  CHECK(stage_result(ground, "orient").at("vegetation").at("as") == "dropped");
  CHECK(ground.at("ground").at("cleared_columns").get<int>() > 1000);
  const WholeMesh bare = read_whole(dropped);
  CHECK(covered(bare, 0, kSide, 0, kSide, 2, 30) == 0.0);
  CHECK(covered(bare, 1, kSide - 1, 1, kSide - 1, -1, 1) > 0.999);
}

TEST_CASE("top surface: without vegetation the ground goes on, and houses stay, whatever runs",
          "[pipeline]") {
  const TempFolder folder;
  const auto out = folder.path() / "mesh.ply";
  const auto in = grove(folder);
  const tessera::Json report = reconstructed(in, out, {"--vegetation", "drop"});
  const tessera::Json ground = report.at("ground");
  INFO(tessera::dump_json(ground));
  CHECK(ground.at("cleared_columns").get<int>() > 300);
  CHECK(ground.at("unseen_columns").get<int>() > 100);
  const WholeMesh mesh = read_whole(out);
  CHECK(covered(mesh, 51, 69, 31, 49, 5.5, 6.5) > 0.99);       // the roof
  CHECK(covered(mesh, 2, 30, 2, kSide - 2, -1, 1.5) > 0.999);  // under the trees
  CHECK(covered(mesh, 0, 40, 0, kSide, 1.5, 30) == 0.0);       // nothing is left of them
  CHECK(report.at("mesh").at("synthetic_faces").get<int>() > 100);
  CHECK(checked(out, folder.path()).components <= 2);
  const auto bytes = file_bytes(out);
  reconstructed(
      grove(folder, true), out,
      {"--vegetation", "drop", "--force", "--threads", "3", "--tile-size", "64", "--memory", "192M"});
  CHECK(file_bytes(out) == bytes);
  // What was not seen from above has no ground.
  const tessera::Json around =
      reconstructed(in, out, {"--vegetation", "drop", "--from", "around", "--max-uncertain", "1", "--force"});
  CHECK_FALSE(stage_result(around, "top").at("needed").get<bool>());
  CHECK_FALSE(stage_result(around, "ground").at("needed").get<bool>());
  CHECK_FALSE(around.contains("ground"));
  const CommandResult none = tessera_command(
      reconstruct_words(in, out, {"--ground-slope", "0.3", "--vegetation", "top", "--force"}));
  CHECK(none.code == 2);
  CHECK(none.errors.find("--surface ground or --vegetation drop only") != std::string::npos);
}

TEST_CASE("top surface: gaps in steep faces are closed, longer than a brick too, whatever runs",
          "[pipeline]") {
  const TempFolder folder;
  const auto in = cliff(folder);
  const auto out = folder.path() / "mesh.ply";
  const std::vector<std::string> words = {"--from", "above", "--resolution", "0.5"};
  const auto run = [&](std::vector<std::string> more) {
    more.insert(more.end(), words.begin(), words.end());
    more.push_back("--force");
    return reconstructed(in, out, more);
  };
  const tessera::Json open = run({"--max-hole", "60"});
  const tessera::Json report = run({"-t", "1"});
  const tessera::Json loops = stage_result(report, "loops"), holes = stage_result(report, "holes");
  INFO(tessera::dump_json(loops) + tessera::dump_json(holes) +
       tessera::dump_json(stage_result(report, "blunt")));
  CHECK(loops.at("chained").get<int>() >= 1);
  CHECK(loops.at("given_up").get<int>() == 0);
  CHECK(holes.at("filled").get<int>() > stage_result(open, "holes").at("filled").get<int>());
  CHECK(tessera_command({"check", out.string(), "--strict"}).code == 0);
  const auto bytes = file_bytes(out);
  run({"-t", "2", "--tile-size", "64"});
  CHECK(file_bytes(out) == bytes);
}

TEST_CASE("top surface: wires are left out and counted, a narrow roof is not", "[pipeline]") {
  const TempFolder folder;
  const auto out = folder.path() / "mesh.ply";
  const tessera::Json report = reconstructed(field_below(folder, false), out, {});
  CHECK(stage_result(report, "orient").at("scene") == "from above");
  CHECK(stage_result(report, "top-points").at("thin_left_out").get<int>() > 2000);
  const WholeMesh mesh = read_whole(out);
  CHECK(covered(mesh, 0, kSide, 36, 45, 2, 20) < 0.03);
  CHECK(covered(mesh, 1, kSide - 1, 1, kSide - 1, -1, 1) > 0.99);
  const auto tiled = folder.path() / "tiled.ply";
  reconstructed((folder.path() / "wires.xyz").string(), tiled, {"--tile-size", "64", "-t", "1"});
  CHECK(file_bytes(tiled) == file_bytes(out));

  const auto house = folder.path() / "house.ply";
  const tessera::Json roofed = reconstructed(field_below(folder, true), house, {});
  CHECK(stage_result(roofed, "top-points").at("thin_left_out").get<int>() == 0);
  CHECK(covered(read_whole(house), 2, kSide - 2, 39, 41, 9, 11) > 0.9);
}

TEST_CASE("top surface: it replaces no point that is to be measured", "[pipeline]") {
  const TempFolder folder;
  const auto in = wood(folder);
  const auto out = folder.path() / "mesh.ply";
  std::vector<std::string> more = {"--tolerance", "20", "--reference", "points"};
  const tessera::Json report = reconstructed(in, out, more);
  CHECK(stage_result(report, "orient").at("vegetation").at("as") == "dropped");
  CHECK_FALSE(stage_result(report, "top").at("needed").get<bool>());
  more.insert(more.end(), {"--vegetation", "top", "--force"});
  const CommandResult refused = tessera_command(reconstruct_words(in, out, more));
  CHECK(refused.code == 2);
  CHECK(refused.errors.find("--vegetation top with --reference points") != std::string::npos);
}

TEST_CASE("top surface: a skin has one height per column, and walls", "[pipeline]") {
  const TempFolder folder;
  const auto out = folder.path() / "mesh.ply";
  const std::vector<std::string> skin = {"--surface", "top", "--from", "above"};
  SECTION("ground below crowns is not in it") {
    const auto in = wood(folder);
    reconstructed(in, out, skin);
    const WholeMesh mesh = read_whole(out);
    // Every square shows crowns or, between them, ground; hardly one shows both.
    const double crowns = covered(mesh, 6, 25, 6, kSide - 6, 6, 20);
    const double ground = covered(mesh, 6, 25, 6, kSide - 6, -3, 3);
    CHECK(crowns > 0.95);
    CHECK(crowns + ground > 0.99);
    CHECK(crowns + ground < 1.05);
    CHECK(covered(mesh, 34, kSide - 1, 1, kSide - 1, -1, 1) > 0.999);
    CHECK(downwards(mesh) < 0.001);
    const auto all = folder.path() / "all.ply";
    reconstructed(in, all, {});
    CHECK(covered(read_whole(all), 6, 25, 6, kSide - 6, -3, 3) > 0.5);
  }
  SECTION("the floor below a roof is not in it, its walls are, seen or not") {
    const auto in = hall(folder);
    const tessera::Json report = reconstructed(in, out, skin);
    CHECK(stage_result(report, "top-points").at("measured_behind").get<int>() > 5000);
    const WholeMesh mesh = read_whole(out);
    CHECK(covered(mesh, 32, 48, 32, 48, 7, 9) > 0.999);
    CHECK(covered(mesh, 32, 48, 32, 48, -3, 7) == 0.0);
    CHECK(covered(mesh, 29, 31, 31, 49, 2, 6) > 0.5);
    CHECK(covered(mesh, 31, 49, 29, 31, 2, 6) > 0.5);  // nobody saw it
    CHECK(downwards(mesh) < 0.001);
    const auto all = folder.path() / "all.ply";
    reconstructed(in, all, {"--from", "above"});
    CHECK(covered(read_whole(all), 32, 48, 32, 48, -1, 1) > 0.9);
  }
}

TEST_CASE("top surface: a skin is refused where there is none", "[pipeline]") {
  const TempFolder folder;
  const auto in = wood(folder);
  const auto out = folder.path() / "mesh.ply";
  const auto refused = [&](std::vector<std::string> more, const std::string& why) {
    more.insert(more.end(), {"--surface", "top", "--force"});
    const CommandResult r = tessera_command(reconstruct_words(in, out, more));
    INFO(r.errors);
    CHECK(r.code == 2);
    CHECK(r.errors.find("--surface top") != std::string::npos);
    CHECK(r.errors.find(why) != std::string::npos);
  };
  refused({"--from", "inside"}, "--from inside");
  refused({"--normals", "given"}, "--normals given");
  refused({"--vegetation", "keep"}, "--vegetation keep");
  refused({"--tolerance", "20", "--reference", "points"}, "--reference points");
  refused({"--viewpoint", "40,40,100"}, "not seen from above");
  std::string plate;
  for (int i = 0; i < 900; ++i) plate += std::to_string(i % 30) + " " + std::to_string(i / 30) + " 0 0 0 1\n";
  const auto with_normals = folder.write("normals.xyz", plate);
  const CommandResult given = tessera_command(
      reconstruct_words(with_normals, out, {"--surface", "top", "--columns", "x,y,z,nx,ny,nz", "--force"}));
  INFO(given.errors);
  CHECK(given.code == 2);
  CHECK(given.errors.find("--normals estimate") != std::string::npos);
}

TEST_CASE("top surface: up is any axis", "[pipeline]") {
  const TempFolder folder;
  const auto out = folder.path() / "mesh.ply";
  const tessera::Json report = reconstructed(wood(folder, true), out, {"--up", "0,1,0", "--from", "above"});
  CHECK(stage_result(report, "top").at("columns").get<int>() > 1000);
  WholeMesh mesh = read_whole(out);
  for (auto& p : mesh.points) p = {p[0], -p[2], p[1]};
  CHECK(covered(mesh, 6, 25, 6, kSide - 6, 6, 20) > 0.95);
  CHECK(downwards(mesh) < 0.01);
}

TEST_CASE("top surface: same bytes whatever tiles, threads, cap and kills", "[property]") {
  const TempFolder folder;
  const auto in = wood(folder);
  const bool skin = GENERATE(false, true);
  CAPTURE(skin);
  const std::vector<std::string> product = {"--surface", skin ? "top" : "all"};
  std::string first;
  for (const std::vector<std::string>& run : {std::vector<std::string>{"-t", "1"},
                                              {"-t", "2", "--tile-size", "64"},
                                              {"-t", "2", "--memory", "160M"}}) {
    const auto out = folder.path() / "mesh.ply";
    std::vector<std::string> more = run;
    more.push_back("--force");
    more.insert(more.end(), product.begin(), product.end());
    reconstructed(in, out, more);
    if (first.empty()) first = file_bytes(out);
    CHECK(file_bytes(out) == first);
  }
  const auto out = folder.path() / "killed.ply";
  std::vector<std::string> more = {"-t", "2"};
  more.insert(more.end(), product.begin(), product.end());
  const CommandResult r = resumed_after_kills(reconstruct_words(in, out, more));
  INFO(r.errors);
  REQUIRE(r.code == 0);
  CHECK(file_bytes(out) == first);
}

TEST_CASE("top surface: a skin is the same bytes whatever the order of points", "[property]") {
  const TempFolder folder;
  const auto out = folder.path() / "mesh.ply";
  const std::vector<std::string> skin = {"--surface", "top", "--from", "above", "--force"};
  reconstructed(hall(folder), out, skin);
  const std::string first = file_bytes(out);
  reconstructed(hall(folder, true), out, skin);
  CHECK(file_bytes(out) == first);
}

}  // namespace top_surface_model_test
