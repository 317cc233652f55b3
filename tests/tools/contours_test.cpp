// `contours` on meshes whose lines are known, as GeoJSON, GeoPackage and DXF.
#include <catch2/catch.hpp>

#include <array>
#include <cmath>
#include <functional>
#include <string>
#include <vector>

#include "stream/files/json.h"
#include "tests/helpers/command.h"
#include "tests/helpers/height_sheet.h"
#include "tests/helpers/shell.h"
#include "tests/helpers/temp_folder.h"

namespace contours_test {

using namespace tessera::test;
namespace fs = std::filesystem;

namespace {

constexpr double kX = 500000.0, kY = 5400000.0;

std::string heights(int steps, double size, const std::function<double(double, double)>& height) {
  return height_sheet(steps, size, kX, kY, height);
}

void make(std::vector<std::string> words) {
  words.insert(words.begin(), "contours");
  const CommandResult r = tessera_command(words);
  INFO(r.errors);
  REQUIRE(r.code == 0);
}

/// A wavy cone of many patches, cut by the border.
std::string cone() {
  return heights(160, 320.0, [](double x, double y) {
    return 50.0 - 0.2 * std::hypot(x - 150.0, y - 150.0) + 2.0 * std::sin(0.1 * x) * std::cos(0.13 * y);
  });
}

}  // namespace

TEST_CASE(
    "contours: a pyramid at survey coordinates has its lines, closed or cut by the border, and index lines",
    "[pipeline]") {
  const TempFolder folder;
  // Four planes that meet along the lines of the grid, 100 to 120 high within a diamond, down to 80 in the corners.
  const auto pyramid = [](double x, double y) { return 120.0 - std::abs(x - 20.0) - std::abs(y - 20.0); };
  const fs::path mesh = folder.write("pyramid.off", heights(40, 40.0, pyramid)),
                 out = folder / "lines.geojson";
  make({mesh.string(), "-o", out.string(), "--interval", "2.5", "--index", "2", "--crs",
        folder.write("utm.txt", "EPSG:25832\n").string()});
  const tessera::Json lines = tessera::parse_json(file_bytes(out));
  REQUIRE(lines.at("features").size() == 32 + 7);  // the tip at 120 is a point
  CHECK(lines.at("crs").at("properties").at("name").get<std::string>().find("25832") != std::string::npos);
  for (std::size_t k = 0; k < 39; ++k) {
    const tessera::Json& f = lines.at("features")[k];
    const std::size_t number = k < 32 ? k / 4 : k - 24;
    const double level = 82.5 + 2.5 * static_cast<double>(number), half = 120.0 - level;
    CAPTURE(k, level);
    CHECK(f.at("properties").at("elevation") == level);
    CHECK(f.at("properties").at("closed") == (k < 32 ? 0 : 1));
    CHECK(f.at("properties").at("index_line") == (number % 2 == 1 ? 1 : 0));
    const tessera::Json& p = f.at("geometry").at("coordinates");
    double area = 0.0;
    bool on_line = true;
    for (std::size_t i = 0; i < p.size(); ++i) {
      const double x = p[i][0].get<double>() - kX - 20.0, y = p[i][1].get<double>() - kY - 20.0;
      on_line = on_line && std::abs(std::abs(x) + std::abs(y) - half) < 1e-8 && p[i][2] == level;
      if (i > 0) {
        const double u = p[i - 1][0].get<double>() - kX - 20.0, v = p[i - 1][1].get<double>() - kY - 20.0;
        area += 0.5 * (u * y - v * x);
      }
    }
    CHECK(on_line);
    CHECK((p.front() == p.back()) == (k >= 32));
    if (k >= 32)
      CHECK(area == Approx(2.0 * half * half));
    else
      CHECK(area > 0.0);  // the middle is higher, and to the left
  }
}

TEST_CASE("contours: over many patches every line is closed or ends at the border, the same bytes by any way",
          "[pipeline]") {
  const TempFolder folder;
  const fs::path mesh = folder.write("cone.off", cone());
  for (const char* extension : {".geojson", ".gpkg", ".dxf"}) {
    CAPTURE(extension);
    const std::string a = (folder / "a").string() + extension, b = (folder / "b").string() + extension;
    make({mesh.string(), "-o", a, "--interval", "0.5", "--memory", "2G", "-t", "2"});
    make({mesh.string(), "-o", b, "--interval", "0.5", "--memory", "192M", "-t", "1"});
    CHECK((file_bytes(a) == file_bytes(b)));
  }
  const tessera::Json lines = tessera::parse_json(file_bytes(folder / "a.geojson"));
  std::size_t closed = 0, open = 0;
  double last = -1e9;
  bool at_border = true, ascends = true;
  for (const tessera::Json& f : lines.at("features")) {
    const tessera::Json& p = f.at("geometry").at("coordinates");
    const auto border = [](const tessera::Json& q) {
      const double x = q[0].get<double>() - kX, y = q[1].get<double>() - kY;
      return x == 0.0 || y == 0.0 || x == 320.0 || y == 320.0;
    };
    (f.at("properties").at("closed") == 1 ? closed : open) += 1;
    if (f.at("properties").at("closed") == 1)
      CHECK(p.front() == p.back());
    else
      at_border = at_border && border(p.front()) && border(p.back());
    ascends = ascends && f.at("properties").at("elevation").get<double>() >= last;
    last = f.at("properties").at("elevation").get<double>();
  }
  CHECK(at_border);
  CHECK(ascends);
  CHECK(closed > 20);
  CHECK(open > 20);
}

TEST_CASE("contours: what cannot be is refused in a sentence", "[pipeline]") {
  const TempFolder folder;
  const fs::path mesh =
      folder.write("ramp.off", heights(2, 4.0, [](double x, double) { return 300.2 + 0.1 * x; }));
  const auto refused = [&](const std::string& out, const std::vector<std::string>& how, int code,
                           const std::string& why) {
    std::vector<std::string> words = {"contours", mesh.string(), "-o", (folder / out).string()};
    words.insert(words.end(), how.begin(), how.end());
    const CommandResult r = tessera_command(words);
    CAPTURE(words, r.errors);
    CHECK(r.code == code);
    CHECK_THAT(r.errors, Catch::Contains(why));
  };
  refused("a.gpkg", {}, 2, "--interval is missing");
  refused("a.shp", {"--interval", "1"}, 2, ".gpkg, .geojson or .dxf");
  refused("a.gpkg", {"--interval", "1e-8"}, 2, "levels");
  refused("a.gpkg", {"--interval", "1"}, 5, "no multiple of 1");
  folder.write("a.gpkg", "mine");
  refused("a.gpkg", {"--interval", "0.1"}, 2, "--force");
  CHECK(file_bytes(folder / "a.gpkg") == "mine");
}

}  // namespace contours_test
