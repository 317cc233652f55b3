// The coordinate system of a scan on its way through the commands.
#include <catch2/catch.hpp>

#include <nlohmann/json.hpp>

#include "tests/helpers/command.h"
#include "tests/helpers/shell.h"
#include "tests/helpers/skip.h"

using namespace tessera::test;
namespace fs = std::filesystem;

TEST_CASE("coordinate system: info shows it, the report has it, the mesh gets a .prj, a mix is refused",
          "[pipeline]") {
  if (!has_shared_data()) return;
  const TempFolder folder;
  const std::string autzen = TESSERA_SHARED_DATA "/lidar/autzen-trim.las",
                    other = TESSERA_SHARED_DATA "/lidar/certainty3d.las";
  CHECK(shell(TESSERA_BINARY " info " + other).said.find("system      EPSG:2229 (GeoTIFF keys)") !=
        std::string::npos);
  const fs::path mesh = folder / "mesh.ply", system = folder / "mesh.ply.prj";
  const std::vector<std::string> words = {"reconstruct", autzen, "-o", mesh.string()};
  CommandResult r = tessera_command(words);
  INFO(r.errors);
  REQUIRE(r.code == 0);
  CHECK(file_bytes(system).rfind("PROJCS[\"NAD_1983_HARN", 0) == 0);
  const auto report = nlohmann::json::parse(file_bytes(mesh.string() + ".report.json"));
  CHECK(report.at("coordinate_system").at("wkt") == file_bytes(system));
  CHECK(report.at("beside").back().at("path") == system.string());
  CHECK(tessera_command(words).code == 0);  // done already, the file is its own

  // Meshes made of it carry it on.
  const fs::path small = folder / "small.ply", fair = folder / "fair.ply";
  r = tessera_command({"decimate", mesh.string(), "-o", small.string(), "--tolerance", "1", "--no-html"});
  INFO(r.errors);
  REQUIRE(r.code == 0);
  CHECK(file_bytes(small.string() + ".prj") == file_bytes(system));
  REQUIRE(tessera_command({"smooth", small.string(), "-o", fair.string(), "--no-html"}).code == 0);
  CHECK(file_bytes(fair.string() + ".prj") == file_bytes(system));
  fs::remove(small.string() + ".prj");
  REQUIRE(
      tessera_command({"smooth", small.string(), "-o", (folder / "bare.ply").string(), "--no-html"}).code ==
      0);
  CHECK_FALSE(fs::exists(folder / "bare.ply.prj"));

  r = tessera_command({"reconstruct", autzen, other, "-o", (folder / "mix.ply").string()});
  CHECK(r.code == 3);
  CHECK(r.errors.find("EPSG:2229") != std::string::npos);
  CHECK_FALSE(fs::exists(folder / "mix.ply.report.json"));  // refused at once
}
