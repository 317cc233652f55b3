// What tessera csg and resurface make beyond plain combinations: rounded joints, mitres, scans, and how they fail.
#include <catch2/catch.hpp>

#include <cmath>
#include <sstream>

#include "octree/placement.h"
#include "octree/portable_math.h"
#include "stream/files/json.h"
#include "tests/helpers/killed_command.h"
#include "tests/helpers/skip.h"
#include "tests/helpers/solid_command.h"
#include "tests/helpers/temp_folder.h"

namespace solid_scenes_test {

namespace {

using namespace tessera;
using namespace tessera::test;
namespace fs = std::filesystem;

std::string box_text(const Double3& low, const Double3& high, const Placement& placement = {}) {
  std::string text = "OFF\n8 12 0\n";
  for (int c = 0; c < 8; ++c) {
    const Double3 p =
        placement.apply({c & 1 ? high[0] : low[0], c & 2 ? high[1] : low[1], c & 4 ? high[2] : low[2]});
    char line[96];
    std::snprintf(line, sizeof line, "%.17g %.17g %.17g\n", p[0], p[1], p[2]);
    text += line;
  }
  return text +
         "3 0 2 1\n3 1 2 3\n3 4 5 6\n3 5 7 6\n3 0 1 4\n3 1 5 4\n3 2 6 3\n3 3 6 7\n3 0 4 2\n3 2 4 6\n3 1 3 "
         "5\n3 3 7 5\n";
}

}  // namespace

TEST_CASE("csg: rounded joints have their radius within a hundredth", "[pipeline]") {
  const TempFolder folder;
  const std::string out = (folder / "o.ply").string();
  // A step: the fillet along its foot is a quarter of a cylinder of radius 2 about the line x = 2, z = 2.
  const std::string step = folder
                               .write("step.json", R"({"union": [{"box": [-5,-5,-3, 9,5,0]},
                                  {"box": [-5,-5,-3, 0,5,6]}], "blend": 2})")
                               .string();
  REQUIRE(solid_command({"csg", step, "-o", out, "--resolution", "0.2"}).code == 0);
  WholeMesh mesh = read_whole(out);
  CHECK(is_closed(mesh));
  double worst = 0.0;
  std::size_t on = 0;
  for (const Double3& p : mesh.points) {
    if (std::fabs(p[1]) > 4.5 || p[0] < 0.05 || p[0] > 1.95 || p[2] < 0.05 || p[2] > 1.95) continue;
    worst = std::max(worst, std::fabs(std::sqrt((p[0] - 2) * (p[0] - 2) + (p[2] - 2) * (p[2] - 2)) - 2.0));
    ++on;
  }
  CHECK(on > 300);
  CHECK(worst < 0.01 * 2.0);
  CHECK(volume(mesh) == Approx(14.0 * 10 * 3 + 5.0 * 10 * 6 + 10.0 * (4.0 - kPi)).epsilon(1e-3));
  // A rod on a plate, scaled and turned: a quarter of a torus at its foot.
  const std::string rod = folder
                              .write("rod.json", R"({"union": [{"box": [-8,-8,-2, 8,8,0]},
                                 {"cylinder": [0,0,-1, 0,0,6, 3]}], "blend": 1.5, "scale": 2, "rotate": [1,2,3, 40]})")
                              .string();
  REQUIRE(solid_command({"csg", rod, "-o", out, "--resolution", "0.2", "--force"}).code == 0);
  mesh = read_whole(out);
  CHECK(is_closed(mesh));
  // Pappus: a square less a quarter of a disc, round the axis.
  const double r = 1.5, corner = r * r - kPi * r * r / 4.0,
               moment = r * r * (3.0 + r / 2.0) - kPi * r * r / 4.0 * (3.0 + r - 4.0 * r / (3.0 * kPi));
  CHECK(corner > 0.0);
  CHECK(volume(mesh) == Approx(8.0 * (512.0 + 54.0 * kPi + 2.0 * kPi * moment)).epsilon(1e-3));
  const std::string bytes = file_bytes(out), again = (folder / "a.ply").string();
  REQUIRE(
      solid_command({"csg", rod, "-o", again, "--resolution", "0.2", "-t", "1", "--tile-size", "64"}).code ==
      0);
  CHECK(file_bytes(again) == bytes);
  const auto code_of = [&](const std::string& scene) {
    const CommandResult result =
        solid_command({"csg", folder.write("s.json", scene).string(), "-o", (folder / "x.ply").string()});
    CHECK(std::count(result.errors.begin(), result.errors.end(), '\n') == 1);
    return result.code;
  };
  CHECK(code_of(R"({"union": [{"sphere": [0,0,0,1]}, {"mesh": "a.ply"}], "blend": 1})") == 3);
  CHECK(code_of(R"({"union": [{"sphere": [0,0,0,1]}, {"sphere": [1,0,0,1]}], "blend": 0})") == 3);
  CHECK(
      code_of(R"({"union": [{"sphere": [0,0,0,1]}, {"sphere": [1,0,0,1], "scale": [1,2,1]}], "blend": 1})") ==
      3);
  CHECK(code_of(R"({"sphere": [0,0,0,1], "blend": 1})") == 3);
  CHECK(
      code_of(
          R"({"union": [{"sphere": [0,0,0,1]}, {"sphere": [1,0,0,1]}, {"sphere": [0,1,0,1]}], "blend": 1})") ==
      3);
  CHECK(code_of(R"({"union": [{"sphere": [0,0,0,1]},
    {"union": [{"sphere": [1,0,0,1]}, {"sphere": [0,1,0,1]}]}], "blend": 1})") == 3);
  const std::string round = R"({"union": [{"sphere": [1,0,0,1]}, {"sphere": [0,1,0,1]}], "blend": 1})";
  CHECK(code_of(R"({"union": [{"sphere": [0,0,0,1]}, )" + round + R"(], "blend": 1})") == 3);
}

TEST_CASE("resurface: a mitred offset of a cube is a cube, a limit cuts its corners", "[pipeline]") {
  const TempFolder folder;
  const Placement placement = rotation(unit(Double3{1, 2, 3}), 33.0);
  const std::string out = (folder / "o.ply").string(),
                    box = folder.write("box.off", box_text({-1, -1, -1}, {1, 1, 1}, placement)).string();
  const std::vector<std::string> words = {"resurface", box,   "-o",        out,     "--resolution", "0.05",
                                          "--offset",  "0.3", "--corners", "mitre", "--force"};
  REQUIRE(solid_command(words).code == 0);
  const WholeMesh mesh = read_whole(out);
  CHECK(is_closed(mesh));
  CHECK(volume(mesh) == Approx(2.6 * 2.6 * 2.6).epsilon(1e-3));
  for (int c = 0; c < 8; ++c) {
    const Double3 corner = placement.apply({c & 1 ? 1.3 : -1.3, c & 2 ? 1.3 : -1.3, c & 4 ? 1.3 : -1.3});
    double nearest = 1.0;
    for (const Double3& p : mesh.points) nearest = std::min(nearest, norm(p - corner));
    CHECK(nearest < 0.02 * 0.05);
  }
  const std::string bytes = file_bytes(out);
  std::vector<std::string> other = words;
  other.insert(other.end(), {"-t", "1", "--tile-size", "64"});
  REQUIRE(solid_command(other).code == 0);
  CHECK(file_bytes(out) == bytes);
  // Edges lie 1.414 offsets away, corners 1.732.
  other = words;
  other.insert(other.end(), {"--mitre-limit", "1.5"});
  REQUIRE(solid_command(other).code == 0);
  const WholeMesh cut = read_whole(out);
  CHECK(is_closed(cut));
  double farthest = 0.0, edges = 1.0;
  for (const Double3& p : cut.points) {
    const Double3 local = placement.inverse().apply(p);
    Double3 beyond;
    for (std::size_t k = 0; k < 3; ++k) beyond[k] = std::max(0.0, std::fabs(local[k]) - 1.0);
    farthest = std::max(farthest, norm(beyond));
    edges =
        std::min(edges, norm(Double3{std::fabs(local[0]) - 1.3, std::fabs(local[1]) - 1.3, 0.2 * local[2]}));
  }
  CHECK(farthest < 1.5 * 0.3 + 0.3 * 0.05);
  CHECK(farthest > 1.5 * 0.3 - 0.02 * 0.05);
  CHECK(edges < 0.01);
}

TEST_CASE("csg: a scan in a scene is reconstructed first, in the same memory, and kept", "[pipeline]") {
  const TempFolder folder;
  REQUIRE(tessera_command({"synth", "--scene", "sphere", "--points", "200000", "--normals", "-o",
                           (folder / "ball.ply").string()})
              .code == 0);
  const std::string scene = folder
                                .write("s.json", R"({"difference": [{"scan": "ball.ply", "resolution": 0.05},
      {"halfspace": [0,0,0, 0,0,-1]}, {"scan": ["ball.ply"], "resolution": 0.05, "translate": [0.7,0,0]}]})")
                                .string();
  const std::string out = (folder / "o.ply").string();
  const CommandResult made =
      solid_command({"csg", scene, "-o", out, "--resolution", "0.03", "--memory", "300M"});
  CAPTURE(made.errors);
  REQUIRE(made.code == 0);
  CHECK(made.peak_bytes < (std::uint64_t{300} << 20));
  CHECK(is_closed(read_whole(out)));
  const fs::path scan = folder / "o.scan-1.ply";
  REQUIRE(fs::exists(scan));
  CHECK_FALSE(fs::exists(folder / "o.scan-2.ply"));  // the same scan twice is one
  CHECK(is_closed(read_whole(scan.string())));
  const std::string bytes = file_bytes(out), of_scan = file_bytes(scan.string());
  // Killed and gone on with.
  const std::string part = (folder / "p.ply").string();
  const std::vector<std::string> words = {"csg", scene, "-o", part, "--resolution", "0.03", "--no-html"};
  REQUIRE(resumed_after_kills(words).code == 0);
  CHECK(file_bytes(part) == bytes);
  CHECK(file_bytes((folder / "p.scan-1.ply").string()) == of_scan);
  const auto code_of = [&](const std::string& text) {
    return solid_command({"csg", folder.write("x.json", text).string(), "-o", (folder / "x.ply").string()})
        .code;
  };
  CHECK(code_of(R"({"scan": "none.las"})") == 3);
  CHECK(code_of(R"({"scan": 5})") == 3);
  CHECK(code_of(R"({"scan": "ball.ply", "resolutoin": 0.05})") == 3);
}

TEST_CASE("resurface: bodies that touch in a point come out apart", "[pipeline]") {
  // Corner to corner: edges of both begin there, on a lattice edge, and pass faces of the lattice at one place.
  std::string text = "OFF\n16 24 0\n", faces;
  int first = 0;
  for (const auto& [low, high] : {std::pair{Double3{1, -1, 0}, Double3{1.5, 0, 0.1}},
                                  std::pair{Double3{1.5, 0, -0.5}, Double3{2, 0.1, 0}}}) {
    std::istringstream box(box_text(low, high));
    std::string line;
    for (int l = 0; std::getline(box, line); ++l) {
      if (l >= 2 && l < 10) text += line + "\n";
      std::istringstream words(line);
      int count = 0, a = 0, b = 0, c = 0;
      if (l >= 10 && words >> count >> a >> b >> c)
        faces += "3 " + std::to_string(first + a) + " " + std::to_string(first + b) + " " +
                 std::to_string(first + c) + "\n";
    }
    first += 8;
  }
  const TempFolder folder;
  const std::string in = folder.write("boxes.off", text + faces).string();
  for (const char* h : {"0.08193819126329309", "0.08", "0.07"}) {
    CAPTURE(h);
    const std::string out = (folder / "out.ply").string();
    REQUIRE(solid_command({"resurface", in, "-o", out, "--resolution", h, "--force"}).code == 0);
    CHECK(tessera_command({"check", out, "--crossings", "--closed", "--strict"}).code == 0);
  }
}

TEST_CASE("csg: crumbs of a wedge thinner than a cell are dropped and counted", "[pipeline]") {
  const TempFolder folder;
  // A ball less one that is shifted by less than a cell: what is left runs out thinner than any cell all around.
  const std::string scene =
      folder.write("s.json", R"({"difference": [{"sphere": [0,0,0, 1]}, {"sphere": [0.21,0.02,0.1, 1.04]}]})")
          .string();
  const std::string out = (folder / "o.ply").string(), all = (folder / "a.ply").string();
  const auto mesh_of = [&](const std::string& file, const std::vector<std::string>& how) {
    std::vector<std::string> words = {"csg", scene, "-o", file, "--resolution", "0.05"};
    words.insert(words.end(), how.begin(), how.end());
    REQUIRE(solid_command(words).code == 0);
    CHECK(is_closed(read_whole(file)));
    return parse_json(file_bytes(file + ".report.json")).at("mesh");
  };
  const Json mesh = mesh_of(out, {}), every = mesh_of(all, {"--min-component", "1"});
  CHECK(every.at("components").get<int>() > 10);
  CHECK(mesh.at("components").get<int>() <= 2);
  CHECK(mesh.at("islands_dropped").get<int>() ==
        every.at("components").get<int>() - mesh.at("components").get<int>());
  CHECK(every.at("islands_dropped") == 0);
}

TEST_CASE("csg, resurface, field: killed again and again, the same bytes under every cap", "[fault]") {
  const TempFolder folder;
  const std::string a = (folder / "a.ply").string(),
                    b = folder.write("b.off", box_text({-0.4, -0.5, -3}, {0.6, 0.3, 3})).string();
  REQUIRE(solid_command({"csg", folder.write("s.json", R"({"torus": [0,0,0, 0.1,0.2,1, 1, 0.45]})").string(),
                         "-o", a, "--resolution", "0.03"})
              .code == 0);
  const std::vector<std::vector<std::string>> jobs = {
      {"csg", a, "-", b, "--resolution", "0.022"},
      {"resurface", a, b, "--resolution", "0.022"},
      {"field", a, "--resolution", "0.025"},
      {"field", a, "--resolution", "0.03", "--tolerance", "0.06"},
  };
  for (const std::vector<std::string>& job : jobs) {
    CAPTURE(job);
    const bool is_field = job[0] == "field";
    const std::string end = !is_field ? ".ply" : job.size() > 4 ? ".octree" : ".vdb";
    const auto run = [&](const std::string& file, const std::vector<std::string>& how) {
      std::vector<std::string> words = job;
      words.insert(words.end(), {"-o", file});
      words.insert(words.end(), how.begin(), how.end());
      return solid_command(words);
    };
    const std::string whole = (folder / ("whole" + end)).string(), part = (folder / ("part" + end)).string();
    REQUIRE(run(whole, {"--force"}).code == 0);
    const std::string bytes = file_bytes(whole);
    std::vector<std::string> line = job;
    line.insert(line.end(), {"-o", part, "--no-html", "--progress", "none"});
    REQUIRE(resumed_after_kills(line).code == 0);
    CHECK(file_bytes(part) == bytes);
    for (const std::vector<std::string>& how : {std::vector<std::string>{"-t", "1", "--tile-size", "64"},
                                                {"-t", "2", "--tile-size", "256"},
                                                {"-t", "1", "--memory", "200M"},
                                                {"-t", "2", "--memory", "300M", "--tile-size", "128"}}) {
      std::vector<std::string> words = how;
      words.push_back("--force");
      const CommandResult r = run(part, words);
      CAPTURE(how, r.errors);
      REQUIRE(r.code == 0);
      CHECK(file_bytes(part) == bytes);
      for (std::size_t i = 0; i + 1 < how.size(); ++i)
        if (how[i] == "--memory")
          CHECK(r.peak_bytes < (std::uint64_t{how[i + 1] == "200M" ? 200u : 300u} << 20));
    }
    fs::remove(part);
    fs::remove(whole);
  }
}

TEST_CASE("csg: other units are warned of, coordinates far out keep their shape", "[pipeline]") {
  const TempFolder folder;
  folder.write("metres.off", box_text({0, 0, 0}, {2, 2, 2}));
  folder.write("millimetres.off", box_text({500, 500, 500}, {4500, 4500, 4500}));
  const std::string out = (folder / "o.ply").string();
  const CommandResult units =
      solid_command({"csg", (folder / "metres.off").string(), "+", (folder / "millimetres.off").string(),
                     "-o", out, "--resolution", "20"});
  REQUIRE(units.code == 0);
  const auto report = parse_json(file_bytes(out + ".report.json"));
  CHECK(dump_json(report.at("warnings")).find("same units") != std::string::npos);
  const Double3 far = {1e7, -2e7, 1.5e7};
  folder.write("a.off", box_text(far, far + Double3{2, 2, 2}));
  folder.write("b.off", box_text(far + Double3{1, 1, -1}, far + Double3{3, 3, 3}));
  REQUIRE(solid_command({"csg", (folder / "a.off").string(), "-", (folder / "b.off").string(), "-o", out,
                         "--resolution", "0.07", "--force"})
              .code == 0);
  WholeMesh mesh = read_whole(out);
  CHECK(is_closed(mesh));
  for (Double3& p : mesh.points) p = p - far;
  CHECK(volume(mesh) == Approx(6.0).epsilon(1e-3));
}

}  // namespace solid_scenes_test
