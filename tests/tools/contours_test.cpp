// `contours` on meshes whose lines are known, as GeoJSON, GeoPackage and DXF.
#include <catch2/catch.hpp>

#include <array>
#include <cmath>
#include <functional>
#include <string>
#include <vector>

#include "kernels/survey/line_smoothing.h"
#include "stream/files/json.h"
#include "tests/helpers/command.h"
#include "tests/helpers/height_sheet.h"
#include "tests/helpers/map_lines.h"
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

TEST_CASE("contours: lines are smooth within a tolerance, meet nothing and end where they did",
          "[pipeline]") {
  const TempFolder folder;
  // Flat benches with steep steps between, rough all over: lines run close along the steps.
  const fs::path mesh = folder.write(
      "steps.off", heights(150, 300.0, [](double x, double y) {
        const double ramp = 0.05 * (x + 0.4 * y) + std::sin(0.07 * x) * std::cos(0.05 * y);
        return ramp + 0.45 * std::sin(2.0 * M_PI * ramp) / M_PI + 0.06 * std::sin(7.1 * x + 3.3 * y);
      }));
  const std::string raw = (folder / "raw.geojson").string(), smooth = (folder / "smooth.geojson").string();
  make({mesh.string(), "-o", raw, "--interval", "0.25"});
  make({mesh.string(), "-o", smooth, "--interval", "0.25", "--smooth", "0.8", "-t", "2"});
  const std::vector<MapLine> before = read_map_lines(raw), after = read_map_lines(smooth);
  REQUIRE(before.size() == after.size());
  REQUIRE(before.size() > 100);
  std::uint64_t touches = 0, smooth_touches = 0;
  CHECK(crossing_pairs(before, touches) == 0);
  CHECK(crossing_pairs(after, smooth_touches) == 0);
  CHECK(smooth_touches <= touches);
  double turned = 0.0, smooth_turned = 0.0, farthest = 0.0;
  const auto turning = [](const MapLine& line) {
    double sum = 0.0;
    const auto& p = line.points;
    for (std::size_t k = 1; k + 1 < p.size(); ++k)
      sum += std::abs(std::remainder(std::atan2(p[k + 1][1] - p[k][1], p[k + 1][0] - p[k][0]) -
                                         std::atan2(p[k][1] - p[k - 1][1], p[k][0] - p[k - 1][0]),
                                     2.0 * M_PI));
    return sum;
  };
  bool ends = true;
  for (std::size_t l = 0; l < before.size(); ++l) {
    const MapLine &a = before[l], &b = after[l];
    REQUIRE(a.level == b.level);
    REQUIRE(a.closed == b.closed);
    if (!a.closed) ends = ends && a.points.front() == b.points.front() && a.points.back() == b.points.back();
    turned += turning(a), smooth_turned += turning(b);
    if (l % 7 != 0) continue;
    for (const auto& p : b.points) {
      double nearest = 1e300;
      for (std::size_t k = 0; k + (a.closed ? 0 : 1) < a.points.size(); ++k)
        nearest = std::min(nearest,
                           tessera::segment_distance(p, p, a.points[k], a.points[(k + 1) % a.points.size()]));
      farthest = std::max(farthest, nearest);
    }
  }
  CHECK(ends);
  CHECK(farthest <= 0.8);
  CHECK(farthest > 0.1);
  CHECK(smooth_turned < 0.6 * turned);
  // The same bytes by any way.
  const std::string again = (folder / "again.geojson").string();
  make({mesh.string(), "-o", again, "--interval", "0.25", "--smooth", "0.8", "-t", "1", "--memory", "128M"});
  CHECK((file_bytes(again) == file_bytes(smooth)));
}

TEST_CASE("contours: of ten million faces none cross, none dangle, smoothed or not", "[pipeline][.large]") {
  const TempFolder folder;
  const std::string scan = (folder / "scan.ply").string(), mesh = (folder / "mesh.ply").string(),
                    lines = (folder / "lines.geojson").string();
  REQUIRE(tessera_command(
              {"synth", "--scene", "terrain", "--points", "8M", "--normals", "--noise", "0.02", "-o", scan})
              .code == 0);
  REQUIRE(tessera_command({"reconstruct", scan, "-o", mesh, "-q"}).code == 0);
  for (const char* smooth : {"0", "0.3"}) {
    make({mesh, "-o", lines, "--interval", "0.5", "--smooth", smooth, "--force"});
    const std::vector<MapLine> all = read_map_lines(lines);
    std::uint64_t touches = 0;
    CAPTURE(smooth, all.size());
    CHECK(all.size() > 100);
    CHECK(crossing_pairs(all, touches) == 0);
    std::size_t dangling = 0;
    for (const MapLine& line : all)
      for (const auto& p : {line.points.front(), line.points.back()})
        if (!line.closed && p[0] > 5.0 && p[1] > 5.0 && p[0] < 995.0 && p[1] < 995.0) ++dangling;
    CHECK(dangling == 0);
  }
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
