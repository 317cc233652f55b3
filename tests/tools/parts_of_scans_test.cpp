// Packed scans and parts of scans as a user takes them: unpacked once, boxes, polygons, cubes, colours.
#include <catch2/catch.hpp>

#include <algorithm>
#include <cmath>

#include "stream/files/json.h"
#include "tests/helpers/command.h"
#include "tests/helpers/copc_file.h"
#include "tests/helpers/killed_command.h"
#include "tests/helpers/point_reading.h"
#include "tests/helpers/temp_folder.h"

namespace parts_of_scans_test {

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
  tessera::Json report;
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
  return {file_bytes(out), tessera::parse_json(file_bytes(out.string() + ".report.json"))};
}

tessera::Json dispositions(const Made& made) {
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
  REQUIRE(resumed_after_kills(words).code == 0);
  CHECK(file_bytes(out) == want);
}

TEST_CASE("parts: one point of a cube, the same whatever format and order of the inputs", "[pipeline]") {
  const std::string laz = (scans() / "scan.laz").string(), las = (scans() / "scan.las").string();
  const std::vector<std::string> options = {"--thin", "12", "--resolution", "15"};
  const Made want = mesh_of({laz}, options);
  const tessera::Json f = dispositions(want);
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
  CHECK(dispositions(half).at("outside").get<int>() > 1000);
  CHECK(dispositions(half).at("outside").get<int>() + dispositions(half).at("kept").get<int>() == 60000);
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

TEST_CASE("parts: a scan whose points are all black has no colours, which is said", "[pipeline]") {
  std::string las = file_bytes(scans() / "scan.las");
  std::uint32_t first = 0;
  std::memcpy(&first, las.data() + 96, sizeof first);
  const int format = las[104] & 63;
  REQUIRE((format == 2 || format == 3 || format == 7));
  std::uint16_t size = 0;
  std::memcpy(&size, las.data() + 105, sizeof size);
  const std::size_t rgb = format == 2 ? 20 : format == 3 ? 28 : 30;
  for (std::size_t at = first; at + size <= las.size(); at += size)
    std::fill_n(las.begin() + static_cast<std::ptrdiff_t>(at + rgb), 6, '\0');
  const TempFolder folder;
  const auto black = folder.write("black.las", las);
  const fs::path mesh = folder / "mesh.ply";
  const CommandResult r = tessera_command({"reconstruct", black.string(), "-o", mesh.string(), "--resolution",
                                           "8", "--no-html", "--progress", "none"});
  INFO(r.errors);
  REQUIRE(r.code == 0);
  CHECK(r.errors.find("every point is black") != std::string::npos);
  CHECK(file_bytes(mesh).find("property uchar red") == std::string::npos);
  // One point that is not black is enough.
  las[first + rgb] = las[first + rgb + 1] = '\x7f';
  const auto dark = folder.write("dark.las", las);
  REQUIRE(tessera_command({"reconstruct", dark.string(), "-o", mesh.string(), "--resolution", "8",
                           "--no-html", "--progress", "none", "--force"})
              .code == 0);
  CHECK(file_bytes(mesh).find("property uchar red") != std::string::npos);
}

TEST_CASE("parts: convert keeps of scans what reconstruct would, the same on any number of threads",
          "[pipeline]") {
  const TempFolder folder;
  // Classes and returns by number: 0, 1, 2, ... and 1 of 1, 1 of 2, 2 of 2, ...
  std::string las = file_bytes(scans() / "scan.las");
  std::uint32_t at = 0;
  std::memcpy(&at, las.data() + 96, sizeof at);
  const std::size_t record =
      static_cast<unsigned char>(las[105]) + 256u * static_cast<unsigned char>(las[106]);
  REQUIRE(las[104] >= 6);
  for (std::size_t i = 0; i < 60000; ++i) {
    las[at + i * record + 14] = i % 3 == 0 ? 0x11 : i % 3 == 1 ? 0x21 : 0x22;
    las[at + i * record + 16] = static_cast<char>(i % 4);
  }
  const std::string in = folder.write("in.las", las).string();
  const auto kept = [&](const std::string& name, std::vector<std::string> more) {
    std::vector<std::string> words = {"convert", in, "-o", (folder / name).string(), "--force"};
    words.insert(words.end(), more.begin(), more.end());
    const CommandResult r = tessera_command(words);
    INFO(r.errors);
    REQUIRE(r.code == 0);
    more.insert(more.begin(), {"convert", in, "-o", (folder / "one.las").string(), "--force", "-t", "1"});
    if (name == "out.las") {
      REQUIRE(tessera_command(more).code == 0);
      CHECK(file_bytes(folder / "one.las") == file_bytes(folder / name));
    }
    return read_points(folder / name);
  };
  const ReadResult whole = read_points(in);
  REQUIRE(whole.points.size() == 60000);
  const ReadResult classes = kept("out.las", {"--classes", "1,2", "--returns", "last"});
  CHECK(classes.points.size() == 20000);  // 30,000 of these classes, one in three of them no last return
  for (const tessera::Echo& e : classes.points.echo) REQUIRE(((e.kind == 1 || e.kind == 2) && e.last()));
  const ReadResult box = kept("out.las", {"--bounds=-1e6,-1e6,-1e6,1e6,500.00005,1e6"});
  CHECK(box.points.size() > 1000);
  CHECK(box.points.size() ==
        static_cast<std::size_t>(std::count_if(whole.points.y.begin(), whole.points.y.end(),
                                               [](double y) { return y < 500.00005; })));
  const auto clip = folder.write(
      "clip.geojson",
      R"({"type":"Polygon","coordinates":[[[-1e6,-1e6],[1e6,-1e6],[1e6,500.00005],[-1e6,500.00005]]]})");
  CHECK(same_points(kept("clip.las", {"--clip", clip.string()}).points, box.points));

  const ReadResult thin = kept("out.las", {"--thin", "12"});
  const Made mesh = mesh_of({in}, {"--thin", "12", "--resolution", "15", "--classes", "0,1,2,3"});
  CHECK(static_cast<int>(thin.points.size()) == dispositions(mesh).at("kept").get<int>());
  CHECK(thin.points.echo.size() == thin.points.size());
  CHECK(thin.points.rgba.size() == thin.points.size());
  std::vector<tessera::Double3> cubes;
  for (std::size_t i = 0; i < thin.points.size(); ++i)
    cubes.push_back({std::floor(thin.points.x[i] / 12), std::floor(thin.points.y[i] / 12),
                     std::floor(thin.points.z[i] / 12)});
  std::sort(cubes.begin(), cubes.end());
  CHECK(std::adjacent_find(cubes.begin(), cubes.end()) == cubes.end());

  const auto code = [&](const std::string& from, const std::string& to,
                        const std::vector<std::string>& more) {
    std::vector<std::string> words = {"convert", from, "-o", (folder / to).string(), "--force"};
    words.insert(words.end(), more.begin(), more.end());
    return tessera_command(words).code;
  };
  CHECK(code(in, "none.las", {"--bounds", "1e7,1e7,1e7,2e7,2e7,2e7"}) == 5);
  CHECK_FALSE(fs::exists(folder / "none.las"));
  CHECK(code(in, "none.las", {"--bounds", "1,2,3"}) == 2);
  CHECK(code(folder.write("plain.xyz", "0 0 0\n1 1 1\n").string(), "none.las", {"--returns", "last"}) == 2);
  const auto mesh_in = folder.write("m.off", "OFF 3 1 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n");
  CHECK(code(mesh_in.string(), "m.stl", {"--thin", "1"}) == 2);
}

TEST_CASE(
    "parts: rows and columns of a scanner give normals where nearly all points get one, the same any way",
    "[pipeline]") {
  const TempFolder folder;
  const std::string ptx = (folder / "room.ptx").string();
  REQUIRE(tessera_command({"synth", "--scene", "indoor", "--mode", "terrestrial", "--points", "150k",
                           "--noise", "0.002", "-o", ptx})
              .code == 0);
  const Made grid = mesh_of({ptx}, {"-t", "1", "--memory", "192M"});
  CHECK(grid.report.at("normals").at("from") == "rows and columns of the scans");
  CHECK(mesh_of({ptx}, {"-t", "2", "--memory", "1G"}).mesh == grid.mesh);
  CHECK(mesh_of({ptx}, {"-t", "2", "--processes"}).mesh == grid.mesh);
  CHECK(mesh_of({ptx}, {"--normals", "given"}).mesh == grid.mesh);
  const Made fitted = mesh_of({ptx}, {"--normals", "estimate"});
  CHECK(fitted.report.at("normals").at("from") == "estimated");
  CHECK(fitted.mesh != grid.mesh);
  // The scanner's noise is told the better of both by the truth.
  const auto off = [&](const Made& made) {
    const auto mesh = folder.write("mesh.ply", made.mesh);
    const auto report_path = folder / "check.json";
    REQUIRE(tessera_command({"check", mesh.string(), "--truth", ptx + ".truth.json", "--report",
                             report_path.string(), "--force"})
                .code == 0);
    return tessera::parse_json(file_bytes(report_path));
  };
  CHECK(off(grid).at("truth").at("vertices").at("mean_h").get<double>() <
        off(fitted).at("truth").at("vertices").at("mean_h").get<double>());
}

}  // namespace parts_of_scans_test
