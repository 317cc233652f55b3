// What commands extract does not cross itself: features and borders that would make faces cross give way.
#include <catch2/catch.hpp>

#include <nlohmann/json.hpp>

#include "octree/portable_math.h"
#include "tests/helpers/command.h"
#include "tests/helpers/mesh_files.h"
#include "tests/helpers/random.h"
#include "tests/helpers/reconstruct_command.h"

namespace uncross_test {

namespace {

using namespace tessera;
using namespace tessera::test;
namespace fs = std::filesystem;

/// A ball of which every vertex was moved: no two faces of it lie in one plane, so most cells hold a feature.
WholeMesh rough_ball() {
  constexpr int kRings = 60, kAround = 2 * kRings;
  Random random(3);
  WholeMesh mesh;
  for (int i = 0; i <= kRings; ++i)
    for (int j = 0; j < kAround; ++j) {
      const double polar = 180.0 * i / kRings, round = 360.0 * j / kAround,
                   r = 1.0 + 0.03 * random.gaussian();
      const double flat = cosine_of_degrees(90.0 - polar);
      mesh.points.push_back({r * flat * cosine_of_degrees(round), r * flat * cosine_of_degrees(90.0 - round),
                             r * cosine_of_degrees(polar)});
    }
  for (int i = 0; i < kRings; ++i)
    for (int j = 0; j < kAround; ++j) {
      const auto at = [&](int k, int l) { return static_cast<std::uint64_t>(k * kAround + l % kAround); };
      if (i > 0) mesh.faces.push_back({at(i, j), at(i + 1, j), at(i, j + 1)});
      if (i + 1 < kRings) mesh.faces.push_back({at(i, j + 1), at(i + 1, j), at(i + 1, j + 1)});
    }
  mesh.header.vertices = mesh.points.size();
  mesh.header.faces = mesh.faces.size();
  return mesh;
}

/// Pairs that cross, overlap or touch, by the command.
nlohmann::json crossings_of(const fs::path& mesh) {
  const fs::path report = mesh.string() + ".check.json";
  const CommandResult r =
      tessera_command({"check", mesh.string(), "--crossings", "--report", report.string(), "--force"});
  INFO(r.errors);
  REQUIRE(r.code == 0);
  return nlohmann::json::parse(file_bytes(report)).at("crossings");
}

std::uint64_t pairs_found(const fs::path& mesh) {
  const nlohmann::json report = nlohmann::json::parse(file_bytes(mesh.string() + ".report.json"));
  return stage_result(report, "uncross-1").at("crossing_pairs").get<std::uint64_t>();
}

void check_sound(const fs::path& mesh) {
  const nlohmann::json crossings = crossings_of(mesh);
  INFO(crossings.dump());
  CHECK(crossings.at("cross") == 0);
  CHECK(crossings.at("overlap") == 0);
  CHECK(crossings.at("touch") == 0);
}

}  // namespace

TEST_CASE("uncross: a solid full of features does not cross itself, the same bytes whatever runs",
          "[property]") {
  const TempFolder folder;
  write_whole(folder / "ball.ply", rough_ball());
  const fs::path out = folder / "out.ply";
  const auto run = [&](std::vector<std::string> more) {
    more.insert(more.begin(), {"resurface", (folder / "ball.ply").string(), "-o", out.string(), "--force",
                               "--resolution", "0.03", "--progress", "none", "-q"});
    const CommandResult r = tessera_command(more);
    INFO(r.errors);
    REQUIRE(r.code == 0);
    return file_bytes(out);
  };
  const std::string bytes = run({"-t", "1"});
  CHECK(pairs_found(out) > 300);
  check_sound(out);
  CHECK(run({"-t", "2", "--tile-size", "64", "--memory", "160M"}) == bytes);
  CHECK(run({"-t", "2", "--tile-size", "128", "--processes"}) == bytes);
}

TEST_CASE("uncross: a noisy scan with torn borders does not cross itself, the same bytes whatever runs",
          "[property]") {
  const TempFolder folder;
  const std::string scan = (folder / "scan.ply").string();
  REQUIRE(tessera_command({"synth", "--scene", "city", "--points", "60k", "--noise", "1.5s", "--noise-length",
                           "4s", "-o", scan})
              .code == 0);
  const fs::path out = folder / "out.ply";
  for (const std::string border : {"auto", "raw"}) {
    CAPTURE(border);
    const auto run = [&](std::vector<std::string> more) {
      more.insert(more.end(), {"--border", border, "--force"});
      reconstructed(scan, out, more);
      return file_bytes(out);
    };
    const std::string bytes = run({"-t", "1"});
    CHECK(pairs_found(out) > 0);
    check_sound(out);
    CHECK(run({"-t", "2", "--tile-size", "64"}) == bytes);
  }
}

}  // namespace uncross_test
