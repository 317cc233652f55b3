// tessera merge as a user runs it.
#include <catch2/catch.hpp>

#include <algorithm>
#include <csignal>
#include <map>
#include <set>

#include "octree/portable_math.h"
#include "stream/files/json.h"
#include "stream/formats/meshes/mesh_io.h"
#include "tests/helpers/command.h"
#include "tests/helpers/killed_command.h"
#include "tests/helpers/mesh_files.h"
#include "tests/helpers/random.h"
#include "tests/helpers/temp_folder.h"

namespace merge_test {

namespace {

using namespace tessera;
using namespace tessera::test;
namespace fs = std::filesystem;

double height(double x, double y) {
  return 0.6 * sin_cos(0.4 * x).sin + 0.5 * sin_cos(0.3 * y + 0.2 * x).cos;
}

/// Squares of `edge` over [x0, x1] x [0, 20], lifted by `up`.
std::string sheet(double x0, double x1, double edge, double up) {
  const int nx = static_cast<int>((x1 - x0) / edge), ny = static_cast<int>(20.0 / edge);
  std::string text =
      "OFF\n" + std::to_string((nx + 1) * (ny + 1)) + " " + std::to_string(2 * nx * ny) + " 0\n";
  for (int j = 0; j <= ny; ++j)
    for (int i = 0; i <= nx; ++i) {
      const double x = x0 + (x1 - x0) * i / nx, y = 20.0 * j / ny;
      char line[96];
      std::snprintf(line, sizeof line, "%.7g %.7g %.7g\n", x, y, height(x, y) + up);
      text += line;
    }
  for (int j = 0; j < ny; ++j)
    for (int i = 0; i < nx; ++i) {
      const int a = i + (nx + 1) * j, b = a + nx + 1;
      text += "3 " + std::to_string(a) + " " + std::to_string(a + 1) + " " + std::to_string(b + 1) + "\n";
      text += "3 " + std::to_string(a) + " " + std::to_string(b + 1) + " " + std::to_string(b) + "\n";
    }
  return text;
}

struct Borders {
  std::size_t inner = 0, outer = 0, bad = 0;
};

/// Border edges with a vertex within [1, 29] x [1, 19], and all others.
Borders borders_of(const WholeMesh& m) {
  std::map<std::pair<std::uint64_t, std::uint64_t>, int> half_edges;
  for (const MeshFace& f : m.faces)
    for (std::size_t k = 0; k < 3; ++k) ++half_edges[{f[k], f[(k + 1) % 3]}];
  Borders b;
  for (const auto& [edge, n] : half_edges) {
    b.bad += n > 1;
    if (half_edges.count({edge.second, edge.first})) continue;
    bool inner = false;
    for (const std::uint64_t v : {edge.first, edge.second}) {
      const Double3& p = m.points[v];
      inner = inner || (p[0] > 1 && p[0] < 29 && p[1] > 1 && p[1] < 19);
    }
    (inner ? b.inner : b.outer) += 1;
  }
  return b;
}

CommandResult merge(std::vector<std::string> words) {
  words.insert(words.begin(), "merge");
  words.insert(words.end(), {"--no-html", "--progress", "none"});
  return tessera_command(words);
}

}  // namespace

TEST_CASE("merge: sheets that do not match become one, what is far from the joint stays as it is",
          "[pipeline]") {
  const TempFolder folder;
  const std::string a = folder.write("a.off", sheet(0, 16, 0.2, 0.0)).string();
  for (const auto& [edge, up] : {std::pair{0.2, 0.06}, {0.4, 0.0}, {0.1, -0.03}}) {
    CAPTURE(edge, up);
    const std::string b = folder.write("b.off", sheet(12.05, 30, edge, up)).string();
    const std::string out = (folder / "o.ply").string();
    const CommandResult r = merge({a, b, "-o", out, "--force"});
    CAPTURE(r.errors);
    REQUIRE(r.code == 0);
    const WholeMesh mesh = read_whole(out);
    const Borders borders = borders_of(mesh);
    CHECK(borders.inner == 0);
    CHECK(borders.bad == 0);
    CHECK(borders.outer > 100);
    const std::set<Double3> have(mesh.points.begin(), mesh.points.end());
    std::size_t far = 0, lost = 0;
    const auto look = [&](const WholeMesh& original, double low, double high) {
      for (const Double3& p : original.points) {
        if (p[0] < low || p[0] > high) continue;
        ++far;
        lost += have.count(p) == 0;
      }
    };
    look(read_whole(a), -1.0, 10.0);
    look(read_whole(b), 18.0, 31.0);
    CHECK(lost == 0);
    CHECK(far > 5000);
    for (const Double3& p : mesh.points) CHECK(std::fabs(p[2] - height(p[0], p[1])) < 0.1);
  }
}

// A filled loop may close a border edge of an original, which its patch must not go on to call one: a vertex there would be
// numbered twice, and its neighbours get two fans.
TEST_CASE("merge: sheets full of holes, some of them on the joint, become a manifold", "[pipeline]") {
  const TempFolder folder;
  constexpr int kLines = 40;
  constexpr double kEdge = 0.1;
  const auto holed = [&](const char* name, double x0, std::uint64_t seed, double share,
                         const Double3& shift) {
    constexpr int kColumns = 60;
    test::Random random(seed);
    WholeMesh m;
    for (int j = 0; j <= kLines; ++j)
      for (int i = 0; i <= kColumns; ++i) {
        const double x = x0 + kEdge * i;
        m.points.push_back(Double3{x, kEdge * j, 0.3 * sin_cos(x).sin * sin_cos(0.07 * j).cos} + shift);
      }
    for (std::uint64_t j = 0; j < kLines; ++j)
      for (std::uint64_t i = 0; i < kColumns; ++i) {
        const std::uint64_t a = i + (kColumns + 1) * j, b = a + kColumns + 1;
        for (const MeshFace& f : {MeshFace{a, a + 1, b + 1}, MeshFace{a, b + 1, b}})
          if (random.unit() >= share) m.faces.push_back(f);
      }
    m.header.double_positions = true;
    m.header.vertices = m.points.size();
    m.header.faces = m.faces.size();
    write_whole(folder.path() / name, m);
    return (folder.path() / name).string();
  };
  const double share = GENERATE(0.1, 0.2);
  const std::uint64_t seed = GENERATE(range(1, 4));
  CAPTURE(share, seed);
  const std::string out = (folder.path() / "out.ply").string();
  REQUIRE(merge({holed("a.ply", 0.0, seed, share, {0, 0, 0}),
                 holed("b.ply", 4.0, seed + 10, share, {0.033, 0.0231, 0.004}), "-o", out})
              .code == 0);
  const CommandResult check = tessera_command({"check", out, "--strict"});
  CAPTURE(check.errors);
  CHECK(check.code == 0);
}

TEST_CASE("merge: three at one place, the best by word", "[pipeline]") {
  const TempFolder folder;
  const std::string a = folder.write("a.off", sheet(0, 14, 0.25, 0.0)).string(),
                    b = folder.write("b.off", sheet(8, 22, 0.2, 0.05)).string(),
                    c = folder.write("c.off", sheet(12, 30, 0.3, -0.05)).string();
  for (const std::string order : {"a,b", "c", "2,1,3"}) {
    CAPTURE(order);
    const std::string out = (folder / "o.ply").string();
    const CommandResult r = merge({a, b, c, "-o", out, "--force", "--priority", order});
    CAPTURE(r.errors);
    REQUIRE(r.code == 0);
    const Borders borders = borders_of(read_whole(out));
    CHECK(borders.inner == 0);
    CHECK(borders.bad == 0);
  }
}

TEST_CASE("merge: the more confident mesh stays where all of them tell how much they are", "[pipeline]") {
  const TempFolder folder;
  // Ascii PLY; `confidence` of every vertex, none where it is negative.
  const auto with_confidence = [&](const char* name, const std::string& text, double confidence) {
    const WholeMesh mesh = read_whole(folder.write("plain.off", text));
    std::string ply = "ply\nformat ascii 1.0\nelement vertex " + std::to_string(mesh.points.size()) +
                      "\nproperty float x\nproperty float y\nproperty float z\n";
    if (confidence >= 0.0) ply += "property float confidence\n";
    ply += "element face " + std::to_string(mesh.faces.size()) +
           "\nproperty list uchar int vertex_indices\nend_header\n";
    for (const Double3& p : mesh.points) {
      char line[128];
      std::snprintf(line, sizeof line, "%.7g %.7g %.7g", p[0], p[1], p[2]);
      ply += line;
      if (confidence >= 0.0) ply += " " + std::to_string(confidence);
      ply += "\n";
    }
    for (const MeshFace& f : mesh.faces)
      ply += "3 " + std::to_string(f[0]) + " " + std::to_string(f[1]) + " " + std::to_string(f[2]) + "\n";
    return folder.write(name, ply).string();
  };
  const std::string fine = sheet(0, 20, 0.2, 0.0), coarse = sheet(8, 30, 0.4, 0.05);
  struct Case {
    double of_fine, of_coarse;
    std::vector<std::string> more;
    bool fine_stays;
  };
  for (const Case& c : {Case{0.3, 0.9, {}, false},
                        {0.9, 0.3, {}, true},
                        {-1.0, 0.9, {}, true},  // not comparable: the finer one
                        {0.3, 0.9, {"--priority", "a"}, true}}) {
    CAPTURE(c.of_fine, c.of_coarse, c.fine_stays);
    const std::string a = with_confidence("a.ply", fine, c.of_fine),
                      b = with_confidence("b.ply", coarse, c.of_coarse), out = (folder / "o.ply").string();
    std::vector<std::string> words = {a, b, "-o", out, "--force"};
    words.insert(words.end(), c.more.begin(), c.more.end());
    const CommandResult r = merge(words);
    CAPTURE(r.errors);
    REQUIRE(r.code == 0);
    const WholeMesh mesh = read_whole(out);
    CHECK(borders_of(mesh).inner == 0);
    // Vertices in the middle of the overlap are those of the mesh that stays.
    const std::set<Double3> have(mesh.points.begin(), mesh.points.end());
    const auto kept = [&](const WholeMesh& original) {
      std::size_t count = 0;
      for (const Double3& text : original.points) {
        const Double3 p = wide(narrow(text));  // as floats, which the header asks for
        count += p[0] > 13.0 && p[0] < 15.0 && p[1] > 2.0 && p[1] < 18.0 && have.count(p);
      }
      return count;
    };
    CHECK((kept(read_whole(a)) > 500) == c.fine_stays);
    CHECK((kept(read_whole(b)) > 150) == !c.fine_stays);
  }
}

TEST_CASE("merge: the same bytes whatever runs, in any order of inputs, after any kill", "[fault]") {
  const TempFolder folder;
  const std::string a = folder.write("a.off", sheet(0, 16, 0.1, 0.0)).string(),
                    b = folder.write("b.off", sheet(12.05, 30, 0.2, 0.06)).string();
  const std::string first = (folder / "1.ply").string(), again = (folder / "2.ply").string();
  REQUIRE(merge({a, b, "-o", first}).code == 0);
  const std::string bytes = file_bytes(first);
  for (const std::vector<std::string>& how : {std::vector<std::string>{a, b, "-t", "1", "--tile-size", "64"},
                                              {b, a, "-t", "2"},
                                              {a, b, "--memory", "160M"}}) {
    std::vector<std::string> words = how;
    words.insert(words.end(), {"-o", again, "--force"});
    const CommandResult r = merge(words);
    CAPTURE(r.errors);
    REQUIRE(r.code == 0);
    CHECK(file_bytes(again) == bytes);
    if (how[2] == "--memory") CHECK(r.peak_bytes < (std::uint64_t{160} << 20));
  }
  const std::string part = (folder / "3.ply").string();
  REQUIRE(resumed_after_kills({"merge", a, b, "-o", part, "--no-html", "--progress", "none"}).code == 0);
  CHECK(file_bytes(part) == bytes);
}

TEST_CASE("merge: colours go on along the joint", "[pipeline]") {
  const TempFolder folder;
  const auto painted = [&](const char* name, const std::string& text, std::uint32_t rgba) {
    WholeMesh mesh = read_whole(folder.write("plain.off", text));
    mesh.header.vertices = mesh.points.size();
    mesh.header.faces = mesh.faces.size();
    mesh.header.colour = true;
    mesh.rgba.assign(mesh.points.size(), rgba);
    write_whole(folder / name, mesh);
    return (folder / name).string();
  };
  const std::string a = painted("a.ply", sheet(0, 16, 0.2, 0.0), 0xff2040c0u),
                    b = painted("b.ply", sheet(12.05, 30, 0.3, 0.03), 0xff60e010u);
  const std::string out = (folder / "o.ply").string();
  REQUIRE(merge({a, b, "-o", out}).code == 0);
  const WholeMesh mesh = read_whole(out);
  REQUIRE(mesh.rgba.size() == mesh.points.size());
  const std::uint32_t left = read_whole(a).rgba[0], right = read_whole(b).rgba[0];
  std::size_t other = 0;
  for (std::size_t v = 0; v < mesh.rgba.size(); ++v)
    other += mesh.rgba[v] != (mesh.points[v][0] < 14   ? left
                              : mesh.points[v][0] > 18 ? right
                                                       : mesh.rgba[v]) ||
             (mesh.rgba[v] != left && mesh.rgba[v] != right);
  CHECK(other == 0);
}

TEST_CASE("merge: what cannot work is told", "[pipeline]") {
  const TempFolder folder;
  const std::string a = folder.write("a.off", sheet(0, 5, 0.5, 0.0)).string(),
                    b = folder.write("b.off", sheet(25, 30, 0.5, 0.0)).string(),
                    out = (folder / "o.ply").string();
  CHECK(merge({a, "-o", out}).code == 2);
  const CommandResult unknown = merge({a, b, "-o", out, "--priority", "c"});
  CHECK(unknown.code == 2);
  CHECK(unknown.errors.find("none of the meshes") != std::string::npos);
  CHECK(merge({a, b, "-o", out, "--priority", "a,1"}).code == 2);
  CHECK(merge({a, (folder / "none.off").string(), "-o", out}).code == 3);
  // Nothing overlaps: both stay, and it is said.
  const CommandResult apart = merge({a, b, "-o", out});
  CHECK(apart.code == 0);
  CHECK(file_bytes(out + ".report.json").find("no other mesh overlaps it") != std::string::npos);
  CHECK(read_whole(out).faces.size() == 1600);

  const auto said = [&](const std::vector<std::string>& words, int code, const std::string& what) {
    const CommandResult r = merge(words);
    INFO(r.errors);
    CHECK(r.code == code);
    CHECK(r.errors.find(what) != std::string::npos);
    CHECK(std::count(r.errors.begin(), r.errors.end(), '\n') <= 2);
  };
  const std::string none = folder.write("none.off", "OFF\n0 0 0\n").string(),
                    loose = folder.write("loose.off", "OFF\n3 0 0\n0 0 0\n1 0 0\n0 1 0\n").string(),
                    spot = folder.write("spot.off", "OFF\n3 1 0\n1 1 1\n1 1 1\n1 1 1\n3 0 1 2\n").string(),
                    torn = folder.write("torn.ply", "ply\nformat ascii 1.0\nelement vertex 9\n").string();
  said({a, none, "-o", out, "--force"}, 5, "no vertex");
  said({a, loose, "-o", out, "--force"}, 5, "no face");
  said({a, spot, "-o", out, "--force"}, 5, "");
  said({a, torn, "-o", out, "--force"}, 3, "torn.ply");
  said({a, b, "-o", (folder / "o.xyz").string()}, 2, ".ply");
}

TEST_CASE("merge: other units are warned of, far from the origin all is as near it", "[pipeline]") {
  const TempFolder folder;
  const auto moved = [&](const char* name, const std::string& text, double scale, const Double3& by) {
    WholeMesh mesh = read_whole(folder.write("plain.off", text));
    mesh.header.vertices = mesh.points.size();
    mesh.header.faces = mesh.faces.size();
    mesh.header.double_positions = true;
    for (Double3& p : mesh.points)
      for (std::size_t k = 0; k < 3; ++k) p[k] = scale * p[k] + by[k];
    write_whole(folder / name, mesh);
    return (folder / name).string();
  };
  const std::string left = sheet(0, 16, 0.2, 0.0), right = sheet(12.05, 30, 0.2, 0.04),
                    out = (folder / "o.ply").string();
  const CommandResult r = merge(
      {moved("a.ply", left, 1.0, {0, 0, 0}), moved("b.ply", right, 2000.0, {0, 0, 0}), "-o", out, "--force"});
  INFO(r.errors);
  CHECK(r.code == 0);
  CHECK(file_bytes(out + ".report.json").find("are they in the same units?") != std::string::npos);

  const Double3 far = {1e7, -1e7, 2e3};
  REQUIRE(
      merge({moved("a.ply", left, 1.0, far), moved("b.ply", right, 1.0, far), "-o", out, "--force"}).code ==
      0);
  WholeMesh mesh = read_whole(out);
  for (Double3& p : mesh.points) p = p - far;
  const Borders borders = borders_of(mesh);
  CHECK(borders.inner == 0);
  CHECK(borders.bad == 0);
  double worst = 0.0;
  for (const Double3& p : mesh.points) worst = std::max(worst, std::fabs(p[2] - height(p[0], p[1])));
  CHECK(worst < 0.1);
}

}  // namespace merge_test
