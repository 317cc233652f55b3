// Smoothing makes no faces cross that did not: vertices go back as far as it takes.
#include <catch2/catch.hpp>

#include <algorithm>
#include <cmath>

#include "stream/files/json.h"
#include "stream/stages/smooth/contact_regions.h"
#include "stream/stages/smooth/vertices_back.h"
#include "tests/helpers/command.h"
#include "tests/helpers/killed_command.h"
#include "tests/helpers/mesh_files.h"
#include "tests/helpers/surfaces.h"
#include "tests/helpers/temp_folder.h"

namespace untangle_test {

namespace {

using namespace tessera;
using namespace tessera::test;
namespace fs = std::filesystem;

void append(WholeMesh& to, const Surface& s, const Double3& by) {
  const auto first = static_cast<std::uint64_t>(to.points.size());
  for (const Double3& p : s.position) to.points.push_back(p + by);
  for (const auto& f : s.faces) to.faces.push_back({first + f[0], first + f[1], first + f[2]});
}

/// A coarse sheet with pits one vertex wide, and a fine funnel in each that keeps clear of it: the pits fill up, the funnels stay
/// where they are.
WholeMesh pits() {
  constexpr int kPits = 14, kApart = 6;
  WholeMesh mesh;
  const auto pit = [](double x) { return std::fmod(x + 0.5, kApart) < 1.0 && x > 1.0; };
  const auto funnel = [](double x, double y) {
    return 8.0 * std::max(std::fabs(x - 0.15), std::fabs(y - 0.15)) - 0.55;
  };
  append(mesh,
         height_grid(kPits * kApart + kApart, kPits * kApart + kApart,
                     [&](double x, double y) { return pit(x) && pit(y) ? -1.0 : 0.0; }),
         {0, 0, 0});
  for (int i = 1; i <= kPits; ++i)
    for (int j = 1; j <= kPits; ++j)
      append(mesh, height_grid(6, 0.3, funnel), {kApart * i - 0.15, kApart * j - 0.15, 0});
  mesh.header.vertices = mesh.points.size();
  mesh.header.faces = mesh.faces.size();
  return mesh;
}

/// The same with funnels that stand on the bottoms of their pits: one vertex has two fans there.
WholeMesh standing_funnels() {
  constexpr int kPits = 4, kApart = 6, kEdge = kPits * kApart + kApart;
  WholeMesh mesh;
  const auto pit = [](double x) { return std::fmod(x + 0.5, kApart) < 1.0 && x > 1.0; };
  append(mesh, height_grid(kEdge, kEdge, [&](double x, double y) { return pit(x) && pit(y) ? -1.0 : 0.0; }),
         {});
  const auto at = [&](const Double3& p, std::size_t first) {
    for (std::size_t v = first; v < mesh.points.size(); ++v)
      if (norm(mesh.points[v] - p) < 1e-6) return static_cast<std::uint64_t>(v);
    FAIL("no vertex there");
    return std::uint64_t{0};
  };
  for (int i = 1; i <= kPits; ++i)
    for (int j = 1; j <= kPits; ++j) {
      const Double3 foot = {double{kApart} * i, double{kApart} * j, -1.0};
      const std::size_t first = mesh.points.size(), first_face = mesh.faces.size();
      append(mesh,
             height_grid(6, 0.3,
                         [](double x, double y) {
                           return 8.0 * std::max(std::fabs(x - 0.15), std::fabs(y - 0.15)) - 1.0;
                         }),
             {foot[0] - 0.15, foot[1] - 0.15, 0});
      const std::uint64_t tip = at(foot, first), bottom = at(foot, 0);
      for (std::size_t f = first_face; f < mesh.faces.size(); ++f)
        std::replace(mesh.faces[f].begin(), mesh.faces[f].end(), tip, bottom);
    }
  mesh.header.vertices = mesh.points.size();
  mesh.header.faces = mesh.faces.size();
  return mesh;
}

/// Pairs that cross, overlap or touch.
std::uint64_t crossings_of(const fs::path& mesh) {
  const fs::path report = mesh.string() + ".check.json";
  REQUIRE(
      tessera_command({"check", mesh.string(), "--crossings", "--report", report.string(), "--force"}).code ==
      0);
  const auto c = parse_json(file_bytes(report)).at("crossings");
  return c.at("cross").get<std::uint64_t>() + c.at("overlap").get<std::uint64_t>() +
         c.at("touch").get<std::uint64_t>();
}

Json report_of(const fs::path& out) {
  return parse_json(file_bytes(out.string() + ".report.json"));
}

}  // namespace

TEST_CASE("untangle: smoothing makes no faces cross, the same bytes whatever runs", "[property]") {
  const TempFolder folder;
  const fs::path in = folder / "in.ply", out = folder / "out.ply";
  write_whole(in, pits());
  REQUIRE(crossings_of(in) == 0);
  const auto run = [&](std::vector<std::string> more) {
    more.insert(more.end(), {"--feature-angle", "0", "--force", "--progress", "none", "-q"});
    more.insert(more.begin(), {"smooth", in.string(), "-o", out.string()});
    const CommandResult r = tessera_command(more);
    INFO(r.errors);
    REQUIRE(r.code == 0);
    return file_bytes(out);
  };
  const std::string kept = run({"--crossings", "keep", "-t", "1"});
  CHECK(crossings_of(out) > 500);
  const auto kept_rms = report_of(out).at("mesh").at("rms_move").get<double>();
  const std::string bytes = run({"-t", "1"});
  CHECK(bytes != kept);
  CHECK(crossings_of(out) == 0);
  const auto mesh = report_of(out).at("mesh");
  CHECK(mesh.at("crossing_pairs_found") > 500);
  CHECK(mesh.at("crossing_pairs") == 0);
  CHECK(mesh.at("taken_back") >= 14 * 14);
  CHECK(mesh.at("rms_move").get<double>() < 0.98 * kept_rms);
  CHECK(run({"-t", "2", "--tile-size", "64", "--memory", "160M"}) == bytes);
  CHECK(run({"-t", "2", "--tile-size", "128", "--processes"}) == bytes);
}

TEST_CASE("untangle: fans of one vertex do not come to cross each other", "[pipeline]") {
  const TempFolder folder;
  const fs::path in = folder / "in.ply", out = folder / "out.ply";
  write_whole(in, standing_funnels());
  REQUIRE(crossings_of(in) == 0);
  const auto run = [&](const std::string& crossings) {
    REQUIRE(tessera_command({"smooth", in.string(), "-o", out.string(), "--feature-angle", "0", "--force",
                             "-q", "--crossings", crossings})
                .code == 0);
  };
  run("keep");
  CHECK(crossings_of(out) > 50);
  run("refuse");
  CHECK(report_of(out).at("mesh").at("crossing_pairs") == 0);
  const fs::path report = folder / "welded.json";
  REQUIRE(
      tessera_command({"check", out.string(), "--crossings", "--weld", "--report", report.string()}).code ==
      0);
  const Json pairs = parse_json(file_bytes(report)).at("crossings");
  CHECK(pairs.at("cross") == 0);
  CHECK(pairs.at("overlap") == 0);
}

TEST_CASE("untangle: killed at any moment, the same command ends with the same bytes", "[fault]") {
  const TempFolder folder;
  const fs::path in = folder / "in.ply", one = folder / "one.ply", two = folder / "two.ply";
  write_whole(in, pits());
  std::vector<std::string> words = {"smooth", in.string(), "-o",          one.string(), "--feature-angle",
                                    "0",      "-q",        "--tile-size", "64"};
  REQUIRE(tessera_command(words).code == 0);
  words[3] = two.string();
  CHECK(resumed_after_kills(words).code == 0);
  CHECK(file_bytes(two) == file_bytes(one));
}

TEST_CASE("untangle: faces that the mesh has crossing stay as smoothing leaves them", "[pipeline]") {
  const TempFolder folder;
  const fs::path in = folder / "in.ply", out = folder / "out.ply";
  WholeMesh mesh;
  append(mesh, height_grid(40, 4.0, [](double x, double y) { return 0.1 * std::sin(9.0 * x + 5.0 * y); }),
         {});
  append(mesh, height_grid(40, 4.0, [](double x, double) { return 0.3 * (x - 2.03); }), {});
  mesh.header.vertices = mesh.points.size();
  mesh.header.faces = mesh.faces.size();
  write_whole(in, mesh);
  const auto run = [&](const std::string& crossings) {
    REQUIRE(tessera_command({"smooth", in.string(), "-o", out.string(), "--lambda", "0.2", "--force", "-q",
                             "--crossings", crossings})
                .code == 0);
    return file_bytes(out);
  };
  const std::uint64_t before = crossings_of(in);
  REQUIRE(before > 50);
  const std::string kept = run("keep");
  CHECK(run("refuse") != kept);
  CHECK(report_of(out).at("mesh").at("crossing_pairs_found") > 0);
  CHECK(report_of(out).at("mesh").at("crossing_pairs") == 0);
  const std::uint64_t left = crossings_of(out);
  CHECK(left <= before);
  CHECK(left > before / 2);
  double moved = 0.0;
  const WholeMesh is = read_whole(out);
  for (std::size_t v = 0; v < is.points.size(); ++v)
    moved += norm(is.points[v] - mesh.points[v]) > 1e-6 ? 1.0 : 0.0;
  CHECK(moved > 0.3 * static_cast<double>(is.points.size()));
}

TEST_CASE("vertices back: half the way, three quarters, all of it, by key", "[unit]") {
  const TempFolder folder;
  const auto save = [&](const std::string& name, std::vector<VertexBack> found) {
    VerticesBack::save(folder / name, found);
    return std::vector<fs::path>{folder / name};
  };
  MeshBlock block;
  for (const std::uint64_t key : {3, 5, 8, 9}) {
    block.key.push_back(key), block.position.push_back({4, 0, static_cast<double>(key)});
  }
  const VertexBack three{3, {4, 0, 3}, {0, 0, 3}}, five{5, {4, 0, 5}, {0, 0, 5}},
      nine{9, {4, 0, 9}, {0, 0, 9}}, elsewhere{7, {1, 1, 1}, {0, 0, 7}};
  const VerticesBack back(
      {save("1", {nine, five, nine}), save("2", {nine, three, elsewhere}), save("3", {nine})});
  CHECK(back.size() == 4);
  REQUIRE(back.last().size() == 1);
  CHECK(back.last()[0] == nine.at);
  const auto moved = back.apply(block, false);
  REQUIRE(moved.size() == 3);
  CHECK(moved[0] == std::pair<std::uint32_t, Double3>{0, {4, 0, 3}});
  CHECK(moved[1] == std::pair<std::uint32_t, Double3>{1, {4, 0, 5}});
  CHECK(moved[2] == std::pair<std::uint32_t, Double3>{3, {4, 0, 9}});
  CHECK(block.position[0] == Double3{2, 0, 3});
  CHECK(block.position[1] == Double3{2, 0, 5});
  CHECK(block.position[2] == Double3{4, 0, 8});
  CHECK(block.position[3] == Double3{0, 0, 9});
  CHECK(VerticesBack().empty());
}

TEST_CASE("contact regions: where own faces of tiles meet and where tiles overlap, nothing else", "[unit]") {
  const TempFolder folder;
  MeshBlock block;
  const auto add = [&](const Double3& a, const Double3& b, const Double3& c) {
    const auto first = static_cast<std::uint32_t>(block.position.size());
    for (const Double3& p : {a, b, c}) block.key.push_back(block.key.size()), block.position.push_back(p);
    block.faces.push_back({first, first + 1, first + 2});
    block.face_flags.push_back(kFaceBorder01 | kFaceBorder12 | kFaceBorder20);
  };
  add({0, 0, 0}, {4, 0, 0}, {0, 4, 0});
  add({1, 1, -1}, {1, 1, 1}, {2, 1, 1});
  add({9, 9, 0}, {10, 9, 0}, {9, 10, 0});
  add({20, 9, 0}, {22, 9, 0}, {20, 10, 0});
  const MeshBox whole = {{0, 0, -1}, {22, 10, 1}};
  const auto regions = [&](const std::vector<SearchedTile>& tiles) {
    save_searched(folder / "1.met", tiles);
    return ContactRegions({folder / "1.met"}).faces(block, whole);
  };
  using Faces = std::vector<std::uint8_t>;
  const auto search = [&](const Faces& core) {
    std::vector<MeshBox> patches;
    for (std::size_t f = 0; f < core.size(); ++f)
      if (core[f] != 0) patches.push_back(box_around(std::span(block.position).subspan(3 * f, 3)));
    return search_tile(block, core, patches);
  };
  const SearchedTile all = search(Faces{1, 1, 1, 1});
  CHECK(all.contacts.size() == 1);
  CHECK(regions({all}) == Faces{1, 1, 0, 0});
  const SearchedTile one = search(Faces{1, 0, 1, 0}), other = search(Faces{0, 1, 0, 1});
  CHECK(one.contacts.empty());
  CHECK(other.contacts.empty());
  CHECK(regions({one}) == Faces{0, 0, 0, 0});
  CHECK(regions({one, other}) == Faces{1, 1, 0, 0});
  CHECK(regions({unsearched_tile(std::vector<Double3>{{9, 9, -1}, {30, 9.5, 1}})}) == Faces{0, 0, 1, 1});
  CHECK_THROWS_WITH(ContactRegions(std::vector<fs::path>{}), Catch::Contains("run again with --force"));
}

}  // namespace untangle_test
