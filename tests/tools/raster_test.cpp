// `raster` on meshes whose heights are known, read back by GDAL's own programs.
#include <catch2/catch.hpp>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <functional>
#include <string>
#include <vector>

#include "stream/files/json.h"
#include "tests/helpers/command.h"
#include "tests/helpers/geotiff.h"
#include "tests/helpers/height_sheet.h"
#include "tests/helpers/shell.h"
#include "tests/helpers/temp_folder.h"

namespace raster_test {

using namespace tessera::test;
namespace fs = std::filesystem;

namespace {

constexpr double kX = 500000.0, kY = 5400000.0;
constexpr float kNoData = -9999.0F;

std::string heights(int steps, double size, const std::function<double(double, double)>& height) {
  return height_sheet(steps, size, kX, kY, height);
}

void make(const std::vector<std::string>& words) {
  std::vector<std::string> all = {"raster"};
  all.insert(all.end(), words.begin(), words.end());
  const CommandResult r = tessera_command(all);
  INFO(r.errors);
  REQUIRE(r.code == 0);
}

double ramp(double x, double y) {
  return 300.0 + 0.25 * x - 0.125 * y;
}

}  // namespace

TEST_CASE("raster: a plane at survey coordinates has its exact heights, slope, place, system and statistics",
          "[pipeline]") {
  if (!has_gdal()) return;
  const TempFolder folder;
  const fs::path mesh = folder.write("ramp.off", heights(7, 40.25, ramp)), out = folder / "dtm.tif";
  folder.write(
      "ramp.off.prj",
      R"(PROJCS["WGS 84 / UTM zone 32N",GEOGCS["WGS 84",DATUM["WGS_1984",SPHEROID["WGS 84",6378137,298.257223563]],PRIMEM["Greenwich",0],UNIT["degree",0.0174532925199433]],PROJECTION["Transverse_Mercator"],PARAMETER["latitude_of_origin",0],PARAMETER["central_meridian",9],PARAMETER["scale_factor",0.9996],PARAMETER["false_easting",500000],PARAMETER["false_northing",0],UNIT["metre",1],AUTHORITY["EPSG","32632"]])");
  make({mesh.string(), "-o", out.string(), "--cell", "0.5", "--layer", "top", "--layer", "slope", "--layer",
        "hillshade"});
  const fs::path top = folder / "dtm.top.tif";
  const tessera::Json about = geotiff_info(top);
  // 40.25 in cells of 0.5: the last ones have their centres on the border, which belongs to the mesh.
  REQUIRE(about.at("size") == tessera::Json({81, 81}));
  CHECK(about.at("geoTransform") == tessera::Json({kX, 0.5, 0.0, kY + 40.5, 0.0, -0.5}));
  CHECK(about.at("coordinateSystem").at("wkt").get<std::string>().find("UTM zone 32N") != std::string::npos);
  CHECK(about.at("metadata").at("IMAGE_STRUCTURE").at("LAYOUT") == "COG");
  const tessera::Json& band = about.at("bands")[0];
  CHECK(band.at("noDataValue") == -9999.0);
  CHECK(band.at("unit") == "metre");
  const std::vector<float> cells = geotiff_values<float>(top);
  float low = 1e9F, high = -1e9F;
  double sum = 0.0;
  bool exact = true;
  for (int r = 0; r < 81; ++r)
    for (int c = 0; c < 81; ++c) {
      const float value = cells[static_cast<std::size_t>(81 * r + c)];
      const double want = ramp(0.5 * (c + 0.5), 40.5 - 0.5 * (r + 0.5));
      exact = exact && std::abs(value - want) < 1e-4;
      low = std::min(low, value), high = std::max(high, value), sum += value;
    }
  CHECK(exact);
  const tessera::Json& statistics = band.at("metadata").at("");
  const auto number = [&](const char* key) { return std::stod(statistics.at(key).get<std::string>()); };
  CHECK(number("STATISTICS_MINIMUM") == Approx(low).margin(1e-5));
  CHECK(number("STATISTICS_MAXIMUM") == Approx(high).margin(1e-5));
  CHECK(number("STATISTICS_MEAN") == Approx(sum / 6561).margin(1e-4));
  CHECK(number("STATISTICS_VALID_PERCENT") == 100.0);
  const double rise = std::sqrt(0.25 * 0.25 + 0.125 * 0.125);
  for (const float slope : geotiff_values<float>(folder / "dtm.slope.tif"))
    if (std::abs(slope - std::atan(rise) * 180.0 / M_PI) > 1e-4) FAIL("a slope of " << slope);
  CHECK(geotiff_info(folder / "dtm.slope.tif").at("bands")[0].at("unit") == "degree");
  // The normal is (-0.25, 0.125, 1), the sun (-0.5, 0.5, sqrt(0.5)).
  const double light = (0.125 + 0.0625 + std::sqrt(0.5)) / std::sqrt(1.0 + rise * rise);
  for (const std::uint8_t shade : geotiff_values<std::uint8_t>(folder / "dtm.hillshade.tif"))
    if (shade != static_cast<int>(std::floor(1.5 + 254.0 * light))) FAIL("a shade of " << int{shade});
}

TEST_CASE("raster: a roof over the ground, a hole in both, and nothing outside", "[pipeline]") {
  if (!has_gdal()) return;
  const TempFolder folder;
  // Ground over [0, 8] x [0, 4], a roof over [2, 6] x [1, 3]; east of x = 8 nothing but a far triangle.
  const auto at = [](double x, double y, double z) {
    char line[120];
    std::snprintf(line, sizeof line, "%.17g %.17g %.17g\n", kX + x, kY + y, z);
    return std::string(line);
  };
  const fs::path mesh =
      folder.write("yard.off", "OFF 11 3 0\n" + at(0, 0, 10) + at(8, 0, 10) + at(8, 4, 10) + at(0, 4, 10) +
                                   at(2, 1, 14) + at(6, 1, 14) + at(6, 3, 15) + at(2, 3, 15) + at(10, 0, 1) +
                                   at(12, 0, 1) + at(12, 1, 1) + "4 0 1 2 3\n4 4 5 6 7\n3 8 9 10\n");
  make({mesh.string(), "-o", (folder / "yard.tif").string(), "--cell", "1", "--layer", "top", "--layer",
        "ground", "--layer", "height", "--layer", "missing"});
  const auto top = geotiff_values<float>(folder / "yard.top.tif"),
             ground = geotiff_values<float>(folder / "yard.ground.tif"),
             height = geotiff_values<float>(folder / "yard.height.tif");
  const auto missing = geotiff_values<std::uint8_t>(folder / "yard.missing.tif");
  REQUIRE(top.size() == 48);
  const auto cell = [](int x, int y) { return static_cast<std::size_t>(12 * (3 - y) + x); };
  for (int y = 0; y < 4; ++y)
    for (int x = 0; x < 12; ++x) {
      CAPTURE(x, y);
      const std::size_t k = cell(x, y);
      const bool roof = x >= 2 && x < 6 && (y == 1 || y == 2), far = x == 11 && y == 0;
      const bool covered = x < 8 || far;
      const float under = x < 8 ? 10.0F : 1.0F;
      CHECK(missing[k] == (covered ? 0 : 1));
      CHECK(ground[k] == (covered ? under : kNoData));
      CHECK(height[k] == (covered ? (roof ? (y == 1 ? 4.25F : 4.75F) : 0.0F) : kNoData));
      CHECK(top[k] == (covered ? under + height[k] : kNoData));
    }
  CHECK(geotiff_info(folder / "yard.ground.tif")
            .at("bands")[0]
            .at("metadata")
            .at("")
            .at("STATISTICS_VALID_PERCENT") != "100");
}

TEST_CASE("raster: an orthophoto has the colours of the vertices, holes are transparent", "[pipeline]") {
  if (!has_gdal()) return;
  const TempFolder folder;
  const fs::path mesh =
      folder.write("patch.ply",
                   "ply\nformat ascii 1.0\nelement vertex 4\nproperty float x\nproperty "
                   "float y\nproperty float z\nproperty uchar red\nproperty uchar "
                   "green\nproperty uchar blue\nelement face 1\nproperty list uchar int "
                   "vertex_indices\nend_header\n0 0 5 200 0 10\n4 0 5 0 200 10\n0 4 5 0 0 10\n"
                   "4 4 9 9 9 9\n3 0 1 2\n");
  make({mesh.string(), "-o", (folder / "o.tif").string(), "--cell", "1", "--layer", "ortho"});
  const auto rgba = geotiff_values<std::uint8_t>(folder / "o.tif");
  REQUIRE(rgba.size() % 4 == 0);
  REQUIRE(rgba.size() == 64);
  const auto pixel = [&](int x, int y) {
    const std::size_t k = 4 * static_cast<std::size_t>(4 * (3 - y) + x);
    return std::vector<int>{rgba[k], rgba[k + 1], rgba[k + 2], rgba[k + 3]};
  };
  CHECK(pixel(0, 0) == std::vector<int>{150, 25, 10, 255});  // weights 3/4, 1/8, 1/8
  CHECK(pixel(2, 0) == std::vector<int>{50, 125, 10, 255});
  CHECK(pixel(3, 3) == std::vector<int>{0, 0, 0, 0});
  const tessera::Json about = geotiff_info(folder / "o.tif");
  CHECK(about.at("bands")[3].at("colorInterpretation") == "Alpha");
  const CommandResult none =
      tessera_command({"raster", folder.write("grey.off", heights(2, 4.0, ramp)).string(), "-o",
                       (folder / "p.tif").string(), "--cell", "1", "--layer", "ortho"});
  CHECK(none.code == 2);
  CHECK_THAT(none.errors, Catch::Contains("no colours"));
}

TEST_CASE("raster: the same bytes with any cap, threads and windows, with overviews as a COG has them",
          "[pipeline]") {
  if (!has_gdal()) return;
  const TempFolder folder;
  const fs::path mesh =
      folder.write("cone.off", heights(150, 300.0, [](double x, double y) {
                     return 50.0 - 0.2 * std::hypot(x - 150.0, y - 150.0) + std::sin(x) * 0.3;
                   }));
  const std::vector<std::string> layers = {"top", "hillshade", "missing"};
  const auto run = [&](const std::string& name, const std::vector<std::string>& how) {
    std::vector<std::string> words = {mesh.string(), "-o", (folder / (name + ".tif")).string(), "--cell",
                                      "0.25"};
    for (const std::string& layer : layers) words.insert(words.end(), {"--layer", layer});
    words.insert(words.end(), how.begin(), how.end());
    make(words);
    std::string all;
    for (const std::string& layer : layers) all += file_bytes(folder / (name + "." + layer + ".tif"));
    return all;
  };
  const std::string want = run("a", {"--memory", "2G", "-t", "2"});
  CHECK((run("b", {"--memory", "128M", "-t", "1"}) == want));
  CHECK((run("c", {"--tile", "100", "-t", "2"}) == want));
  CHECK((run("d", {"--tile", "1024", "-t", "1"}) == want));
  const tessera::Json about = geotiff_info(folder / "a.top.tif");
  // GDAL's own judge of the format, where Python has it.
  const std::string judge = "osgeo_utils.samples.validate_cloud_optimized_geotiff";
  if (shell("/usr/bin/python3 -c 'import " + judge + "'").code == 0)
    for (const std::string& layer : layers)
      CHECK_THAT(
          shell("/usr/bin/python3 -m " + judge + " " + (folder / ("a." + layer + ".tif")).string()).said,
          Catch::Contains("is a valid cloud optimized GeoTIFF"));
  CHECK(about.at("bands")[0].at("overviews").size() == 2);
  CHECK(about.at("metadata").at("IMAGE_STRUCTURE").at("LAYOUT") == "COG");
  CHECK(about.at("metadata").at("IMAGE_STRUCTURE").at("COMPRESSION") == "DEFLATE");
  // The cone, under its tip and half way down.
  const auto cells = geotiff_values<float>(folder / "a.top.tif");
  const auto at = [&](int x, int y) {
    return static_cast<double>(cells[static_cast<std::size_t>((1199 - y) * 1200 + x)]);
  };
  CHECK(at(600, 600) == Approx(50.0 + 0.3 * std::sin(150.0)).margin(0.1));
  CHECK(at(600, 300) == Approx(50.0 - 0.2 * 75.0 + 0.3 * std::sin(150.0)).margin(0.1));
}

TEST_CASE("raster: nine million cells stay below a cap of 128 MiB, GDAL included", "[memory]") {
  const TempFolder folder;
  const fs::path mesh = folder.write("ramp.off", heights(100, 300.0, ramp));
  const CommandResult r =
      tessera_command({"raster", mesh.string(), "-o", (folder / "dtm.tif").string(), "--cell", "0.1",
                       "--layer", "top,slope", "--memory", "128M", "-t", "2"});
  INFO(r.errors);
  REQUIRE(r.code == 0);
  CHECK(r.peak_bytes < std::uint64_t{128} << 20);
}

TEST_CASE("raster: stopped by a signal it leaves nothing behind", "[fault]") {
  const TempFolder folder;
  const fs::path mesh = folder.write("ramp.off", heights(20, 40.0, ramp)), scratch = folder / "scratch";
  fs::create_directory(scratch);
  for (const char* fault : {"TESSERA_FAULT=stop:1", "TESSERA_FAULT=stop:4"}) {
    const CommandResult r = tessera_command({"raster", mesh.string(), "-o", (folder / "dtm.tif").string(),
                                             "--cell", "0.5", "--tile", "16", "--temp", scratch.string()},
                                            0, fault);
    CAPTURE(fault, r.errors);
    CHECK(r.code == 143);
    CHECK(fs::is_empty(scratch));
    CHECK(std::distance(fs::directory_iterator(folder.path()), fs::directory_iterator()) == 2);
  }
}

TEST_CASE("raster: what cannot be is refused in a sentence, and nothing is left", "[pipeline]") {
  const TempFolder folder;
  const fs::path mesh = folder.write("ramp.off", heights(2, 4.0, ramp)), out = folder / "dtm.tif";
  const auto refused = [&](std::vector<std::string> words, int code, const std::string& why) {
    words.insert(words.begin(), "raster");
    const CommandResult r = tessera_command(words);
    CAPTURE(words, r.errors);
    CHECK(r.code == code);
    CHECK_THAT(r.errors, Catch::Contains(why));
  };
  const std::string in = mesh.string(), to = out.string();
  refused({in, "-o", to}, 2, "--cell is missing");
  refused({in, "-o", to, "--cell", "1", "--layer", "aspect"}, 2, "there are top, ground");
  refused({in, "-o", (folder / "dtm.png").string(), "--cell", "1"}, 2, ".tif");
  refused({in, "-o", to, "--cell", "1e-9"}, 2, "--cell 1e-09");
  refused({in, "-o", to, "--cell", "1", "--nodata", "300.3125"}, 2, "--nodata");
  refused({in, "-o", to, "--cell", "1", "--crs", "EPSG:1"}, 2, "--crs");
  refused({(folder / "none.ply").string(), "-o", to, "--cell", "1"}, 3, "none.ply");
  refused({in, "-o", in, "--cell", "1", "--force"}, 2, ".tif");
  folder.write("ramp.prj", "no system");
  refused({in, "-o", to, "--cell", "1"}, 3, "ramp.off");
  fs::remove(folder / "ramp.prj");
  CHECK_FALSE(fs::exists(out));
  folder.write("dtm.tif", "mine");
  refused({in, "-o", to, "--cell", "1"}, 2, "--force");
  CHECK(file_bytes(out) == "mine");
  make({in, "-o", to, "--cell", "1", "--force", "--temp", folder.path().string()});
  CHECK(file_bytes(out).substr(0, 2) == "II");
  // Scratch files are gone.
  CHECK(std::distance(fs::directory_iterator(folder.path()), fs::directory_iterator()) == 2);
  // Without the program that links GDAL.
  fs::create_directory(folder / "bin");
  fs::copy_file(TESSERA_BINARY, folder / "bin" / "tessera");
  const Outcome alone = shell((folder / "bin" / "tessera").string() + " raster " + in + " -o " +
                              (folder / "b.tif").string() + " --cell 1");
  CHECK(alone.code == 4);
  CHECK(alone.said.find("tessera-gdal") != std::string::npos);
}

}  // namespace raster_test
