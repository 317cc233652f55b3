// `raster` of scans against cells that are counted here point by point, read back by GDAL's own programs.
#include <catch2/catch.hpp>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <map>
#include <string>
#include <utility>
#include <vector>

#include "stream/files/json.h"
#include "tests/helpers/aerial_scene.h"
#include "tests/helpers/command.h"
#include "tests/helpers/geotiff.h"
#include "tests/helpers/random.h"
#include "tests/helpers/shell.h"
#include "tests/helpers/temp_folder.h"

namespace scan_raster_test {

using namespace tessera::test;
namespace fs = std::filesystem;

namespace {

constexpr double kEast = 5e5, kNorth = 5.4e6;
constexpr float kNoData = -9999.0F;

void make(const std::vector<std::string>& words) {
  std::vector<std::string> all = {"raster"};
  all.insert(all.end(), words.begin(), words.end());
  const CommandResult r = tessera_command(all);
  INFO(r.errors);
  REQUIRE(r.code == 0);
}

/// What a cell must show.
struct Wanted {
  std::uint32_t count = 0;
  double top = -1e9, ground = 1e9, intensity = 0.0;
  std::uint64_t seen = 0;
};

/// Columns from `kEast`, rows southwards from `kNorth + cell * rows`. Coordinates are those of las_of(): hundredths.
std::map<std::pair<int, int>, Wanted> wanted_cells(const std::vector<ScenePoint>& points, int cell) {
  std::map<std::pair<int, int>, Wanted> cells;
  const auto key = [&](const ScenePoint& p) {
    const auto index = [&](double x) { return static_cast<int>(std::lround(x * 100.0)) / (100 * cell); };
    return std::pair{index(p.x), index(p.y)};
  };
  const auto height = [](const ScenePoint& p) {
    return static_cast<double>(std::lround(p.z * 100.0)) * 0.01;
  };
  for (const ScenePoint& p : points) {
    if (p.given == 7 || p.withheld) continue;
    Wanted& w = cells[key(p)];
    ++w.count;
    w.top = std::max(w.top, height(p));
    if (p.given == 2) w.ground = std::min(w.ground, height(p));
  }
  for (std::size_t i = 0; i < points.size(); ++i) {
    const ScenePoint& p = points[i];
    if (p.given == 7 || p.withheld) continue;
    Wanted& w = cells[key(p)];
    if (w.top - height(p) > 0.5 * cell) continue;
    w.intensity += static_cast<double>(static_cast<std::uint16_t>(i * 7)), ++w.seen;
  }
  return cells;
}

/// The classes that the file has are the true ones.
std::vector<ScenePoint> classified_scene() {
  std::vector<ScenePoint> points = aerial_scene();
  for (ScenePoint& p : points) p.given = p.truth;
  points[5].withheld = true;
  return points;
}

/// A step of ten metres along x = 5, its upper half red, its lower half green, the wall between blue; cells without points.
std::string step_ply(unsigned seed) {
  std::vector<std::string> lines;
  char line[120];
  const auto add = [&](double x, double y, double z, const char* colour) {
    std::snprintf(line, sizeof line, "%.4f %.4f %.4f %s\n", x, y, z, colour);
    lines.emplace_back(line);
  };
  for (int v = 0; v < 40; ++v)
    for (int u = 0; u < 40; ++u) {
      const double x = 0.25 * u + 0.1, y = 0.25 * v + 0.1;
      if (x > 8.0 && y > 8.0) continue;
      add(x, y, x < 5.5 ? 10.0 : 0.0, x < 5.5 ? "255 0 0" : "0 200 0");
    }
  for (int v = 0; v < 40; ++v)
    for (int k = 1; k < 100; ++k) add(5.49, 0.25 * v + 0.1, 0.1 * k, "0 0 255");
  Random random(seed);
  for (std::size_t i = lines.size(); i > 1; --i) std::swap(lines[i - 1], lines[random.below(i)]);
  std::string text =
      "ply\nformat ascii 1.0\nelement vertex " + std::to_string(lines.size()) +
      "\nproperty double x\nproperty double y\nproperty double z\nproperty uchar red\nproperty "
      "uchar green\nproperty uchar blue\nend_header\n";
  for (const std::string& l : lines) text += l;
  return text;
}

}  // namespace

TEST_CASE("scan raster: every cell has the count, heights and intensity of its points", "[pipeline]") {
  if (!has_gdal()) return;
  const TempFolder folder;
  const std::vector<ScenePoint> points = classified_scene();
  constexpr int kCell = 2, kColumns = 60, kRows = 50;
  const auto wanted = wanted_cells(points, kCell);
  const fs::path scan = folder.write("scan.las", las_of(points, {}));
  make({scan.string(), "-o", (folder / "s.tif").string(), "--cell", "2", "--layer",
        "count,top,ground,height,intensity,missing", "--crs", "EPSG:32632"});
  const auto count = geotiff_values<std::uint32_t>(folder / "s.count.tif");
  const auto top = geotiff_values<float>(folder / "s.top.tif"),
             ground = geotiff_values<float>(folder / "s.ground.tif"),
             height = geotiff_values<float>(folder / "s.height.tif"),
             intensity = geotiff_values<float>(folder / "s.intensity.tif");
  const auto missing = geotiff_values<std::uint8_t>(folder / "s.missing.tif");
  REQUIRE(count.size() == kColumns * kRows);
  std::size_t wrong = 0, without_ground = 0;
  const auto differ = [](float a, double b) { return std::abs(static_cast<double>(a) - b) > 1e-3; };
  for (int v = 0; v < kRows; ++v)
    for (int u = 0; u < kColumns; ++u) {
      const auto k = static_cast<std::size_t>((kRows - 1 - v) * kColumns + u);
      const auto at = wanted.find({u, v});
      const Wanted w = at == wanted.end() ? Wanted{} : at->second;
      const bool grounded = w.ground < 1e8;
      without_ground += grounded ? 0 : 1;
      if (count[k] != w.count || missing[k] != (w.count > 0 ? 0 : 1)) ++wrong;
      if (w.count > 0) {
        if (differ(top[k], w.top)) ++wrong;
        // Floats of five digits before the point have two behind it.
        const double mean = w.intensity / static_cast<double>(w.seen);
        if (std::abs(static_cast<double>(intensity[k]) - mean) > 0.005) ++wrong;
      }
      if (grounded ? differ(ground[k], w.ground) || differ(height[k], w.top - w.ground)
                   : ground[k] != kNoData || height[k] != kNoData)
        ++wrong;
    }
  CHECK(wrong == 0);
  CHECK(without_ground > 100);  // below the houses
  const tessera::Json about = geotiff_info(folder / "s.count.tif");
  CHECK(about.at("geoTransform") == tessera::Json({kEast, 2.0, 0.0, kNorth + 100.0, 0.0, -2.0}));
  CHECK(about.at("metadata").at("IMAGE_STRUCTURE").at("LAYOUT") == "COG");
  const tessera::Json& band = about.at("bands")[0];
  CHECK(band.at("type") == "UInt32");
  CHECK(band.at("noDataValue") == 0.0);
  double all = 0.0, filled = 0.0;
  for (const std::uint32_t c : count) all += c, filled += c > 0 ? 1.0 : 0.0;
  CHECK(std::stod(band.at("metadata").at("").at("STATISTICS_MEAN").get<std::string>()) ==
        Approx(all / filled));
  CHECK(geotiff_info(folder / "s.top.tif").at("bands")[0].at("unit") == "metre");
}

TEST_CASE("scan raster: an orthophoto shows the highest surface, no wall, and holes are transparent",
          "[pipeline]") {
  if (!has_gdal()) return;
  const TempFolder folder;
  const fs::path scan = folder.write("step.ply", step_ply(1));
  make({scan.string(), "-o", (folder / "o.tif").string(), "--cell", "1", "--layer", "ortho"});
  const auto rgba = geotiff_values<std::uint8_t>(folder / "o.tif");
  REQUIRE(rgba.size() == 4 * 100);
  const auto pixel = [&](int x, int y) {
    const std::size_t k = 4 * static_cast<std::size_t>(10 * (9 - y) + x);
    return std::vector<int>{rgba[k], rgba[k + 1], rgba[k + 2], rgba[k + 3]};
  };
  for (int y = 0; y < 10; ++y)
    for (int x = 0; x < 10; ++x) {
      CAPTURE(x, y);
      if (x >= 8 && y >= 8)
        CHECK(pixel(x, y) == std::vector<int>{0, 0, 0, 0});
      else if (x == 5)  // the upper edge: of the wall half a cell, of its height ten
        CHECK((pixel(x, y)[0] > 50 && pixel(x, y)[1] == 0));
      else
        CHECK(pixel(x, y) == (x < 5 ? std::vector<int>{255, 0, 0, 255} : std::vector<int>{0, 200, 0, 255}));
    }
  CHECK(geotiff_info(folder / "o.tif").at("bands")[3].at("colorInterpretation") == "Alpha");
}

TEST_CASE("scan raster: the same bytes with any cap, threads, windows, order and number of files",
          "[pipeline]") {
  if (!has_gdal()) return;
  const TempFolder folder;
  const std::vector<std::string> layers = {"ortho", "top", "count", "missing"};
  const auto run = [&](const std::string& name, std::vector<std::string> words) {
    words.insert(words.end(),
                 {"-o", (folder / (name + ".tif")).string(), "--layer", "ortho,top,count,missing"});
    make(words);
    std::string all;
    for (const std::string& layer : layers) all += file_bytes(folder / (name + "." + layer + ".tif"));
    return all;
  };
  const std::string one = folder.write("one.ply", step_ply(1)).string();
  const std::string want = run("a", {one, "--cell", "0.3", "--memory", "2G", "-t", "2"});
  CHECK((run("b", {one, "--cell", "0.3", "--memory", "128M", "-t", "1"}) == want));
  CHECK((run("c", {one, "--cell", "0.3", "--tile", "7", "-t", "2"}) == want));
  CHECK((run("d", {folder.write("two.ply", step_ply(2)).string(), "--cell", "0.3"}) == want));
  // The cell that is chosen follows from the points as well.
  const std::string chosen = run("e", {one});
  CHECK((run("f", {(folder / "two.ply").string(), "--cell", "auto", "--tile", "16"}) == chosen));
  CHECK(geotiff_info(folder / "e.top.tif").at("geoTransform")[1] == 0.5);
  // Scans as one: text and PLY, halves in any order.
  const std::string head = "x,y,z,r,g,b\n";
  std::string text = file_bytes(one), west = head, east = head;
  text = text.substr(text.find("end_header\n") + 11);
  for (std::size_t at = 0; at < text.size();) {
    const std::size_t end = text.find('\n', at) + 1;
    std::string line = text.substr(at, end - at);
    std::replace(line.begin(), line.end(), ' ', ',');
    (std::stod(line) < 3.3 ? west : east) += line;
    at = end;
  }
  folder.write("west.csv", west), folder.write("east.csv", east);
  const std::string w = (folder / "west.csv").string(), e = (folder / "east.csv").string();
  CHECK((run("g", {w, e, "--cell", "0.3"}) == want));
  CHECK((run("h", {e, w, "--cell", "0.3", "-t", "1"}) == want));
}

TEST_CASE("scan raster: the points decide, not the format that they come in", "[pipeline]") {
  if (!has_gdal()) return;
  const TempFolder folder;
  // Binary fractions: no format rounds them, which would make another cell of what lies on an edge.
  std::string text;
  char line[80];
  for (int v = 0; v < 60; ++v)
    for (int u = 0; u < 80; ++u) {
      std::snprintf(line, sizeof line, "%.8g %.8g %.8g\n", 0.25 * u, 0.25 * v, 0.125 * ((u * v) % 17));
      text += line;
    }
  const fs::path first = folder.write("scan.xyz", text);
  const auto top_of = [&](const fs::path& scan) {
    const fs::path out = folder / (scan.filename().string() + ".tif");
    make({scan.string(), "-o", out.string(), "--cell", "1", "--layer", "top"});
    return geotiff_values<float>(out);
  };
  const std::vector<float> want = top_of(first);
  REQUIRE(want.size() == 20 * 15);
  CHECK(want[14 * 20] == 9 * 0.125F);  // u, v up to 3
  for (const char* extension : {"las", "laz", "ply", "ptx"}) {
    CAPTURE(extension);
    const fs::path scan = folder / (std::string("scan.") + extension);
    const CommandResult r = tessera_command({"convert", first.string(), "-o", scan.string()});
    if (r.code == 2 && std::string(extension) == "ptx") continue;  // written by synth alone
    INFO(r.errors);
    REQUIRE(r.code == 0);
    CHECK((top_of(scan) == want));
  }
  std::string pcd =
      "# .PCD v0.7\nVERSION 0.7\nFIELDS x y z\nSIZE 4 4 4\nTYPE F F F\nCOUNT 1 1 1\nWIDTH 4800\nHEIGHT 1\n"
      "VIEWPOINT 0 0 0 1 0 0 0\nPOINTS 4800\nDATA ascii\n" +
      text;
  CHECK((top_of(folder.write("other.pcd", pcd)) == want));
}

TEST_CASE("scan raster: nine million cells and a million points stay below a cap of 128 MiB, GDAL included",
          "[memory]") {
  const TempFolder folder;
  const std::string scan = (folder / "scan.las").string();
  REQUIRE(tessera_command({"synth", "--scene", "terrain", "--points", "1M", "--colour", "-o", scan}).code ==
          0);
  // The terrain is a thousand wide.
  const CommandResult r =
      tessera_command({"raster", scan, "-o", (folder / "s.tif").string(), "--cell", "0.33", "--layer",
                       "top,ortho,count", "--memory", "128M", "-t", "2"});
  INFO(r.errors);
  REQUIRE(r.code == 0);
  CHECK(r.peak_bytes < std::uint64_t{128} << 20);
}

TEST_CASE("scan raster: stopped by a signal it leaves nothing behind", "[fault]") {
  const TempFolder folder;
  const fs::path scan = folder.write("scan.las", las_of(aerial_scene(), {})), scratch = folder / "scratch";
  fs::create_directory(scratch);
  for (const char* fault : {"TESSERA_FAULT=stop:1", "TESSERA_FAULT=stop:3"}) {
    const CommandResult r = tessera_command({"raster", scan.string(), "-o", (folder / "s.tif").string(),
                                             "--cell", "0.5", "--tile", "16", "--temp", scratch.string()},
                                            0, fault);
    CAPTURE(fault, r.errors);
    CHECK(r.code == 143);
    CHECK(fs::is_empty(scratch));
    CHECK(std::distance(fs::directory_iterator(folder.path()), fs::directory_iterator()) == 2);
  }
}

TEST_CASE("scan raster: what a scan cannot show is refused in a sentence, and nothing is left",
          "[pipeline]") {
  const TempFolder folder;
  const std::string scan = folder.write("scan.las", las_of(aerial_scene(), {})).string(),
                    bare = folder.write("bare.xyz", "0 0 1\n1 0 2\n0 1 3\n").string(),
                    mesh = folder.write("mesh.off", "OFF 3 1 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n").string(),
                    out = (folder / "s.tif").string();
  const auto refused = [&](std::vector<std::string> words, int code, const std::string& why) {
    words.insert(words.begin(), "raster");
    words.insert(words.end(), {"-o", out});
    const CommandResult r = tessera_command(words);
    CAPTURE(words, r.errors);
    CHECK(r.code == code);
    CHECK_THAT(r.errors, Catch::Contains(why));
    CHECK_FALSE(fs::exists(out));
  };
  refused({scan, "--layer", "slope"}, 2, "needs faces");
  refused({scan, "--layer", "hillshade"}, 2, "tessera reconstruct");
  refused({scan, "--layer", "ground"}, 3, "tessera classify");
  refused({bare, "--layer", "height"}, 3, "tessera classify");
  refused({scan, "--layer", "ortho"}, 2, "no colours");
  refused({bare, "--layer", "intensity"}, 2, "no intensities");
  refused({mesh, "--cell", "1", "--layer", "count"}, 2, "is a mesh");
  refused({scan, mesh, "--cell", "1"}, 2, "one at a time");
  refused({mesh}, 2, "--cell is missing");
  refused({bare}, 2, "--cell auto");
  refused({scan, "--cell", "1e-12"}, 2, "--cell 1e-12");
  refused({scan, "--cell", "1e-8"}, 2, "cells");
  refused({scan, "--cell", "0.0005"}, 4, "--");
  refused({scan, "--cell", "1", "--memory", "30M"}, 4, "--memory");
  refused({scan, "--cell", "1", "--crs", "EPSG:1"}, 2, "--crs");
  refused({bare, "--cell", "1", "--nodata", "3"}, 2, "--nodata");
  SceneFile degrees;
  degrees.degrees = true;
  refused({folder.write("d.las", las_of(aerial_scene(), degrees)).string(), "--cell", "1"}, 3, "degrees");
  refused({folder.write("e.las", las_of({}, {})).string(), "--cell", "1"}, 5, "no points");
  std::vector<ScenePoint> noise = aerial_scene();
  for (ScenePoint& p : noise) p.given = 7;
  refused({folder.write("n.las", las_of(noise, {})).string(), "--cell", "1"}, 5, "noise");
}

}  // namespace scan_raster_test
