// The main job as a user runs it: one hash over everything that must not matter, kills, caps.
#include <catch2/catch.hpp>

#include <unistd.h>

#include <cstdlib>
#include <map>

#include "stream/files/json.h"
#include "stream/runtime/memory_budget.h"
#include "tests/helpers/command.h"
#include "tests/helpers/killed_command.h"
#include "tests/helpers/mesh_files.h"
#include "tests/helpers/random.h"
#include "tests/helpers/serial_job.h"
#include "tests/helpers/shell.h"
#include "tests/helpers/skip.h"

namespace reconstruct_test {

using namespace tessera::test;

namespace {

/// A noisy, coloured scan with sharp edges, outliers and several stations; made once per process.
const std::filesystem::path& scan() {
  static const TempFolder folder;
  static const std::filesystem::path file = [] {
    auto path = folder.path() / "scan.xyz";
    REQUIRE(tessera_command({"synth", "--scene", "fandisk", "--points", "60000", "--noise", "0.2s",
                             "--outliers", "0.001", "--normals", "--colour", "-o", path.string(), "-t", "1"})
                .code == 0);
    return path;
  }();
  return file;
}

std::vector<std::string> job(const std::vector<std::string>& inputs, const std::filesystem::path& out,
                             const std::vector<std::string>& more) {
  std::vector<std::string> words = {"reconstruct"};
  words.insert(words.end(), inputs.begin(), inputs.end());
  words.insert(words.end(), {"-o", out.string(), "--progress", "none", "-q"});
  words.insert(words.end(), more.begin(), more.end());
  return words;
}

/// What the report says of what is missing, and its picture.
std::string coverage_of(const std::filesystem::path& out) {
  const tessera::Json report = tessera::parse_json(file_bytes(out.string() + ".report.json"));
  const std::string picture = out.string() + ".missing.png";
  REQUIRE(report.at("coverage").at("picture") == std::filesystem::exists(picture));
  return tessera::dump_json(report.at("coverage")) +
         (std::filesystem::exists(picture) ? file_bytes(picture) : "");
}

struct ScanResult {
  std::string mesh, coverage;
  bool operator==(const ScanResult&) const = default;
};

ScanResult result_of(const std::vector<std::string>& inputs, const std::vector<std::string>& more) {
  const TempFolder folder;
  const auto out = folder.path() / "mesh.ply";
  const CommandResult r = tessera_command(job(inputs, out, more));
  INFO(r.errors);
  REQUIRE(r.code == 0);
  CHECK_FALSE(std::filesystem::exists(out.string() + ".tessera"));
  return {file_bytes(out), coverage_of(out)};
}

std::string mesh_of(const std::vector<std::string>& inputs, const std::vector<std::string>& more) {
  return result_of(inputs, more).mesh;
}

/// The lines of the scan in another order, over `parts` files.
std::vector<std::string> reordered(const TempFolder& folder, std::size_t parts, bool reverse) {
  std::ifstream in(scan());
  std::vector<std::string> lines;
  for (std::string line; std::getline(in, line);) lines.push_back(line);
  std::vector<std::string> header;
  while (!lines.empty() && (lines.front().empty() || lines.front()[0] == '#')) {
    header.push_back(lines.front());
    lines.erase(lines.begin());
  }
  if (reverse) std::reverse(lines.begin(), lines.end());
  std::vector<std::string> files;
  for (std::size_t p = 0; p < parts; ++p) {
    files.push_back((folder.path() / ("part" + std::to_string(p) + ".xyz")).string());
    std::ofstream out(files.back());
    for (const auto& h : header) out << h << '\n';
    for (std::size_t i = p; i < lines.size(); i += parts) out << lines[i] << '\n';
  }
  return files;
}

}  // namespace

TEST_CASE("reconstruct: one hash over tiles, threads, caps, order, files and processes", "[pipeline]") {
  const std::vector<std::string> whole = {scan().string()};
  const ScanResult want = result_of(whole, {"--tile-size", "64", "-t", "1", "--memory", "1G"});
  REQUIRE(want.mesh.size() > 500'000);
  for (const char* tile : {"64", "128", "256"})
    for (const char* threads : {"1", "2", "5"}) {
      CAPTURE(tile, threads);
      CHECK(result_of(whole, {"--tile-size", tile, "-t", threads, "--memory", "2G"}) == want);
    }
  CHECK(result_of(whole, {"--memory", "192M", "-t", "2"}) == want);
  CHECK(result_of(whole, {"--processes", "-t", "2"}) == want);
  const TempFolder folder;
  CHECK(result_of(reordered(folder, 1, true), {}) == want);
  CHECK(result_of(reordered(folder, 3, false), {"--memory", "256M"}) == want);
}

TEST_CASE("reconstruct: check --scan tells of a mesh what its job told, and of less of it less",
          "[pipeline]") {
  const TempFolder folder;
  const auto out = folder.path() / "mesh.ply";
  REQUIRE(tessera_command(job({scan().string()}, out, {})).code == 0);
  const auto told = [&](const std::filesystem::path& mesh) {
    const auto file = folder.path() / "check.json";
    const CommandResult r = tessera_command({"check", mesh.string(), "--scan", scan().string(), "--json",
                                             file.string(), "--force", "--memory", "256M"});
    INFO(r.errors);
    REQUIRE(r.code == 0);
    return tessera::parse_json(file_bytes(file)).at("coverage");
  };
  tessera::Json want = tessera::parse_json(file_bytes(out.string() + ".report.json")).at("coverage");
  want.erase("picture");
  tessera::Json whole = told(out);
  REQUIRE(whole.at("measured") == true);
  whole.erase("measured");
  CHECK(whole == want);
  CHECK(whole.at("confirmed").get<double>() > 0.99);

  // The half of the scan below its mean x.
  double sum = 0.0, count = 0.0;
  std::ifstream lines(scan());
  for (std::string line; std::getline(lines, line);)
    if (!line.empty() && line[0] != '#') sum += std::strtod(line.c_str(), nullptr), ++count;
  const auto half = folder.path() / "half.ply";
  const std::string box = "-1e9,-1e9,-1e9," + std::to_string(sum / count) + ",1e9,1e9";
  REQUIRE(tessera_command(job({scan().string()}, half, {"--bounds", box})).code == 0);
  const tessera::Json less = told(half);
  CHECK(less.at("points") == want.at("points"));
  CHECK(less.at("confirmed").get<double>() < 0.9);
  CHECK(less.at("plan").get<double>() < want.at("plan").get<double>());
  CHECK(tessera_command({"check", out.string(), "--scan", (folder.path() / "none.las").string()}).code == 3);
}

TEST_CASE("reconstruct: killed at commits and writes, the same command ends in the same bytes", "[fault]") {
  const ScanResult want = result_of({scan().string()}, {});
  const TempFolder folder;
  const auto out = folder.path() / "mesh.ply";
  const auto words = job({scan().string()}, out, {"-t", "2"});
  const CommandResult r = resumed_after_kills(words, [&] {
    if (std::filesystem::exists(out)) CHECK(file_bytes(out) == want.mesh);  // killed behind the last rename
  });
  INFO(r.errors);
  REQUIRE(r.code == 0);
  CHECK(file_bytes(out) == want.mesh);
  CHECK(coverage_of(out) == want.coverage);
}

TEST_CASE("reconstruct: killed at every commit point, the same command ends in the same bytes", "[fault]") {
  const TempFolder folder;
  const auto cloud = (folder.path() / "ball.ply").string();
  REQUIRE(
      tessera_command({"synth", "--scene", "sphere", "--points", "4000", "--normals", "-o", cloud}).code ==
      0);
  const std::string want = mesh_of({cloud}, {});
  const auto out = folder.path() / "mesh.ply";
  const auto words = job({cloud}, out, {"-t", "1"});
  // A commit has four points: each run gets past one and is killed at the same point of the next, so that every run
  // goes on where a kill left the job.
  for (int point = 5; point <= 8; ++point) {
    CAPTURE(point);
    for (unsigned kills = 0;; ++kills) {
      REQUIRE(kills < 300);
      CAPTURE(kills);
      const CommandResult r = tessera_command(words, 0, "TESSERA_FAULT=commit:" + std::to_string(point));
      INFO(r.errors);
      if (std::filesystem::exists(out)) CHECK(file_bytes(out) == want);  // whole, or not there
      if (r.code == 0) {
        CHECK(kills > 10);
        break;
      }
      REQUIRE(r.code == 128 + SIGKILL);
    }
    REQUIRE(file_bytes(out) == want);
    std::filesystem::remove(out);
  }
}

TEST_CASE("reconstruct: a disk that cannot hold the points of the headers is told before they are unpacked",
          "[fault]") {
  if (::geteuid() != 0) return skip("mounting a small tmpfs needs root");
  const TempFolder folder;
  const std::string cloud = (folder.path() / "cloud.laz").string(), disk = (folder.path() / "disk").string();
  REQUIRE(tessera_command({"synth", "--points", "400000", "-o", cloud}).code == 0);
  std::filesystem::create_directories(disk);
  // Unpacked they take 5 MB of it; sorted, 19.
  if (shell("mount -t tmpfs -o size=12m tessera-test " + disk).code != 0)
    return skip("this machine does not let root mount a tmpfs");
  const auto out = folder.path() / "mesh.ply";
  const CommandResult r = tessera_command(job({cloud}, out, {"--temp", disk}));
  CAPTURE(r.errors);
  CHECK(r.code == 4);
  CHECK_THAT(r.errors, Catch::Contains("sorting the points") && Catch::Contains("--temp"));
  CHECK_FALSE(std::filesystem::exists(out));
  CHECK_FALSE(std::filesystem::exists(out.string() + ".report.json"));  // no stage ended
  // Nobody knows from headers how many of them are of a class, or in a box.
  for (const std::vector<std::string>& chosen :
       {std::vector<std::string>{"--classes", "0"}, {"--bounds", "0,0,-1000,1,1,1000"}}) {
    std::vector<std::string> words = job({cloud}, out, {"--temp", disk, "--force"});
    words.insert(words.end(), chosen.begin(), chosen.end());
    const CommandResult some = tessera_command(words);
    CAPTURE(some.errors);
    CHECK_THAT(some.errors, !Catch::Contains("sorting the points"));
  }
  CHECK(shell("umount " + disk).code == 0);
}

TEST_CASE("reconstruct: the cap holds for a million points", "[memory]") {
  const TempFolder folder;
  const auto cloud = (folder.path() / "cloud.ply").string();
  REQUIRE(tessera_command({"synth", "--scene", "terrain", "--points", "1000000", "--normals", "-o", cloud})
              .code == 0);
  const auto out = folder.path() / "mesh.ply";
  const CommandResult r = tessera_command(job({cloud}, out, {"--memory", "128M", "-t", "2"}));
  INFO(r.errors);
  REQUIRE(r.code == 0);
  CHECK(r.peak_bytes < (std::uint64_t{128} << 20));
}

TEST_CASE("reconstruct: the smallest cap that plan names does, less is refused by plan", "[memory]") {
  const TempFolder folder;
  const auto cloud = (folder.path() / "cloud.ply").string();
  REQUIRE(
      tessera_command({"synth", "--scene", "terrain", "--points", "20000", "--normals", "-o", cloud}).code ==
      0);
  const auto plan = [&](const std::string& cap) {
    return tessera_command({"plan", cloud, "--progress", "none", "-q", "-t", "2", "--memory", cap});
  };
  const auto named_by = [](const CommandResult& refused) {
    INFO(refused.errors);
    REQUIRE(refused.code == 4);
    const auto at = refused.errors.find("--memory ");
    REQUIRE(at != std::string::npos);
    return std::stoull(refused.errors.substr(at + 9));
  };
  // At once by what no scan is too small for, then by what the survey has found.
  std::uint64_t named = named_by(plan("60M"));
  if (const CommandResult planned = plan(std::to_string(named) + "M"); planned.code != 0)
    named = named_by(planned);
  named <<= 20;
  // What is refused lacks what the job needs for sure; what is named holds what it may need as well, and a whole step
  // of what the process itself holds, which is not the same to the byte in every run.
  CHECK(plan(std::to_string(named - 2 * tessera::MemoryBudget::kBaseStep)).code == 4);
  const CommandResult done = tessera_command(
      job({cloud}, folder.path() / "mesh.ply", {"-t", "2", "--memory", std::to_string(named)}));
  INFO(done.errors);
  CHECK(done.code == 0);
  CHECK(done.peak_bytes <= named);
}

TEST_CASE("reconstruct: plan refuses just the caps that the run refuses, in the same words", "[pipeline]") {
  const TempFolder folder;
  const auto cloud = (folder.path() / "cloud.ply").string();
  REQUIRE(tessera_command(
              {"synth", "--scene", "city", "--points", "60000", "--noise", "0.5s", "-o", cloud, "-t", "1"})
              .code == 0);
  const std::vector<std::vector<std::string>> kinds = {{}, {"--tolerance", "0.05"}, {"--max-hole", "50"}};
  for (const std::vector<std::string>& options : kinds) {
    const auto with_cap = [&](std::vector<std::string> words, unsigned cap) {
      words.insert(words.end(), {"-t", "2", "--memory", std::to_string(cap) + "M"});
      words.insert(words.end(), options.begin(), options.end());
      return words;
    };
    const auto planned = [&](unsigned cap) {
      return tessera_command(with_cap({"plan", cloud, "--progress", "none", "-q"}, cap));
    };
    unsigned refused = 64, enough = 224;
    while (enough - refused > 4) {
      const unsigned middle = (refused + enough) / 2;
      (planned(middle).code == 4 ? refused : enough) = middle;
    }
    for (const unsigned cap : {64u, refused, enough, 224u}) {
      const CommandResult plan = planned(cap);
      const CommandResult run = tessera_command(job({cloud}, folder.path() / "mesh.ply", with_cap({}, cap)));
      std::filesystem::remove_all(folder.path() / "mesh.ply.tessera");
      std::filesystem::remove(folder.path() / "mesh.ply");
      CAPTURE(cap, options, run.errors);
      CHECK(plan.code == (cap <= refused ? 4 : 0));
      CHECK(run.code == plan.code);
      if (run.code == 4) CHECK(plan.errors == run.errors);
    }
  }
}

TEST_CASE("reconstruct: a wall two spacings thick keeps its thickness, its normals given or estimated",
          "[property]") {
  const bool given = GENERATE(true, false);
  CAPTURE(given);
  constexpr double kSpacing = 0.01, kThickness = 2 * kSpacing;
  const TempFolder folder;
  const auto scan = folder.path() / "wall.xyz";
  {
    std::string text = given ? "x y z nx ny nz\n" : "x y z\n";
    Random random(17);
    for (int side = 0; side < 2; ++side)
      for (int i = 0; i < 120 * 90; ++i) {
        const auto near = [&](double at) { return at + 0.07 * kSpacing * random.gaussian(); };
        const double x = near(i % 120 * kSpacing), y = near(side * kThickness), z = near(i / 120 * kSpacing);
        char line[120];
        std::snprintf(line, sizeof line, "%.6f %.6f %.6f%s\n", x, y, z,
                      !given      ? ""
                      : side == 0 ? " 0 -1 0"
                                  : " 0 1 0");
        text += line;
      }
    spill(scan, text);
  }
  const auto out = folder.path() / "wall.ply";
  REQUIRE(tessera_command(job({scan.string()}, out, {"--no-html"})).code == 0);
  double sum[2] = {0, 0};
  std::size_t count[2] = {0, 0}, between = 0;
  for (const tessera::Double3& p : read_whole(out).points) {
    if (p[0] < 0.1 || p[0] > 1.1 || p[2] < 0.1 || p[2] > 0.8) continue;  // away from where it ends
    const std::size_t side = p[1] > kThickness / 2;
    sum[side] += p[1];
    ++count[side];
    between += p[1] > 0.25 * kThickness && p[1] < 0.75 * kThickness;
  }
  REQUIRE(std::min(count[0], count[1]) > 2500);
  const double thickness = sum[1] / static_cast<double>(count[1]) - sum[0] / static_cast<double>(count[0]);
  CHECK(std::fabs(thickness - kThickness) < 0.1 * kSpacing);
  CHECK(static_cast<double>(between) < 0.01 * static_cast<double>(count[0] + count[1]));
}

}  // namespace reconstruct_test
