// The bare ground as a user gets it: terrain without its building and crowns, in one piece, without an inner border.
#include <catch2/catch.hpp>

#include <algorithm>
#include <array>
#include <cmath>
#include <string>
#include <vector>

#include "stream/files/json.h"
#include "tests/helpers/command.h"
#include "tests/helpers/killed_command.h"
#include "tests/helpers/mesh_files.h"
#include "tests/helpers/random.h"
#include "tests/helpers/reconstruct_command.h"

namespace ground_surface_test {

using namespace tessera::test;

namespace {

constexpr int kSide = 90;

double terrain(double x, double y) {
  return 2.0 * std::sin(0.07 * x) + 1.5 * std::cos(0.06 * y) + 0.05 * x;
}
bool in_building(double x, double y, double margin = 0.0) {
  return x > 20 - margin && x < 38 + margin && y > 25 - margin && y < 50 + margin;
}
bool in_lake(double x, double y, double radius) {
  return (x - 15) * (x - 15) + (y - 72) * (y - 72) < radius * radius;
}

/// A hilly field with a flat roof on it, trees under which one point in six reaches the ground, and a pond of 6 x 6 without any
/// point; one point a line. \param reversed  from the last to the first \param up_is_y  turned on its side
std::string scene(const TempFolder& folder, bool reversed = false, bool up_is_y = false) {
  Random random(8);
  std::vector<std::array<double, 2>> trees;
  for (int i = 0; i < 30; ++i) trees.push_back({random.in(50, 86), random.in(4, 86)});
  std::vector<std::string> lines;
  const auto point = [&](double x, double y, double z) {
    std::string line;
    for (const double c : {x, up_is_y ? z : y, up_is_y ? -y : z}) line += std::to_string(c) + " ";
    lines.push_back(line + "\n");
  };
  for (int i = 0; i < 110000; ++i) {
    const double x = random.in(0, kSide), y = random.in(0, kSide), noise = 0.02 * random.gaussian();
    bool hidden = in_lake(x, y, 3.0);
    for (const auto& [tx, ty] : trees)
      hidden = hidden || (std::hypot(x - tx, y - ty) < 2.5 && random.in(0, 6) > 1.0);
    if (!hidden) point(x, y, (in_building(x, y) ? terrain(29, 37) + 7.0 : terrain(x, y)) + noise);
  }
  for (const auto& [tx, ty] : trees)
    for (int i = 0; i < 500; ++i)
      point(tx + random.gaussian(), ty + random.gaussian(), terrain(tx, ty) + 7.0 + 1.3 * random.gaussian());
  if (reversed) std::reverse(lines.begin(), lines.end());
  std::string text;
  for (const std::string& line : lines) text += line;
  return folder.write(std::string(reversed ? "reversed" : up_is_y ? "turned" : "scene") + ".xyz", text);
}

const std::vector<std::string> kGround = {"--surface", "ground"};

std::vector<std::string> with(std::vector<std::string> words, const std::vector<std::string>& more) {
  words.insert(words.end(), more.begin(), more.end());
  return words;
}

/// Of the vertices but those within two of the outer border.
struct Errors {
  double measured = 0.0, building = 0.0;  ///< largest
};
Errors errors_of(const WholeMesh& mesh) {
  Errors e;
  for (const auto& p : mesh.points) {
    if (p[0] < 2 || p[1] < 2 || p[0] > kSide - 2 || p[1] > kSide - 2) continue;
    double& largest = in_building(p[0], p[1], 1.0) || in_lake(p[0], p[1], 4.0) ? e.building : e.measured;
    largest = std::max(largest, std::fabs(p[2] - terrain(p[0], p[1])));
  }
  return e;
}

}  // namespace

TEST_CASE("ground surface: the terrain goes on below a building, crowns and over a pond", "[pipeline]") {
  const TempFolder folder;
  const bool up_is_y = GENERATE(false, true);
  CAPTURE(up_is_y);
  const auto out = folder.path() / "mesh.ply";
  const tessera::Json report =
      reconstructed(scene(folder, false, up_is_y), out,
                    up_is_y ? with(kGround, {"--up", "0,1,0", "--from", "above"}) : kGround);
  WholeMesh mesh = read_whole(out);
  if (up_is_y)
    for (auto& p : mesh.points) p = {p[0], -p[2], p[1]};
  const Errors e = errors_of(mesh);
  CHECK(e.measured < 0.2);
  CHECK(e.building < 0.5);
  const tessera::MeshCheck check = checked(out, folder.path());
  CHECK(check.components == 1);
  CHECK(check.boundary_loops == 1);
  CHECK(check.nonmanifold_edges + check.nonmanifold_vertices + check.inconsistent_edges == 0);
  // Seen from above it is whole, and what nobody saw of it is told.
  const tessera::Json ground = report.at("ground");
  INFO(tessera::dump_json(ground));
  const double unseen = ground.at("unseen_share").get<double>();
  constexpr double kHidden = (18.0 * 25.0 + 28.0) / (kSide * kSide);  // the roof and the pond
  CHECK(unseen > 0.9 * kHidden);
  CHECK(unseen < 0.2);  // columns under crowns that no point has reached
  CHECK(report.at("mesh").at("synthetic_faces").get<double>() / static_cast<double>(mesh.faces.size()) ==
        Approx(kHidden).epsilon(0.3));
  CHECK(report.at("coverage").at("confirmed") > 0.99);
  CHECK(report.at("coverage").at("plan") > 0.99);
}

TEST_CASE("ground surface: objects wider than the window stay, steps steeper than the slope go",
          "[pipeline]") {
  const TempFolder folder;
  const auto out = folder.path() / "mesh.ply";
  const auto in = scene(folder);
  reconstructed(in, out, with(kGround, {"--ground-window", "5"}));
  const WholeMesh mesh = read_whole(out);
  double roof = 0.0;
  for (const auto& p : mesh.points)
    if (in_building(p[0], p[1], -3.0)) roof = std::max(roof, p[2] - terrain(p[0], p[1]));
  CHECK(roof > 5.0);
}

TEST_CASE("ground surface: it is refused where there is none", "[pipeline]") {
  const TempFolder folder;
  const auto in = scene(folder);
  const auto out = folder.path() / "mesh.ply";
  const auto refused = [&](const std::vector<std::string>& more, const std::string& why) {
    const CommandResult r = tessera_command(reconstruct_words(in, out, with(more, {"--force"})));
    INFO(r.errors);
    CHECK(r.code == 2);
    CHECK(r.errors.find(why) != std::string::npos);
  };
  refused(with(kGround, {"--from", "around"}), "--surface ground with --from around");
  refused(with(kGround, {"--normals", "given"}), "--surface ground with --normals given");
  refused(with(kGround, {"--viewpoint", "40,40,100"}), "not seen from above");
  refused(with(kGround, {"--ground-window", "1000"}), "--ground-window 1000");
  refused({"--ground-slope", "0.3"}, "--ground-slope: means something with --surface ground or");
  refused({"--surface", "top", "--ground-window", "30"}, "--ground-window: means something");
}

TEST_CASE("ground surface: same bytes whatever tiles, threads, cap, kills and order of points",
          "[property]") {
  const TempFolder folder;
  const auto in = scene(folder);
  const auto out = folder.path() / "mesh.ply";
  reconstructed(in, out, with(kGround, {"-t", "1"}));
  const std::string first = file_bytes(out);
  for (const std::vector<std::string>& run :
       {std::vector<std::string>{"-t", "2", "--tile-size", "64"}, {"-t", "2", "--memory", "160M"}}) {
    reconstructed(in, out, with(with(kGround, run), {"--force"}));
    CHECK(file_bytes(out) == first);
  }
  reconstructed(scene(folder, true), out, with(kGround, {"--force"}));
  CHECK(file_bytes(out) == first);
  const auto killed = folder.path() / "killed.ply";
  const CommandResult r = resumed_after_kills(reconstruct_words(in, killed, with(kGround, {"-t", "2"})));
  INFO(r.errors);
  REQUIRE(r.code == 0);
  CHECK(file_bytes(killed) == first);
}

}  // namespace ground_surface_test
