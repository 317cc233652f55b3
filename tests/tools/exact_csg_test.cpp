// tessera csg --exact as a command: what it writes, what it refuses, and that nothing but positions decides the bytes.
#include <catch2/catch.hpp>

#include <algorithm>
#include <cmath>
#include <csignal>
#include <set>

#include "octree/placement.h"
#include "stream/files/json.h"
#include "tests/helpers/command.h"
#include "tests/helpers/icosphere.h"
#include "tests/helpers/solid_command.h"
#include "tests/helpers/temp_folder.h"

namespace exact_csg_test {

namespace {

using namespace tessera;
using namespace tessera::test;

WholeMesh box(const Double3& low, const Double3& high, bool as_doubles = true) {
  WholeMesh m;
  for (int c = 0; c < 8; ++c)
    m.points.push_back({c & 1 ? high[0] : low[0], c & 2 ? high[1] : low[1], c & 4 ? high[2] : low[2]});
  m.faces = {{0, 2, 1}, {1, 2, 3}, {4, 5, 6}, {5, 7, 6}, {0, 1, 4}, {1, 5, 4},
             {2, 6, 3}, {3, 6, 7}, {0, 4, 2}, {2, 4, 6}, {1, 3, 5}, {3, 7, 5}};
  m.header.vertices = 8, m.header.faces = 12, m.header.double_positions = as_doubles;
  return m;
}
WholeMesh ball(int level, const Placement& placement) {
  const Icosphere s = icosphere(level);
  WholeMesh m;
  for (const Double3& p : s.positions) m.points.push_back(placement.apply(p));
  for (const auto& f : s.faces) m.faces.push_back({f[0], f[1], f[2]});
  m.header.vertices = m.points.size(), m.header.faces = m.faces.size(), m.header.double_positions = true;
  return m;
}
void reverse_order(WholeMesh& m) {
  std::reverse(m.points.begin(), m.points.end());
  std::reverse(m.faces.begin(), m.faces.end());
  for (MeshFace& f : m.faces)
    f = {m.points.size() - 1 - f[1], m.points.size() - 1 - f[2], m.points.size() - 1 - f[0]};
}
Json report_of(const std::filesystem::path& out) {
  return parse_json(file_bytes(out.string() + ".report.json"), "report");
}

}  // namespace

TEST_CASE("csg --exact: faces away from the cut keep their bits, results are closed and do not cross",
          "[pipeline]") {
  const TempFolder folder;
  Placement placement = rotation(unit(Double3{1, 2, 3}), 33.0);
  placement.shift = {.5, .2, .1};
  const WholeMesh one = ball(4, {}), two = ball(3, placement);
  write_whole(folder / "a.ply", one);
  write_whole(folder / "b.ply", two);
  const std::string a = (folder / "a.ply").string(), b = (folder / "b.ply").string();
  std::set<Double3> given(one.points.begin(), one.points.end());
  given.insert(two.points.begin(), two.points.end());
  std::map<std::string, double> volumes;
  for (const std::string join : {"+", "-", "*"}) {
    CAPTURE(join);
    const auto out = folder / "o.ply";
    REQUIRE(solid_command({"csg", a, join, b, "-o", out.string(), "--exact", "--force"}).code == 0);
    const WholeMesh mesh = read_whole(out);
    CHECK(is_closed(mesh));
    volumes[join] = volume(mesh);
    const Json report = report_of(out).at("mesh");
    std::size_t kept = 0;
    for (const Double3& p : mesh.points) kept += given.contains(p);
    CHECK(mesh.points.size() - kept == report.at("made_vertices").get<std::size_t>());
    CHECK(report.at("kept_faces").get<std::size_t>() > 500);
    CHECK(report.at("cut_faces").get<std::size_t>() > 50);
    CHECK(report.at("components").get<std::size_t>() == 1);
    CHECK(tessera_command({"check", out.string(), "--closed", "--crossings"}).code == 0);
  }
  CHECK(volumes["+"] + volumes["*"] == Approx(volume(one) + volume(two)).epsilon(1e-12));
  CHECK(volumes["-"] + volumes["*"] == Approx(volume(one)).epsilon(1e-12));
}

TEST_CASE("csg --exact: the same bytes for any order of the input, threads, cap and tiles", "[pipeline]") {
  const TempFolder folder;
  Placement placement = rotation(unit(Double3{1, -2, 3}), 71.0);
  placement.shift = {.4, .2, .1};
  WholeMesh one = ball(3, {}), two = ball(3, placement);
  const auto run = [&](const std::vector<std::string>& more) {
    write_whole(folder / "a.ply", one);
    write_whole(folder / "b.obj", two);
    std::vector<std::string> words = {
        "csg", (folder / "a.ply").string(), "-",       (folder / "b.obj").string(),
        "-o",  (folder / "o.ply").string(), "--exact", "--force"};
    words.insert(words.end(), more.begin(), more.end());
    REQUIRE(solid_command(words).code == 0);
    return file_bytes(folder / "o.ply");
  };
  const std::string bytes = run({});
  CHECK(run({"-t", "1", "--memory", "128M"}) == bytes);
  CHECK(run({"-t", "3", "--tile-size", "64"}) == bytes);
  reverse_order(one);
  CHECK(run({}) == bytes);
  reverse_order(two);
  CHECK(run({}) == bytes);
}

TEST_CASE("csg --exact: killed at any moment, the same command ends with the same bytes", "[fault]") {
  const TempFolder folder;
  Placement placement = rotation(unit(Double3{1, -2, 3}), 71.0);
  placement.shift = {.4, .2, .1};
  write_whole(folder / "a.ply", ball(4, {}));
  write_whole(folder / "b.ply", ball(4, placement));
  const auto words = [&](const std::string& out) {
    return std::vector<std::string>{"csg",     (folder / "a.ply").string(),
                                    "-",       (folder / "b.ply").string(),
                                    "-o",      (folder / out).string(),
                                    "--exact", "--no-html",
                                    "-q",      "--progress",
                                    "none"};
  };
  REQUIRE(tessera_command(words("one.ply")).code == 0);
  const std::string bytes = file_bytes(folder / "one.ply");
  int kills = 0;
  for (const char* point : {"commit:1", "commit:2", "commit:3", "commit:4", "write:1", "write:2"}) {
    INFO(point);
    const CommandResult killed = tessera_command(words("two.ply"), 0, std::string("TESSERA_FAULT=") + point);
    kills += killed.code == 128 + SIGKILL;
    // Nothing stands under the output's name before it is whole.
    if (std::filesystem::exists(folder / "two.ply")) CHECK(file_bytes(folder / "two.ply") == bytes);
    const CommandResult r = tessera_command(words("two.ply"));
    INFO(r.errors);
    CHECK(r.code == 0);
    CHECK(file_bytes(folder / "two.ply") == bytes);
    for (const auto& entry : std::filesystem::directory_iterator(folder.path()))
      if (entry.path().filename().string().rfind("two.ply", 0) == 0)
        std::filesystem::remove_all(entry.path());
  }
  CHECK(kills >= 3);
}

TEST_CASE("csg --exact: solids that share faces, edges, corners or all", "[pipeline]") {
  const TempFolder folder;
  write_whole(folder / "a.ply", box({0, 0, 0}, {1, 1, 1}));
  const auto join = [&](const WholeMesh& other, const std::string& word) {
    write_whole(folder / "b.ply", other);
    const CommandResult r =
        solid_command({"csg", (folder / "a.ply").string(), word, (folder / "b.ply").string(), "-o",
                       (folder / "o.ply").string(), "--exact", "--force"});
    if (r.code == 0) CHECK(is_closed(read_whole(folder / "o.ply")));
    return r.code == 0 ? volume(read_whole(folder / "o.ply")) : -r.code;
  };
  CHECK(join(box({1, 0, 0}, {2, 1, 1}), "+") == 2.0);
  CHECK(read_whole(folder / "o.ply").faces.size() == 20);
  CHECK(report_of(folder / "o.ply").at("mesh").at("coplanar_pairs").get<int>() == 2);
  CHECK(join(box({1, 0, 0}, {2, 1, 1}), "*") == -5.0);  // nothing is left
  CHECK(join(box({1, 1, 0}, {2, 2, 1}), "+") == 2.0);
  CHECK(report_of(folder / "o.ply").at("mesh").at("split_vertices").get<int>() == 2);
  CHECK(join(box({1, 1, 1}, {2, 2, 2}), "+") == 2.0);
  CHECK(join(box({0, 0, 0}, {1, 1, 1}), "+") == 1.0);
  CHECK(join(box({0, 0, 0}, {1, 1, 1}), "-") == -5.0);
  CHECK(join(box({0, 0, 0}, {.5, 1, 1}), "-") == .5);
  CHECK(join(box({.25, .25, 0}, {.75, .75, 1}), "-") == .75);
  CHECK(join(box({.25, .25, .25}, {.75, .75, .75}), "-") == .875);
  // A plate that check takes for nothing, and is told.
  CHECK(join(box({0x1p-46, 0, 0}, {2, 1, 1}), "-") == 0x1p-46);
  CHECK(report_of(folder / "o.ply").at("mesh").at("flat_faces").get<int>() >= 8);
  WholeMesh inward = box({.25, .25, 0}, {.75, .75, 1});
  for (MeshFace& f : inward.faces) std::swap(f[1], f[2]);
  CHECK(join(inward, "-") == .75);
  CHECK(report_of(folder / "o.ply").at("mesh").at("warnings").size() == 1);
}

TEST_CASE("csg --exact: a tree of several meshes, moved ones, and formats of floats", "[pipeline]") {
  const TempFolder folder;
  write_whole(folder / "a.stl", box({0, 0, 0}, {4, 1, 1}, false));
  write_whole(folder / "b.ply", box({1, -1, -1}, {2, 2, 2}));
  write_whole(folder / "c.ply", box({1.5, .25, .25}, {5, .75, .75}));
  const std::string a = (folder / "a.stl").string(), b = (folder / "b.ply").string(),
                    c = (folder / "c.ply").string();
  const std::string out = (folder / "o.ply").string();
  REQUIRE(solid_command({"csg", a, "-", "(", b, "+", c, ")", "-o", out, "--exact"}).code == 0);
  CHECK(volume(read_whole(out)) == Approx(4.0 - 1.0 - 2.0 * .25).epsilon(1e-14));
  REQUIRE(solid_command({"csg", a, "-", b, "-o", out, "--exact", "--force"}).code == 0);
  CHECK_FALSE(read_whole(out).header.double_positions);
  const std::string scene =
      folder
          .write("s.json", R"({"difference": [{"mesh": "a.stl"}, {"mesh": "b.ply", "translate": [2, 0, 0],
                                 "scale": [-1, 1, 1]}]})")
          .string();
  REQUIRE(solid_command({"csg", scene, "-o", out, "--exact", "--force"}).code == 0);
  CHECK(volume(read_whole(out)) == 3.0);
  CHECK(solid_command({"csg", scene, "-o", (folder / "o.stl").string(), "--exact"}).code == 2);
  REQUIRE(solid_command({"csg", a, "-", b, "-o", (folder / "p.stl").string(), "--exact"}).code == 0);
  CHECK(volume(read_whole(folder / "p.stl")) == 3.0);
}

TEST_CASE("csg --exact: what it cannot take is refused in one sentence, and nothing is written",
          "[pipeline]") {
  const TempFolder folder;
  write_whole(folder / "a.ply", box({0, 0, 0}, {1, 1, 1}));
  WholeMesh open = box({0, 0, 0}, {1, 1, 1});
  open.faces.pop_back(), open.header.faces = 11;
  write_whole(folder / "open.ply", open);
  WholeMesh crossing = box({0, 0, 0}, {1, 1, 1});
  const WholeMesh more = box({.5, .5, .5}, {2, 2, 2});
  crossing.points.insert(crossing.points.end(), more.points.begin(), more.points.end());
  for (const MeshFace& f : more.faces) crossing.faces.push_back({f[0] + 8, f[1] + 8, f[2] + 8});
  crossing.header.vertices = 16, crossing.header.faces = 24;
  write_whole(folder / "crossing.ply", crossing);
  const auto refused = [&](const std::vector<std::string>& words, const std::string& said) {
    std::vector<std::string> all = words;
    all.insert(all.end(), {"-o", (folder / "x.ply").string(), "--exact"});
    const CommandResult r = solid_command(all);
    CAPTURE(r.errors);
    CHECK(r.errors.find(said) != std::string::npos);
    CHECK_FALSE(std::filesystem::exists(folder / "x.ply"));
    return r.code;
  };
  const std::string a = (folder / "a.ply").string();
  CHECK(refused({"csg", a, "-", (folder / "open.ply").string()}, "not closed") == 3);
  CHECK(refused({"csg", (folder / "crossing.ply").string(), "+", a, "--force"}, "cross, overlap or touch") ==
        3);
  CHECK(refused({"csg", a, "-", a, "--force"}, "nothing is left") == 5);
  CHECK(refused({"csg", a, "-", a, "--resolution", "0.1"}, "--resolution") == 2);
  CHECK(refused({"csg",
                 folder.write("s.json", R"({"union": [{"mesh": "a.ply"}, {"sphere": [0,0,0,1]}]})").string()},
                "shapes") == 2);
  write_whole(folder / "large.ply", ball(7, {}));
  CHECK(refused({"csg", a, "-", (folder / "large.ply").string(), "--memory", "64M"}, "memory cap") == 4);
}

}  // namespace exact_csg_test
