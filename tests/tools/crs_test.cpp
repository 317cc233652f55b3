// The coordinate system of a scan on its way through the commands.
#include <catch2/catch.hpp>
#include <cmath>
#include <cstdio>
#include <cstring>
#include "stream/files/json.h"
#include "stream/formats/proj_library.h"

#include "tests/helpers/command.h"
#include "tests/helpers/reconstruct_command.h"
#include "tests/helpers/shell.h"
#include "tests/helpers/skip.h"

namespace crs_test {

using namespace tessera::test;
namespace fs = std::filesystem;

namespace {

/// A hill of LAS 1.2 points with a record of its coordinate system.
std::string las_hill(std::uint16_t record_id, const std::string& record, double x, double y) {
  const auto put = [](std::string& bytes, std::size_t at, auto value) {
    std::memcpy(bytes.data() + at, &value, sizeof value);
  };
  constexpr int kSide = 120;
  constexpr std::uint16_t kHead = 227, kRecord = 20;
  std::string las(kHead + 54, '\0');
  las.replace(0, 4, "LASF");
  las[24] = 1, las[25] = 2;
  put(las, 94, kHead), put(las, 96, static_cast<std::uint32_t>(kHead + 54 + record.size())),
      put(las, 100, 1u);
  put(las, 105, kRecord), put(las, 107, static_cast<std::uint32_t>(kSide * kSide));
  const double origin[3] = {x, y, 0.0};
  for (std::size_t a = 0; a < 3; ++a) {
    put(las, 131 + 8 * a, 0.01), put(las, 155 + 8 * a, origin[a]);
    put(las, 179 + 16 * a, origin[a] + (a < 2 ? 0.5 * kSide : 10.0)), put(las, 187 + 16 * a, origin[a]);
  }
  las.replace(kHead + 2, 15, "LASF_Projection");
  put(las, kHead + 18, record_id), put(las, kHead + 20, static_cast<std::uint16_t>(record.size()));
  las += record;
  for (int j = 0; j < kSide; ++j)
    for (int i = 0; i < kSide; ++i) {
      std::string p(kRecord, '\0');
      const double u = (i - kSide / 2) / 30.0, v = (j - kSide / 2) / 40.0;
      const double z = 10.0 / (1.0 + u * u + v * v);
      put(p, 0, std::int32_t{50 * i}), put(p, 4, std::int32_t{50 * j}),
          put(p, 8, static_cast<std::int32_t>(100 * z));
      p[14] = 9;  // the only return
      las += p;
    }
  return las;
}

void check_commands(const TempFolder& folder, const std::string& scan, const std::string& begins,
                    const std::string& other) {
  CHECK(shell(TESSERA_BINARY " info " + other).said.find("system      EPSG:2229 (GeoTIFF keys)") !=
        std::string::npos);
  const fs::path mesh = folder / "mesh.ply", sidecar = folder / "mesh.ply.prj";
  const std::vector<std::string> words = {"reconstruct", scan, "-o", mesh.string()};
  CommandResult r = tessera_command(words);
  INFO(r.errors);
  REQUIRE(r.code == 0);
  CHECK(file_bytes(sidecar).rfind(begins, 0) == 0);
  const auto report = tessera::parse_json(file_bytes(mesh.string() + ".report.json"));
  CHECK(report.at("coordinate_system").at("wkt") == file_bytes(sidecar));
  CHECK(report.at("beside").back().at("path") == sidecar.string());
  CHECK(tessera_command(words).code == 0);  // done already, the file is its own

  // Meshes made of it carry it on.
  const fs::path small = folder / "small.ply", fair = folder / "fair.ply";
  r = tessera_command({"decimate", mesh.string(), "-o", small.string(), "--tolerance", "1", "--no-html"});
  INFO(r.errors);
  REQUIRE(r.code == 0);
  CHECK(file_bytes(small.string() + ".prj") == file_bytes(sidecar));
  REQUIRE(tessera_command({"smooth", small.string(), "-o", fair.string(), "--no-html"}).code == 0);
  CHECK(file_bytes(fair.string() + ".prj") == file_bytes(sidecar));
  fs::remove(small.string() + ".prj");
  REQUIRE(
      tessera_command({"smooth", small.string(), "-o", (folder / "bare.ply").string(), "--no-html"}).code ==
      0);
  CHECK_FALSE(fs::exists(folder / "bare.ply.prj"));

  r = tessera_command({"reconstruct", scan, other, "-o", (folder / "mix.ply").string()});
  CHECK(r.code == 3);
  CHECK(r.errors.find("EPSG:2229") != std::string::npos);
  CHECK_FALSE(fs::exists(folder / "mix.ply.report.json"));  // refused at once
}

}  // namespace

TEST_CASE("coordinate system: info shows it, the report has it, the mesh gets a .prj, a mix is refused",
          "[pipeline]") {
  const TempFolder folder;
  const std::string wkt =
      R"(PROJCS["WGS 84 / UTM zone 32N",GEOGCS["WGS 84",DATUM["WGS_1984",SPHEROID["WGS 84",6378137,298.257223563]],)"
      R"(PRIMEM["Greenwich",0],UNIT["degree",0.0174532925199433]],PROJECTION["Transverse_Mercator"],)"
      R"(PARAMETER["latitude_of_origin",0],PARAMETER["central_meridian",9],PARAMETER["scale_factor",0.9996],)"
      R"(PARAMETER["false_easting",500000],PARAMETER["false_northing",0],UNIT["metre",1],AUTHORITY["EPSG","32632"]])";
  std::string keys;
  for (const int word : {1, 1, 0, 2, 1024, 0, 1, 1, 3072, 0, 1, 2229})
    keys += {static_cast<char>(word & 0xff), static_cast<char>(word >> 8)};
  check_commands(folder, folder.write("scan.las", las_hill(2112, wkt, 400000, 5500000)).string(),
                 "PROJCS[\"WGS 84 / UTM",
                 folder.write("other.las", las_hill(34735, keys, 400000, 5500000)).string());
}

TEST_CASE("coordinate system: the same of real scans", "[pipeline][.shared]") {
  if (!has_shared_data()) return;
  const TempFolder folder;
  const fs::path data = kSharedData / "lidar";
  check_commands(folder, (data / "autzen-trim.las").string(), "PROJCS[\"NAD_1983_HARN",
                 (data / "certainty3d.las").string());
}

namespace {

/// A hill of 30 x 30 m with a house, as longitude, latitude and metres; rows [begin, end) of 100.
std::string degrees(int begin, int end) {
  std::string text;
  for (int i = begin; i < end; ++i)
    for (int j = 0; j < 100; ++j) {
      const double x = 0.3 * i, y = 0.3 * j;
      const double z = 300 + 2 * std::sin(x / 9) * std::cos(y / 11) +
                       (std::abs(x - 15) < 4 && std::abs(y - 15) < 4 ? 5 : 0);
      char line[96];
      std::snprintf(line, sizeof line, "%.9f %.9f %.3f\n", 9 + x / (111320 * std::cos(48 * M_PI / 180)),
                    48 + y / 111320, z);
      text += line;
    }
  return text;
}

}  // namespace

TEST_CASE("coordinate system: a scan in degrees is no surface: refused at once, or projected to its UTM zone",
          "[pipeline]") {
  if (tessera::proj().library == nullptr) return skip("there is no libproj.so.25");
  const TempFolder folder;
  const std::string scan = folder.write("scan.xyz", degrees(0, 100)).string();
  const std::string mesh = (folder / "mesh.ply").string();
  for (const char* command : {"reconstruct", "plan"}) {
    const CommandResult r = tessera_command({command, scan, "-o", mesh});
    CHECK(r.code == 3);
    CHECK(r.errors.find("look like degrees") != std::string::npos);
    CHECK(r.errors.find("--project auto") != std::string::npos);
    CHECK(r.errors.find("EPSG:32632") != std::string::npos);
    CHECK_FALSE(fs::exists(mesh));
    fs::remove_all(mesh + ".tessera");
  }
  CHECK(tessera_command({"reconstruct", scan, "-o", mesh, "--project", "metres"}).code == 2);

  const auto report = reconstructed(scan, mesh, {"--project", "auto"});
  CHECK(report.at("coordinate_system").at("epsg") == 32632);
  CHECK(file_bytes(mesh + ".prj").find("UTM zone 32N") != std::string::npos);
  CHECK(tessera::dump_json(report.at("warnings")).find("projected to WGS 84 / UTM zone 32N") !=
        std::string::npos);
  const auto& points = stage_result(report, "survey");
  CHECK(points.at("spacing").get<double>() > 0.2);
  CHECK(points.at("spacing").get<double>() < 0.5);
  CHECK(checked(mesh, folder.path()).components == 1);  // walls stand between ground and roof

  // The same bytes of parts in another order.
  const std::string second = folder.write("b.xyz", degrees(40, 100)).string(),
                    first = folder.write("a.xyz", degrees(0, 40)).string(),
                    parts = (folder / "parts.ply").string();
  const CommandResult r = tessera_command({"reconstruct", second, first, "-o", parts, "--project", "auto",
                                           "--threads", "1", "--progress", "none"});
  INFO(r.errors);
  REQUIRE(r.code == 0);
  CHECK(file_bytes(parts) == file_bytes(mesh));

  // Of two systems one is made, or both are said to be one.
  const std::string utm =
      folder.write("utm.csv", "x,y,z\n500000,5316300,300\n500000.3,5316300,300\n").string();
  CHECK(tessera_command({"reconstruct", scan, utm, "-o", parts, "--force", "--project", "auto"}).code == 3);
}

}  // namespace crs_test
