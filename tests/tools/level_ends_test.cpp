// reconstruct --levels: where the surface ends, points that must lie near it, and what stands in for strewn ones.
#include <catch2/catch.hpp>

#include <algorithm>
#include <array>
#include <cmath>
#include <string>
#include <vector>

#include "octree/vector.h"
#include "stream/files/json.h"
#include "tests/helpers/killed_command.h"
#include "tests/helpers/mesh_files.h"
#include "tests/helpers/random.h"
#include "tests/helpers/reconstruct_command.h"

namespace level_ends_test {

using namespace tessera;
using namespace tessera::test;

namespace {

namespace fs = std::filesystem;

/// A noisy sheet of 60 x 60, sixteen times as dense beyond x = 30, with normals. \param slit  as wide as that, along x from 22 to 38
std::string sheet(const TempFolder& folder, double slit, bool reversed = false) {
  Random random(11);
  std::vector<std::string> lines;
  const auto add = [&](int count, double low) {
    for (int i = 0; i < count; ++i) {
      const double x = random.in(low, low + 30), y = random.in(0, 60), z = 0.02 * random.gaussian();
      if (std::fabs(x - 30) < 8 && std::fabs(y - 30) < 0.5 * slit) continue;
      lines.push_back(std::to_string(x) + " " + std::to_string(y) + " " + std::to_string(z) + " 0 0 1\n");
    }
  };
  add(7'000, 0);
  add(112'000, 30);
  if (reversed) std::reverse(lines.begin(), lines.end());
  std::string text = "x y z nx ny nz\n";
  for (const std::string& line : lines) text += line;
  return folder.write(reversed ? "reversed.xyz" : "sheet.xyz", text);
}

/// A field, denser on its right half, with crowns on its left third and over the seam; a line a point.
std::string grove(const TempFolder& folder, bool reversed = false) {
  Random random(5);
  std::vector<std::string> lines;
  const auto point = [&](double x, double y, double z) {
    lines.push_back(std::to_string(x) + " " + std::to_string(y) + " " + std::to_string(z) + "\n");
  };
  const auto ground = [](double x) { return 0.5 * std::sin(0.2 * x); };
  for (int i = 0; i < 70'000; ++i) {
    const double x = random.in(0, 80);
    point(x, random.in(0, 80), ground(x) + 0.02 * random.gaussian());
  }
  for (int i = 0; i < 200'000; ++i) {
    const double x = random.in(40, 80);
    point(x, random.in(0, 80), ground(x) + 0.02 * random.gaussian());
  }
  for (int tree = 0; tree < 50; ++tree) {
    const double x = random.in(3, 50), y = random.in(3, 77), z = random.in(10, 13);
    for (int i = 0; i < 1500; ++i)
      point(x + 1.5 * random.gaussian(), y + 1.5 * random.gaussian(), z + 1.2 * random.gaussian());
  }
  if (reversed) std::reverse(lines.begin(), lines.end());
  std::string text;
  for (const std::string& line : lines) text += line;
  return folder.write(reversed ? "reversed.xyz" : "grove.xyz", text);
}

void check_clean(const fs::path& mesh, const fs::path& temp) {
  CHECK(checked(mesh, temp).defects().empty());
  const fs::path report = temp / "crossings.json";
  const CommandResult r =
      tessera_command({"check", mesh.string(), "--crossings", "--report", report.string(), "--force"});
  INFO(r.errors);
  REQUIRE(r.code == 0);
  const Json crossings = parse_json(file_bytes(report)).at("crossings");
  INFO(dump_json(crossings));
  CHECK(crossings.at("cross") == 0);
  CHECK(crossings.at("overlap") == 0);
  CHECK(crossings.at("touch") == 0);
}

void check_levels_used(const Json& report) {
  int used = 0;
  const Json surface = stage_result(report, "surface");
  for (const Json& faces : surface.at("faces_of_level")) used += faces.get<int>() > 500;
  CHECK(used > 1);
}

/// Of the edges of one face, in all.
double border_length(const fs::path& path) {
  const WholeMesh mesh = read_whole(path);
  std::vector<std::array<std::uint64_t, 2>> edges;
  for (const MeshFace& f : mesh.faces)
    for (std::size_t i = 0; i < 3; ++i) {
      const std::uint64_t a = f[i], b = f[(i + 1) % 3];
      edges.push_back({std::min(a, b), std::max(a, b)});
    }
  std::sort(edges.begin(), edges.end());
  double length = 0.0;
  for (std::size_t i = 0; i < edges.size(); ++i)
    if ((i == 0 || edges[i] != edges[i - 1]) && (i + 1 == edges.size() || edges[i] != edges[i + 1]))
      length += norm(mesh.points[edges[i][0]] - mesh.points[edges[i][1]]);
  return length;
}

}  // namespace

TEST_CASE(
    "reconstruct --levels --border smooth: the border is shorter, moves by a cell, and nothing else does",
    "[pipeline]") {
  const TempFolder folder;
  const std::string in = sheet(folder, 0.0);
  const fs::path raw = folder.path() / "raw.ply", smooth = folder.path() / "smooth.ply";
  std::vector<std::string> more = {"--levels", "3", "--resolution", "0.8", "--max-hole", "0"};
  const Json before = reconstructed(in, raw, more);
  more.insert(more.end(), {"--border", "smooth"});
  const Json after = reconstructed(in, smooth, more);
  check_levels_used(after);
  check_clean(smooth, folder.path());
  CHECK(before.at("mesh").at("faces") == after.at("mesh").at("faces"));
  const WholeMesh a = read_whole(raw), b = read_whole(smooth);
  REQUIRE(a.faces == b.faces);
  std::size_t moved = 0, inner = 0;
  for (std::size_t v = 0; v < a.points.size(); ++v) {
    const double by = norm(a.points[v] - b.points[v]);
    CHECK(by <= 0.8001);
    moved += by > 0.0;
    const Double3& p = a.points[v];
    inner += by > 0.0 && p[0] > 5 && p[0] < 55 && p[1] > 5 && p[1] < 55;
  }
  CHECK(moved > 200);
  CHECK(inner == 0);
  CHECK(stage_result(after, "border").at("moved_vertices") == moved);
  CHECK(border_length(smooth) < 0.97 * border_length(raw));
  CHECK(checked(smooth, folder.path()).area > 0.98 * checked(raw, folder.path()).area);
}

TEST_CASE(
    "reconstruct --levels --max-hole: a slit across the seam of two levels is closed, marked and within the "
    "sheet",
    "[pipeline]") {
  const TempFolder folder;
  const std::string in = sheet(folder, 5.0);
  const fs::path raw = folder.path() / "raw.ply", filled = folder.path() / "filled.ply",
                 small = folder.path() / "small.ply";
  std::vector<std::string> more = {"--levels", "3", "--resolution", "0.8"};
  reconstructed(in, raw, more);
  REQUIRE(checked(raw, folder.path()).boundary_loops > 1);
  more.insert(more.end(), {"--max-hole", "600", "--border", "smooth"});
  const Json report = reconstructed(in, filled, more);
  check_levels_used(report);
  check_clean(filled, folder.path());
  const MeshCheck check = checked(filled, folder.path());
  CHECK(check.boundary_loops == 1);
  CHECK(check.area == Approx(3600).epsilon(0.03));
  CHECK(check.max[2] < 0.5);
  CHECK(check.min[2] > -0.5);
  const Json& holes = report.at("mesh").at("holes");
  CHECK(holes.at("filled").get<int>() > 0);
  CHECK(report.at("mesh").at("synthetic_faces") == holes.at("faces"));

  more.insert(more.end(), {"--tolerance", "0.2"});
  const Json decimated = reconstructed(in, small, more);
  CHECK(decimated.at("certificate").at("proven") == true);
  CHECK(checked(small, folder.path()).boundary_loops == 1);
  CHECK(decimated.at("mesh").at("synthetic_faces").get<int>() > 0);
  check_clean(small, folder.path());
}

TEST_CASE("reconstruct --levels with ends: same bytes over tiles, threads, caps, order, processes and kills",
          "[property]") {
  const TempFolder folder;
  const std::string in = sheet(folder, 5.0), reversed = sheet(folder, 5.0, true);
  const fs::path out = folder.path() / "out.ply";
  const std::vector<std::string> base = {"--levels",   "3",   "--resolution", "0.8",
                                         "--max-hole", "600", "--border",     "smooth"};
  const auto bytes = [&](const std::string& from, std::vector<std::string> more) {
    fs::remove(out);
    more.insert(more.end(), base.begin(), base.end());
    reconstructed(from, out, more);
    return file_bytes(out);
  };
  const std::string want = bytes(in, {"-t", "1", "--tile-size", "64", "--memory", "2G"});
  CHECK(bytes(in, {"-t", "2", "--tile-size", "256", "--memory", "2G"}) == want);
  CHECK(bytes(in, {"-t", "4", "--memory", "512M"}) == want);
  CHECK(bytes(in, {"-t", "2", "--processes"}) == want);
  CHECK(bytes(reversed, {"-t", "2"}) == want);
  std::vector<std::string> words = base;
  words.insert(words.end(), {"-t", "2"});
  fs::remove(out);
  REQUIRE(resumed_after_kills(reconstruct_words(in, out, words)).code == 0);
  CHECK(file_bytes(out) == want);
}

TEST_CASE("reconstruct --levels --reference points: every point lies within the tolerance of the result",
          "[pipeline]") {
  const TempFolder folder;
  const std::string in = sheet(folder, 0.0);
  const fs::path out = folder.path() / "out.ply";
  const std::vector<std::string> more = {"--levels",    "3",      "--resolution", "0.8", "--outliers", "off",
                                         "--reference", "points", "--tolerance"};
  const auto with = [&](const std::string& tolerance) {
    std::vector<std::string> words = more;
    words.push_back(tolerance);
    return words;
  };
  const Json report = reconstructed(in, out, with("1"));
  check_levels_used(report);
  CHECK(report.at("samples").at("samples") == 119'000);
  CHECK(report.at("samples").at("certified_max").get<double>() <= 1.0);
  const double noise = report.at("points_to_surface").at("certified_max").get<double>();
  CHECK(noise > 0.02);
  CHECK(report.at("certificate").at("certified_max").get<double>() <= 1.0 - noise);
  fs::remove(out);
  const CommandResult refused = tessera_command(reconstruct_words(in, out, with("0.02")));
  CHECK(refused.code == 6);
  CHECK(refused.errors.find("the least --tolerance that can do is ") != std::string::npos);
}

TEST_CASE("reconstruct --levels --vegetation top: crowns across levels become one skin over the ground",
          "[property]") {
  const TempFolder folder;
  const std::string in = grove(folder);
  const fs::path out = folder.path() / "out.ply";
  const std::vector<std::string> more = {"--levels", "2",      "--resolution", "0.6",
                                         "--radius", "2.2",    "--vegetation", "top",
                                         "--border", "smooth", "--from",       "above"};
  const Json report = reconstructed(in, out, more);
  check_levels_used(report);
  check_clean(out, folder.path());
  const Json top = stage_result(report, "top");
  CHECK(top.at("needed") == true);
  CHECK(report.at("mesh").at("synthetic_faces").get<int>() > 1000);
  // Crowns are in it, and no hole is left that is as wide as one.
  const MeshCheck check = checked(out, folder.path());
  CHECK(check.max[2] > 10.0);
  CHECK(report.at("coverage").at("plan").get<double>() > 0.999);
  const std::string want = file_bytes(out);
  std::vector<std::string> other = more;
  other.insert(other.end(), {"-t", "3", "--tile-size", "64", "--memory", "512M"});
  fs::remove(out);
  reconstructed(grove(folder, true), out, other);
  CHECK(file_bytes(out) == want);

  // One skin, the same way.
  std::vector<std::string> skin = more;
  skin[7] = "auto";
  skin.insert(skin.end(), {"--surface", "ground"});
  fs::remove(out);
  const Json ground = reconstructed(in, out, skin);
  check_clean(out, folder.path());
  CHECK(checked(out, folder.path()).max[2] < 2.0);
  CHECK(ground.at("ground").at("unseen_share").get<double>() < 0.5);
}

}  // namespace level_ends_test
