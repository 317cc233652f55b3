// Packed scans and parts of scans as a user takes them: unpacked once, boxes, polygons, cubes, colours.
#include <catch2/catch.hpp>

#include <nlohmann/json.hpp>

#include "tests/helpers/command.h"
#include "tests/helpers/copc_file.h"
#include "tests/helpers/temp_folder.h"

using namespace tessera::test;
namespace fs = std::filesystem;

namespace {

/// A scan as LAZ and its twin as LAS, made once per process.
const TempFolder& scans() {
  static const TempFolder folder;
  static const bool made = [] {
    const std::string laz = (folder / "scan.laz").string();
    REQUIRE(tessera_command({"synth", "--scene", "terrain", "--points", "60000", "--noise", "0.1s",
                             "--colour", "-o", laz})
                .code == 0);
    REQUIRE(tessera_command({"convert", laz, "-o", (folder / "scan.las").string(), "--las-scale", "0.0001"})
                .code == 0);
    REQUIRE(tessera_command(
                {"convert", (folder / "scan.las").string(), "-o", laz, "--las-scale", "0.0001", "--force"})
                .code == 0);
    return true;
  }();
  REQUIRE(made);
  return folder;
}

struct Made {
  std::string mesh;
  nlohmann::json report;
};

Made mesh_of(const std::vector<std::string>& inputs, const std::vector<std::string>& more) {
  const TempFolder folder;
  const auto out = folder / "mesh.ply";
  std::vector<std::string> words = {"reconstruct"};
  words.insert(words.end(), inputs.begin(), inputs.end());
  words.insert(words.end(), {"-o", out.string(), "--progress", "none", "-q", "--no-html"});
  words.insert(words.end(), more.begin(), more.end());
  const CommandResult r = tessera_command(words);
  INFO(r.errors);
  REQUIRE(r.code == 0);
  CHECK_FALSE(fs::exists(out.string() + ".tessera"));
  return {file_bytes(out), nlohmann::json::parse(file_bytes(out.string() + ".report.json"))};
}

nlohmann::json fates(const Made& made) {
  for (const auto& stage : made.report.at("stages"))
    if (stage.at("name") == "survey") return stage.at("result").at("points");
  return {};
}

}  // namespace

TEST_CASE("parts: LAZ, unpacked once, gives the mesh of its twin for any threads, caps and stops",
          "[pipeline]") {
  const std::string laz = (scans() / "scan.laz").string(), las = (scans() / "scan.las").string();
  const std::string want = mesh_of({las}, {}).mesh;
  REQUIRE(want.size() > 100'000);
  CHECK(mesh_of({laz}, {}).mesh == want);
  CHECK(mesh_of({laz}, {"-t", "1", "--memory", "192M"}).mesh == want);
  CHECK(mesh_of({laz}, {"--processes", "-t", "2"}).mesh == want);
  const TempFolder folder;
  const auto out = folder / "mesh.ply";
  std::vector<std::string> words = {"reconstruct", laz, "-o", out.string(), "--progress", "none", "-q"};
  for (const char* stage : {"unpack", "thin", "probe", "survey", "distribute"}) {
    auto until = words;
    until.insert(until.end(), {"--until", stage});
    CHECK(tessera_command(until).code == 7);
    const bool needed = std::string(stage) != "distribute";
    CHECK(fs::exists(out.string() + ".tessera/unpacked/000000.points") == needed);
  }
  REQUIRE(tessera_command(words).code == 0);
  CHECK(file_bytes(out) == want);
}

TEST_CASE("parts: killed while it unpacks and thins, the same command ends in the same bytes", "[fault]") {
  const std::string laz = (scans() / "scan.laz").string();
  const std::string want = mesh_of({laz}, {"--thin", "12", "--resolution", "15"}).mesh;
  const TempFolder folder;
  const auto out = folder / "mesh.ply";
  const std::vector<std::string> words = {"reconstruct", laz,    "-o",           out.string(),
                                          "--thin",      "12",   "--resolution", "15",
                                          "--progress",  "none", "-q",           "--no-html"};
  int kills = 0;
  for (unsigned after = 5; after < 400; after = after * 6 / 5 + 3)
    kills += tessera_command(words, after).code == 128 + SIGKILL ? 1 : 0;
  CHECK(kills > 0);
  REQUIRE(tessera_command(words).code == 0);
  CHECK(file_bytes(out) == want);
}

TEST_CASE("parts: one point of a cube, the same whatever format and order of the inputs", "[pipeline]") {
  const std::string laz = (scans() / "scan.laz").string(), las = (scans() / "scan.las").string();
  const std::vector<std::string> options = {"--thin", "12", "--resolution", "15"};
  const Made want = mesh_of({laz}, options);
  const nlohmann::json f = fates(want);
  CHECK(f.at("read") == 60000);
  CHECK(f.at("thinned").get<int>() > 10000);
  CHECK(f.at("thinned").get<int>() + f.at("kept").get<int>() == 60000);
  CHECK(mesh_of({las}, options).mesh == want.mesh);
  CHECK(mesh_of({las, laz}, options).mesh == want.mesh);
  CHECK(mesh_of({laz, las}, {"--thin", "12", "--resolution", "15", "-t", "1", "--memory", "192M"}).mesh ==
        want.mesh);
}

TEST_CASE("parts: a box and a polygon leave out what lies outside, and are part of the job", "[pipeline]") {
  const std::string laz = (scans() / "scan.laz").string(), las = (scans() / "scan.las").string();
  const Made all = mesh_of({las}, {"--resolution", "8"});
  const TempFolder folder;
  const auto clip = folder.write(
      "clip.geojson",
      R"({"type":"Polygon","coordinates":[[[-1e6,-1e6],[1e6,-1e6],[1e6,500.00005],[-1e6,500.00005]]]})");
  const Made half = mesh_of({las}, {"--resolution", "8", "--clip", clip.string()});
  CHECK(fates(half).at("outside").get<int>() > 1000);
  CHECK(fates(half).at("outside").get<int>() + fates(half).at("kept").get<int>() == 60000);
  CHECK(mesh_of({laz}, {"--resolution", "8", "--bounds=-1e6,-1e6,-1e6,1e6,500.00005,1e6"}).mesh == half.mesh);
  CHECK(half.mesh.size() < all.mesh.size());
  CommandResult r = tessera_command(
      {"reconstruct", las, "-o", (folder / "m.ply").string(), "--bounds", "1e7,1e7,1e7,2e7,2e7,2e7"});
  CHECK(r.code == 5);
  CHECK(r.errors.find("--bounds 1e7") != std::string::npos);
  r = tessera_command(
      {"reconstruct", las, "-o", (folder / "m.ply").string(), "--bounds", "1,2,3", "--force"});
  CHECK(r.code == 2);
  r = tessera_command({"reconstruct", las, "-o", (folder / "m.ply").string(), "--clip", las, "--force"});
  CHECK(r.code == 3);
  r = tessera_command(
      {"reconstruct", las, "-o", (folder / "m.ply").string(), "--resolution-limit", "1", "--force"});
  CHECK(r.code == 2);
}

TEST_CASE("parts: the octree of COPC, read in part and refused where it lies", "[pipeline]") {
  const TempFolder folder;
  const CopcFile f = copc_file();
  const auto path = folder.write("a.copc.laz", f.bytes);
  const auto plan = [&](const std::string& file, const std::vector<std::string>& more) {
    std::vector<std::string> words = {"plan", file, "--resolution", "20", "--classes"};
    std::string classes = "0";
    for (int c = 1; c < 256; ++c) classes += "," + std::to_string(c);
    words.push_back(classes);
    words.insert(words.end(), more.begin(), more.end());
    return tessera_command(words);
  };
  CHECK(plan(path.string(), {}).code == 0);
  CHECK(plan(path.string(), {"--resolution-limit", "4"}).code == 0);
  CHECK(plan(path.string(), {"--bounds", "499900,499900,499900,500000,500000,500000"}).code == 0);
  std::string lie = f.bytes;
  set_bytes(lie, f.root + 28, std::int32_t{39});
  const auto bad = folder.write("b.copc.laz", lie);
  CHECK(plan(bad.string(), {}).code == 0);
  const CommandResult r = plan(bad.string(), {"--resolution-limit", "4"});
  CHECK(r.code == 3);
  CHECK(r.errors.find("octree") != std::string::npos);
}

TEST_CASE("parts: colours by height, intensity and class reach the vertices", "[pipeline]") {
  const std::string las = (scans() / "scan.las").string();
  std::vector<std::string> meshes;
  for (const char* colour : {"rgb", "intensity", "class", "height", "none"}) {
    meshes.push_back(mesh_of({las}, {"--resolution", "8", "--colour", colour}).mesh);
    CAPTURE(colour);
    CHECK((meshes.back().find("property uchar red") != std::string::npos) == (std::string(colour) != "none"));
    for (std::size_t k = 0; k + 1 < meshes.size(); ++k) CHECK(meshes[k] != meshes.back());
  }
  CHECK(mesh_of({(scans() / "scan.laz").string()}, {"--resolution", "8", "--colour", "height"}).mesh ==
        meshes[3]);
}
