// Faces that cross are cut out and the holes closed anew: what the mesh has as given (--crossings repair), and what comes up where
// no block sees it.
#include <catch2/catch.hpp>

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <set>

#include "stream/files/json.h"
#include "tests/helpers/command.h"
#include "tests/helpers/killed_command.h"
#include "tests/helpers/mesh_files.h"
#include "tests/helpers/random.h"
#include "tests/helpers/shell.h"
#include "tests/helpers/skip.h"
#include "tests/helpers/surfaces.h"
#include "tests/helpers/temp_folder.h"

namespace mend_crossings_test {

namespace {

using namespace tessera;
using namespace tessera::test;
namespace fs = std::filesystem;

constexpr int kSide = 90, kApart = 15;

void append(WholeMesh& to, const Surface& s) {
  const auto first = static_cast<std::uint64_t>(to.points.size());
  to.points.insert(to.points.end(), s.position.begin(), s.position.end());
  for (const auto& f : s.faces) to.faces.push_back({first + f[0], first + f[1], first + f[2]});
}

double hills(double x, double y) {
  return 0.8 * std::sin(0.6 * x) * std::cos(0.5 * y);
}

/// Two hilly sheets a unit apart; spikes of the lower one reach through the upper one, in rows.
WholeMesh spikes(bool spiked = true) {
  WholeMesh mesh;
  Surface low = height_grid(kSide, kSide, hills);
  Surface high = low;
  for (Double3& p : high.position) p[2] += 1.0;
  if (spiked)
    for (int j = kApart; j < kSide; j += kApart)
      for (int i = kApart; i < kSide; i += kApart)
        low.position[static_cast<std::size_t>(j * (kSide + 1) + i)][2] += 2.3;
  append(mesh, low);
  append(mesh, high);
  mesh.header.vertices = mesh.points.size();
  mesh.header.faces = mesh.faces.size();
  return mesh;
}
constexpr int kSpikes = (kSide / kApart - 1) * (kSide / kApart - 1);

/// All digits of doubles.
void spill_off(const fs::path& path, const Surface& s) {
  std::string text =
      "OFF " + std::to_string(s.position.size()) + " " + std::to_string(s.faces.size()) + " 0\n";
  for (const Double3& p : s.position)
    text += dump_json(Json(p[0])) + " " + dump_json(Json(p[1])) + " " + dump_json(Json(p[2])) + "\n";
  for (const auto& f : s.faces)
    text += "3 " + std::to_string(f[0]) + " " + std::to_string(f[1]) + " " + std::to_string(f[2]) + "\n";
  spill(path, text);
}

/// Tubes along figures of eight, each through itself and the next one. Positions are floats.
WholeMesh knots(int count) {
  constexpr int kAlong = 160, kAround = 16;
  constexpr double kPi = 3.14159265358979323846;
  WholeMesh mesh;
  for (int n = 0; n < count; ++n) {
    Surface tube;
    const auto curve = [&](int i) {
      const double a = 2.0 * kPi * i / kAlong;
      return Double3{20.0 * std::sin(a) + 31.0 * n, 10.0 * std::sin(2.0 * a), std::cos(a) + 0.37 * n};
    };
    for (int i = 0; i < kAlong; ++i) {
      const Double3 u = unit(curve(i + 1) - curve(i)), side = unit(cross(u, Double3{.31, .17, 1.0})),
                    up = cross(side, u);
      for (int k = 0; k < kAround; ++k) {
        const double a = 2.0 * kPi * k / kAround;
        Double3 p = curve(i) + side * (3.0 * std::cos(a)) + up * (3.0 * std::sin(a));
        for (double& x : p) x = static_cast<double>(static_cast<float>(x));
        tube.position.push_back(p);
      }
    }
    const auto at = [&](int i, int k) {
      return static_cast<std::uint32_t>(i % kAlong * kAround + k % kAround);
    };
    for (int i = 0; i < kAlong; ++i)
      for (int k = 0; k < kAround; ++k) {
        tube.faces.push_back({at(i, k), at(i + 1, k), at(i + 1, k + 1)});
        tube.faces.push_back({at(i, k), at(i + 1, k + 1), at(i, k + 1)});
      }
    append(mesh, tube);
  }
  mesh.header.vertices = mesh.points.size();
  mesh.header.faces = mesh.faces.size();
  return mesh;
}

/// The sides of cells that lie on no other one, under a map of their corners.
template <class Map>
void append_cells(WholeMesh& to, const std::set<std::array<int, 3>>& cells, const Map& map) {
  std::map<std::array<int, 3>, std::uint64_t> number;
  for (const auto& cell : cells)
    for (std::size_t a = 0; a < 3; ++a)
      for (const int side : {0, 1}) {
        std::array<int, 3> beside = cell;
        beside[a] += 2 * side - 1;
        if (cells.count(beside) != 0) continue;
        std::array<std::uint64_t, 4> c{};
        for (std::size_t k = 0; k < 4; ++k) {
          std::array<int, 3> at = cell;
          const std::size_t i = side == 1 ? k : 3 - k;
          at[a] += side;
          at[(a + 1) % 3] += i == 1 || i == 2;
          at[(a + 2) % 3] += i >= 2;
          const auto [it, fresh] = number.try_emplace(at, to.points.size());
          if (fresh) to.points.push_back(map(at));
          c[k] = it->second;
        }
        to.faces.push_back({c[0], c[1], c[2]});
        to.faces.push_back({c[0], c[2], c[3]});
      }
}

/// A plate with cubes under it as on a chess board, so that four faces meet at each edge between two of them, with a box through the
/// plate beside them. It lies askew, so that blocks part it anyhow.
WholeMesh hung_plate() {
  constexpr int kCells = 30, kHung = 20;
  std::set<std::array<int, 3>> plate, box;
  for (int i = 0; i < kCells; ++i)
    for (int j = 0; j < kCells; ++j) {
      plate.insert({i, j, 1});
      if (i < kHung && (i + j) % 2 == 0) plate.insert({i, j, 0});
      if (i < 6 && j < kCells - 2) box.insert({i, j, 0}), box.insert({i, j, 1});
    }
  const auto askew = [](double x, double y, double z) {
    const double u = x * std::cos(0.5) - y * std::sin(0.5), v = x * std::sin(0.5) + y * std::cos(0.5);
    Double3 p = {u, v * std::cos(0.6) - z * std::sin(0.6), v * std::sin(0.6) + z * std::cos(0.6)};
    for (double& c : p) c = static_cast<double>(static_cast<float>(c));
    return p;
  };
  WholeMesh mesh;
  append_cells(mesh, plate, [&](const std::array<int, 3>& c) { return askew(c[0], c[1], c[2]); });
  append_cells(mesh, box, [&](const std::array<int, 3>& c) {
    return askew(kHung + 2.3 + 0.9 * c[0], 1.3 + 0.95 * c[1], 1.4 + 0.9 * c[2]);
  });
  mesh.header.vertices = mesh.points.size();
  mesh.header.faces = mesh.faces.size();
  return mesh;
}

Json check_of(const fs::path& mesh) {
  const fs::path report = mesh.string() + ".check.json";
  REQUIRE(
      tessera_command({"check", mesh.string(), "--crossings", "--report", report.string(), "--force"}).code ==
      0);
  return parse_json(file_bytes(report));
}
std::uint64_t pairs_of(const fs::path& mesh) {
  const Json c = check_of(mesh).at("crossings");
  return c.at("cross").get<std::uint64_t>() + c.at("overlap").get<std::uint64_t>() +
         c.at("touch").get<std::uint64_t>();
}
Json report_of(const fs::path& out) {
  return parse_json(file_bytes(out.string() + ".report.json"));
}

/// What is in both, of what is in the first: vertices by place.
std::size_t kept_points(const fs::path& before, const fs::path& after) {
  const WholeMesh was = read_whole(before), is = read_whole(after);
  const std::set<Double3> there(is.points.begin(), is.points.end());
  return static_cast<std::size_t>(std::count_if(was.points.begin(), was.points.end(),
                                                [&](const Double3& p) { return there.count(p) != 0; }));
}

std::vector<std::string> repair(const std::string& command, const fs::path& in, const fs::path& out) {
  std::vector<std::string> words = {command, in.string(), "-o", out.string(), "--crossings", "repair", "-q"};
  const std::vector<std::string> more =
      command == "smooth"
          ? std::vector<std::string>{"--method", "laplacian", "--steps", "1", "--lambda", "0.01"}
      : command == "remesh" ? std::vector<std::string>{"--edge", "1.1"}
                            : std::vector<std::string>{"--tolerance", "1e-6"};
  words.insert(words.end(), more.begin(), more.end());
  words.insert(words.end(), {"--no-html", "--progress", "none"});
  return words;
}

}  // namespace

TEST_CASE("mend: --crossings repair leaves none and keeps all else, the same bytes whatever runs",
          "[property]") {
  const TempFolder folder;
  const fs::path in = folder / "in.ply", out = folder / "out.ply";
  write_whole(in, spikes());
  REQUIRE(pairs_of(in) >= 4 * kSpikes);
  const auto run = [&](std::vector<std::string> more) {
    std::vector<std::string> words = repair("decimate", in, out);
    words.push_back("--force");
    words.insert(words.end(), more.begin(), more.end());
    const CommandResult r = tessera_command(words);
    INFO(r.errors);
    REQUIRE(r.code == 0);
    return file_bytes(out);
  };
  const std::string bytes = run({"-t", "1"});
  CHECK(pairs_of(out) == 0);
  const Json input = report_of(out).at("crossings").at("input");
  CHECK(input.at("crossing_pairs") >= 4 * kSpikes);
  CHECK(input.at("mended_groups") == kSpikes);
  CHECK(input.at("left_pairs") == 0);
  // The curved sheets stay at that tolerance, but for the spikes and a ring or two around them.
  CHECK(kept_points(in, out) > spikes().points.size() - 40 * kSpikes);
  const Json check = check_of(out);
  CHECK(check.at("components") == 2);
  CHECK(run({"-t", "2", "--tile-size", "64", "--memory", "160M"}) == bytes);
  CHECK(run({"-t", "2", "--processes"}) == bytes);
}

TEST_CASE("mend: killed at any moment, the same command ends with the same bytes", "[fault]") {
  const TempFolder folder;
  const fs::path in = folder / "in.ply", one = folder / "one.ply", two = folder / "two.ply";
  write_whole(in, spikes());
  REQUIRE(tessera_command(repair("smooth", in, one)).code == 0);
  CHECK(resumed_after_kills(repair("smooth", in, two)).code == 0);
  CHECK(file_bytes(two) == file_bytes(one));
  CHECK(pairs_of(two) == 0);
}

TEST_CASE("mend: remesh repairs too, and a mesh without crossings keeps its bytes", "[pipeline]") {
  const TempFolder folder;
  const fs::path in = folder / "in.ply", clean = folder / "clean.ply", out = folder / "out.ply";
  write_whole(in, spikes());
  REQUIRE(tessera_command(repair("remesh", in, out)).code == 0);
  CHECK(pairs_of(out) == 0);
  write_whole(clean, spikes(false));
  for (const std::string command : {"decimate", "smooth", "remesh"}) {
    std::vector<std::string> words = repair(command, clean, out);
    words.push_back("--force");
    INFO(command);
    REQUIRE(tessera_command(words).code == 0);
    const WholeMesh repaired = read_whole(out);
    words[5] = "refuse";
    REQUIRE(tessera_command(words).code == 0);
    const WholeMesh as_ever = read_whole(out);
    CHECK(as_ever.points == repaired.points);
    CHECK(as_ever.faces == repaired.faces);
  }
}

TEST_CASE("mend: bodies that pass through each other or themselves are united, the same bytes whatever runs",
          "[property]") {
  const TempFolder folder;
  const fs::path in = folder / "in.ply", out = folder / "out.ply";
  write_whole(in, knots(1));
  REQUIRE(pairs_of(in) > 100);
  const auto run = [&](const std::string& command, std::vector<std::string> more) {
    std::vector<std::string> words = repair(command, in, out);
    words.push_back("--force");
    words.insert(words.end(), more.begin(), more.end());
    const CommandResult r = tessera_command(words);
    INFO(r.errors);
    REQUIRE(r.code == 0);
    return file_bytes(out);
  };
  for (const std::string command : {"smooth", "decimate"}) {
    const std::string bytes = run(command, {"-t", "1"});
    CHECK(pairs_of(out) == 0);
    CHECK(check_of(out).at("solid") == true);
    CHECK(check_of(out).at("components") == 1);
    const Json input = report_of(out).at("crossings").at("input");
    CHECK(input.at("left_pairs") == 0);
    CHECK(input.at("united").at("pairs") == input.at("crossing_pairs"));
    CHECK(input.at("united").at("inner_faces") > 20);
    // All that is off the crossings keeps its place to the bit, where nothing is smoothed.
    if (command == "decimate") CHECK(kept_points(in, out) > knots(1).points.size() * 8 / 10);
    CHECK(run(command, {"-t", "2", "--tile-size", "64", "--memory", "160M"}) == bytes);
    CHECK(run(command, {"-t", "2", "--processes"}) == bytes);
  }
}

TEST_CASE("mend: a job that unites bodies and is killed at any moment ends with the same bytes", "[fault]") {
  const TempFolder folder;
  const fs::path in = folder / "in.ply", one = folder / "one.ply", two = folder / "two.ply";
  write_whole(in, knots(3));
  REQUIRE(tessera_command(repair("smooth", in, one)).code == 0);
  CHECK(resumed_after_kills(repair("smooth", in, two)).code == 0);
  CHECK(file_bytes(two) == file_bytes(one));
  CHECK(pairs_of(two) == 0);
}

TEST_CASE("mend: what was taken apart and is joined by uniting moves as one", "[pipeline]") {
  const TempFolder folder;
  const fs::path in = folder / "in.ply", out = folder / "out.ply";
  write_whole(in, hung_plate());
  std::vector<std::string> words = {"remesh", in.string(), "-o", out.string()};
  for (const char* more : {"--crossings", "repair", "--edge", "0.7", "--feature-angle", "0", "--block-faces",
                           "1024", "-q", "--no-html", "--progress", "none"})
    words.emplace_back(more);
  const CommandResult r = tessera_command(words);
  INFO(r.errors);
  REQUIRE(r.code == 0);
  CHECK(report_of(out).at("crossings").at("input").at("united").at("pairs").get<std::uint64_t>() > 100);
  CHECK(read_whole(out).faces.size() > 5 * 1024);
  CHECK(check_of(out).at("boundary_edges").get<std::uint64_t>() == 0);
}

TEST_CASE("mend: an open surface that passes through another one is refused with the reason", "[pipeline]") {
  const TempFolder folder;
  const fs::path in = folder / "in.ply", out = folder / "out.ply";
  WholeMesh mesh;
  append(mesh, height_grid(30, 30, hills));
  Surface wall = height_grid(30, 30, hills);
  for (Double3& p : wall.position) p = {p[0], 15.03 + p[2], p[1] - 15.01};
  append(mesh, wall);
  mesh.header.vertices = mesh.points.size();
  mesh.header.faces = mesh.faces.size();
  write_whole(in, mesh);
  const std::uint64_t before = pairs_of(in);
  REQUIRE(before > 50);
  for (const std::string command : {"smooth", "decimate", "remesh"}) {
    const CommandResult r = tessera_command(repair(command, in, out));
    INFO(r.errors);
    CHECK(r.code == 6);
    CHECK(r.errors.find(std::to_string(before) + " pairs of faces") != std::string::npos);
    CHECK(r.errors.find("is not closed there") != std::string::npos);
    CHECK(r.errors.find("tessera resurface") != std::string::npos);
    CHECK(!fs::exists(out));
    fs::remove_all(out.string() + ".tessera");
  }
}

TEST_CASE("mend: copies of vertices that were taken apart stay, and are told", "[pipeline]") {
  const TempFolder folder;
  const fs::path in = folder / "in.off", out = folder / "out.ply";
  // Three walls along one edge.
  spill(in,
        "OFF 8 6 0\n0 0 0\n0 0 1\n1 0 0\n1 0 1\n-1 1 0\n-1 1 1\n-1 -1 0\n-1 -1 1\n"
        "3 0 2 3\n3 0 3 1\n3 0 1 5\n3 0 5 4\n3 0 1 7\n3 0 7 6\n");
  REQUIRE(pairs_of(in) == 0);
  std::vector<std::string> words = repair("smooth", in, out);
  words.erase(std::find(words.begin(), words.end(), "-q"));
  const CommandResult r = tessera_command(words);
  INFO(r.errors);
  REQUIRE(r.code == 0);
  const Json input = report_of(out).at("crossings").at("input");
  CHECK(input.at("crossing_pairs") == 0);
  CHECK(input.at("touching_in_copies") > 0);
  CHECK(r.errors.find("touch in copies of vertices alone") != std::string::npos);
}

TEST_CASE("mend: remesh leaves sheets that are nearer than floats tell apart as they are", "[pipeline]") {
  const TempFolder folder;
  const fs::path in = folder / "in.off";
  // Six faces, oblique: two sheets that share their outline.
  const auto body = [&](double thickness, bool with_ball) {
    Surface s;
    for (const Double3& p :
         {Double3{0, 0, 0}, {1, 0, 0}, {.3, .9, 0}, {.4, .3, thickness}, {.45, .28, -thickness}})
      s.position.push_back({1000 + p[0] + .3 * p[2] + .1 * p[1], 1000 + .97 * p[1] + .17 * p[0],
                            1000 + p[2] + .31 * p[0] + .77 * p[1]});
    s.faces = {{0, 1, 3}, {1, 2, 3}, {2, 0, 3}, {1, 0, 4}, {2, 1, 4}, {0, 2, 4}};
    if (with_ball) {
      Surface ball = sphere(4, 5.0);
      for (auto& f : ball.faces)
        for (std::uint32_t& v : f) v += 5;
      for (Double3& p : ball.position) s.position.push_back({p[0] + 1020, p[1] + 1000, p[2] + 1000});
      s.faces.insert(s.faces.end(), ball.faces.begin(), ball.faces.end());
    }
    spill_off(in, s);
  };
  const auto remesh = [&](const fs::path& out, const std::string& edge) {
    const CommandResult r = tessera_command({"remesh", in.string(), "-o", out.string(), "--edge", edge,
                                             "--no-html", "--force", "--progress", "none"});
    INFO(r.errors);
    return r;
  };
  // Where faces as asked for would meet in the file those as given stay, in as few rounds as that takes.
  for (const double thickness : {1e-8, 1e-6, 1e-4})
    for (const bool with_ball : {false, true}) {
      CAPTURE(thickness, with_ball);
      body(thickness, with_ball);
      REQUIRE(pairs_of(in) == 0);
      const fs::path out = folder / "out.stl";
      fs::remove_all(folder / "out.stl.tessera");
      const CommandResult r = remesh(out, with_ball ? "0.4" : "0.1");
      CHECK(r.code == 0);
      CHECK(r.errors.find("came to cross") == std::string::npos);
      CHECK(pairs_of(out) == 0);
      const Json result = report_of(out).at("crossings").at("result");
      CHECK(result.at("left_pairs") == 0);
      CHECK(result.at("inherited_groups") == 0);
      if (with_ball) CHECK(check_of(out).at("faces") > 200);
    }
  // Doubles tell them apart.
  body(1e-6, false);
  REQUIRE(remesh(folder / "out.ply", "0.1").code == 0);
  CHECK(pairs_of(folder / "out.ply") == 0);
  CHECK(check_of(folder / "out.ply").at("faces") > 100);
}

TEST_CASE("mend: a repair ends with 6 where what is written cannot tell sheets apart", "[pipeline]") {
  const TempFolder folder;
  const fs::path in = folder / "in.off", floats = folder / "out.stl", doubles = folder / "out.ply";
  // A shell a hundred thousandth thick, where floats are six times as far apart.
  Surface shell = sphere(4, 1.0);
  const Surface inner = sphere(4, 1.0 - 1e-5);
  const auto first = static_cast<std::uint32_t>(shell.position.size());
  shell.position.insert(shell.position.end(), inner.position.begin(), inner.position.end());
  for (const auto& f : inner.faces) shell.faces.push_back({first + f[0], first + f[2], first + f[1]});
  for (Double3& p : shell.position)
    p = {1000 + p[0] + .3 * p[2] + .1 * p[1], 1000 + .97 * p[1] + .17 * p[0],
         1000 + p[2] + .31 * p[0] + .77 * p[1]};
  spill_off(in, shell);
  REQUIRE(pairs_of(in) == 0);
  const auto remesh = [&](const fs::path& out) {
    return tessera_command({"remesh", in.string(), "-o", out.string(), "--edge", "0.3", "--crossings",
                            "repair", "--no-html", "--progress", "none", "-q"});
  };
  const CommandResult refused = remesh(floats);
  INFO(refused.errors);
  CHECK(refused.code == 6);
  CHECK(refused.errors.find("still cross, overlap or touch as they would be written") != std::string::npos);
  CHECK(refused.errors.find("-o OUT.ply") != std::string::npos);
  CHECK_FALSE(fs::exists(floats));
  CHECK(remesh(doubles).code == 0);
  CHECK(pairs_of(doubles) == 0);
}

TEST_CASE("mend: pairs that no filling takes away are sent back to the passes, and none is left",
          "[pipeline][.shared]") {
  if (!has_shared_data()) return;
  const TempFolder folder;
  const fs::path out = folder / "out.ply";
  // Fans of needles, a hundredth of the tolerance apart: a group of faces of several blocks, too tangled for a filling.
  const CommandResult r = tessera_command({"decimate", (kSharedData / "dirty/cycloidal.ply").string(), "-o",
                                           out.string(), "--tolerance", "auto", "--crossings", "repair",
                                           "--no-html", "--progress", "none", "-q"});
  INFO(r.errors);
  REQUIRE(r.code == 0);
  const Json crossings = check_of(out).at("crossings");
  CHECK(crossings.at("cross") == 0);
  CHECK(crossings.at("overlap") == 0);
  const Json report = report_of(out);
  CHECK(report.at("crossings").at("result").at("left_pairs") == 0);
  CHECK(report.at("certificate").at("proven") == true);
  CHECK(report.at("certificate").at("rounds_again").get<int>() >= 1);
  std::uint64_t sent_back = 0;
  for (const Json& stage : report.at("stages"))
    if (stage.at("name") == "certify")
      sent_back = stage.at("result").at("crossing_faces").get<std::uint64_t>();
  CHECK(sent_back > 0);
  // Edges nearly as long as the mesh: blocks cannot see what they reach, and there are more faces around a pair than are looked at
  // at once.
  const CommandResult remesh =
      tessera_command({"remesh", (kSharedData / "dirty/cycloidal.ply").string(), "-o", out.string(), "--edge",
                       "2.5", "--crossings", "repair", "--no-html", "--progress", "none", "-q", "--force"});
  INFO(remesh.errors);
  REQUIRE(remesh.code == 0);
  const Json made = check_of(out).at("crossings"), result = report_of(out).at("crossings").at("result");
  CHECK(made.at("cross") == 0);
  CHECK(made.at("overlap") == 0);
  CHECK(result.at("inherited_groups") == 0);
  CHECK(result.at("left_pairs") == 0);
}

TEST_CASE("mend: a cap too small for uniting is refused with one that does", "[pipeline]") {
  const TempFolder folder;
  const fs::path in = folder / "in.ply", out = folder / "out.ply";
  WholeMesh mesh = knots(1);
  append(mesh, height_grid(400, 400, [](double x, double y) { return 100.0 + hills(x, y); }));
  mesh.header.vertices = mesh.points.size();
  mesh.header.faces = mesh.faces.size();
  write_whole(in, mesh);
  std::vector<std::string> words = repair("smooth", in, out);
  words.insert(words.end(), {"-t", "1", "--memory", "160M"});
  const CommandResult small = tessera_command(words);
  INFO(small.errors);
  REQUIRE(small.code == 4);
  CHECK(small.errors.find("input-unite") != std::string::npos);
  const std::size_t at = small.errors.find("--memory ");
  REQUIRE(at != std::string::npos);
  words.back() = small.errors.substr(at + 9, small.errors.find('M', at + 9) - at - 8);
  const CommandResult enough = tessera_command(words);
  INFO(enough.errors);
  CHECK(enough.code == 0);
  CHECK(pairs_of(out) == 0);
}

TEST_CASE("mend: a merge adds no crossings", "[property]") {
  const TempFolder folder;
  const fs::path one = folder / "one.ply", two = folder / "two.ply", out = folder / "out.ply";
  // Noise as high as the squares are wide.
  const auto half = [&](const fs::path& path, double from, double up, std::uint64_t seed) {
    Random random(seed);
    WholeMesh mesh;
    Surface s = height_grid(40, 40.0, [&](double x, double y) {
      return up + random.in(-0.6, 0.6) + 0.8 * std::sin(0.3 * (x + from)) * std::cos(0.25 * y);
    });
    for (Double3& p : s.position) p[0] += from;
    append(mesh, s);
    mesh.header.vertices = mesh.points.size();
    mesh.header.faces = mesh.faces.size();
    write_whole(path, mesh);
  };
  const auto run = [&](std::vector<std::string> more) {
    more.insert(more.begin(), {"merge", one.string(), two.string(), "-o", out.string(), "-q", "--no-html",
                               "--force", "--progress", "none"});
    REQUIRE(tessera_command(more).code == 0);
    return file_bytes(out);
  };
  std::uint64_t kept = 0;
  for (std::uint64_t seed = 1; seed <= 3; ++seed) {
    half(one, 0.0, 0.0, seed);
    half(two, 25.3, 0.6, seed + 10);
    REQUIRE(pairs_of(one) + pairs_of(two) == 0);
    run({"--crossings", "keep", "-t", "1"});
    kept += pairs_of(out);
    const std::string bytes = run({"-t", "1"});
    CHECK(pairs_of(out) == 0);
    const Json result = report_of(out).at("crossings").at("result");
    INFO(dump_json(result));
    CHECK(result.at("left_pairs").get<std::uint64_t>() == 0);
    CHECK(run({"-t", "2", "--tile-size", "64", "--memory", "160M"}) == bytes);
  }
  CHECK(kept > 0);
}

TEST_CASE("mend: deform tells how many pairs meet before and after", "[pipeline]") {
  const TempFolder folder;
  const fs::path in = folder / "in.ply", edit = folder / "edit.json", out = folder / "out.ply";
  WholeMesh mesh;
  append(mesh, height_grid(30, 30, [](double, double) { return 0.0; }));
  mesh.header.vertices = mesh.points.size();
  mesh.header.faces = mesh.faces.size();
  write_whole(in, mesh);
  const auto run = [&](double along) {
    spill(edit, R"({"regions": [{"role": "support", "box": [[5, -1, -1], [20.5, 31, 1]]},
      {"role": "handle", "name": "h", "box": [[20.4, -1, -1], [31, 31, 1]]}],
      "handles": {"h": {"move": [)" +
                    std::to_string(along) + R"(, 0, 0]}}})");
    const CommandResult r =
        tessera_command({"deform", in.string(), edit.string(), "-o", out.string(), "--force", "--no-html"});
    INFO(r.errors);
    REQUIRE(r.code == 0);
    return std::make_pair(report_of(out).at("mesh").at("crossings"), r.errors);
  };
  const auto [still, quiet] = run(0.5);
  CHECK(still.at("before").at("cross") == 0);
  CHECK(still.at("after").at("faces") == 0);
  CHECK(quiet.find("makes faces meet") == std::string::npos);
  const auto [folded, told] = run(-26.0);  // the handle ends beyond what is fixed
  CHECK(folded.at("after").at("faces") > 0);
  CHECK(told.find("makes faces meet") != std::string::npos);
}

}  // namespace mend_crossings_test
