// tessera deform --onto as a user runs it: a sheet comes onto a bent and noisy scan of it, whatever must not matter gives the same
// bytes, and what cannot be fitted is refused.
#include <catch2/catch.hpp>

#include <cmath>
#include <fstream>
#include <string>
#include <vector>

#include "stream/files/json.h"
#include "stream/formats/meshes/mesh_io.h"
#include "tests/helpers/command.h"
#include "tests/helpers/killed_command.h"
#include "tests/helpers/mesh_files.h"
#include "tests/helpers/shell.h"

namespace onto_test {

using namespace tessera;
using namespace tessera::test;

namespace {

namespace fs = std::filesystem;

constexpr int kSide = 40;
constexpr double kNoise = 0.1;

double designed(double x, double y) {
  return 2.0 * std::sin(0.15 * x) * std::cos(0.1 * y);
}
double built(double x, double y) {
  return designed(x, y) + 0.8 * (x - 20) * (x - 20) / 400 + 0.01 * (y - 20);
}

fs::path write_design(const fs::path& path) {
  write_sheet(path, kSide, [](int i, int j) -> Double3 {
    return {static_cast<double>(i), static_cast<double>(j),
            static_cast<double>(static_cast<float>(designed(i, j)))};
  });
  return path;
}

/// 36 points a square on what was built, with noise; a wall far off.
fs::path write_scan(const fs::path& path, bool backwards = false, double dz = 0.0) {
  constexpr int kFine = 6 * kSide;
  constexpr int kCount = (kFine + 1) * (kFine + 1);
  std::ofstream out(path);
  out.precision(9);
  out << "x y z\n";
  for (int n = 0; n < kCount; ++n) {
    const int at = backwards ? kCount - 1 - n : n;
    const double x = static_cast<double>(at % (kFine + 1)) / 6, y = static_cast<double>(at / (kFine + 1)) / 6;
    std::uint64_t random = static_cast<std::uint64_t>(at + 1) * 0x9e3779b97f4a7c15u;
    double noise = -6.0;
    for (int k = 0; k < 12; ++k) {
      random = (random ^ random >> 29) * 0xbf58476d1ce4e5b9u;
      noise += static_cast<double>(random >> 40) / static_cast<double>(1 << 24);
    }
    out << x << ' ' << y << ' ' << built(x, y) + kNoise * noise + dz << '\n';
    if (at % 10 == 0) out << 60 << ' ' << y << ' ' << x << '\n';
  }
  return path;
}

std::vector<std::string> words(const fs::path& mesh, const fs::path& scan, const fs::path& out,
                               const std::vector<std::string>& more = {}) {
  std::vector<std::string> w = {"deform",     mesh.string(), "--onto", scan.string(), "-o",
                                out.string(), "--progress",  "none",   "-q"};
  w.insert(w.end(), more.begin(), more.end());
  return w;
}

}  // namespace

TEST_CASE("deform onto: below a third of the noise of what was built, told on the page", "[pipeline]") {
  const TempFolder folder;
  const fs::path mesh = write_design(folder.path() / "in.ply"), scan = write_scan(folder.path() / "in.xyz");
  const fs::path out = folder.path() / "out.ply";
  const CommandResult r = tessera_command(words(mesh, scan, out));
  INFO(r.errors);
  REQUIRE(r.code == 0);
  const WholeMesh before = read_whole(mesh), after = read_whole(out);
  CHECK(after.faces == before.faces);
  REQUIRE(after.points.size() == before.points.size());
  double sum = 0.0, most = 0.0;
  for (const Double3& p : after.points) {
    const double off = p[2] - built(p[0], p[1]);
    sum += off * off;
    most = std::max(most, std::fabs(off));
  }
  CHECK(std::sqrt(sum / static_cast<double>(after.points.size())) < kNoise / 3);
  CHECK(most < kNoise);
  const Json report = parse_json(file_bytes(out.string() + ".report.json"));
  const Json& onto = report.at("onto");
  const auto rms = [&](const char* when) { return onto.at(when).at("areas").at(0).at("rms").get<double>(); };
  CHECK(rms("before") > 2 * kNoise);
  CHECK(rms("after") < 1.05 * kNoise);
  CHECK(onto.at("scan").at("points_near").get<int>() > 58000);
  CHECK(onto.at("fit").at("cells").at("matched").get<int>() > 500);
  CHECK(onto.at("fit").at("scales").size() >= 2);
  const std::string page = file_bytes(out.string() + ".report.html");
  CHECK(page.find("points of the scan from the mesh as written") != std::string::npos);
  CHECK(page.find("Points of the scan by signed distance to the mesh as given") != std::string::npos);
}

TEST_CASE("deform onto: same bytes over threads, memory, order of points and files, kills", "[property]") {
  const TempFolder folder;
  const fs::path mesh = write_design(folder.path() / "in.ply"), scan = write_scan(folder.path() / "in.xyz");
  const fs::path other = write_scan(folder.path() / "a.xyz", true, 0.05);
  const auto run = [&](const std::vector<fs::path>& scans, std::vector<std::string> more) {
    const fs::path out = folder.path() / "out.ply";
    fs::remove(out);
    if (scans.size() > 1) more.insert(more.end(), {"--onto", scans[1].string()});
    more.emplace_back("--no-html");
    const CommandResult r = tessera_command(words(mesh, scans[0], out, more));
    INFO(r.errors);
    REQUIRE(r.code == 0);
    CHECK_FALSE(fs::exists(out.string() + ".tessera"));
    return file_bytes(out);
  };
  const std::string want = run({scan}, {"--threads", "1"});
  CHECK(run({scan}, {"--threads", "3", "--memory", "400M"}) == want);
  CHECK(run({write_scan(folder.path() / "back.xyz", true)}, {}) == want);
  CHECK(run({scan, other}, {}) == run({other, scan}, {}));
  const fs::path killed = folder.path() / "killed.ply";
  const CommandResult r = resumed_after_kills(words(mesh, scan, killed, {"--no-html"}));
  INFO(r.errors);
  REQUIRE(r.code == 0);
  CHECK(file_bytes(killed) == want);
}

TEST_CASE("deform onto: what cannot be fitted is refused in a sentence", "[pipeline]") {
  const TempFolder folder;
  const fs::path mesh = write_design(folder.path() / "in.ply"), scan = write_scan(folder.path() / "in.xyz");
  const fs::path out = folder.path() / "out.ply";
  int runs = 0;  // a refused job leaves its work behind
  const auto run = [&](const fs::path& from, const std::vector<std::string>& more) {
    return tessera_command(
        words(mesh, from, folder.path() / ("out" + std::to_string(++runs) + ".ply"), more));
  };
  const fs::path away = write_scan(folder.path() / "away.xyz", false, 500.0);
  const CommandResult none = run(away, {});
  CHECK(none.code == 5);
  CHECK(none.errors.find("no point lies within") != std::string::npos);
  std::ofstream(folder.path() / "few.xyz") << "x y z\n1 1 0.3\n20 20 0\n30 9 0\n";
  const CommandResult few = run(folder.path() / "few.xyz", {});
  CHECK(few.code == 5);
  CHECK(few.errors.find("no planar places") != std::string::npos);
  const fs::path above = write_scan(folder.path() / "above.xyz", false, 4.0);
  const CommandResult far = run(above, {"--max-distance", "0.5"});
  CHECK((far.code == 5 || far.code == 6));
  CHECK(far.errors.find("--max-distance") != std::string::npos);
  CHECK(run(mesh, {}).code == 2);
  CHECK(run(scan, {"--max-distance", "1000"}).code == 2);
  CHECK(tessera_command(words(mesh, scan, folder.path() / "out.vtu")).code == 2);
  CHECK(tessera_command({"deform", mesh.string(), mesh.string(), "-o", out.string(), "--order", "3"}).code ==
        2);
  const CommandResult small = run(scan, {"--memory", "64M"});
  CHECK(small.code == 4);
  CHECK(small.errors.find("--memory") != std::string::npos);
  for (int k = 1; k <= runs; ++k)
    CHECK_FALSE(fs::exists(folder.path() / ("out" + std::to_string(k) + ".ply")));
}

}  // namespace onto_test
