// `volume` from toe lines and rasters, with statistical bounds and maps, on solids whose volumes are known.
#include <catch2/catch.hpp>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstring>
#include <filesystem>
#include <functional>
#include <sstream>
#include <string>
#include <vector>

#include "octree/portable_math.h"
#include "stream/files/json.h"
#include "tests/helpers/command.h"
#include "tests/helpers/height_sheet.h"
#include "tests/helpers/random.h"
#include "tests/helpers/shell.h"
#include "tests/helpers/skip.h"
#include "tests/helpers/temp_folder.h"

namespace volume_bases_test {

using namespace tessera::test;
namespace fs = std::filesystem;

namespace {

constexpr double kX = 500000.25, kY = 5400000.5;
constexpr int kSteps = 80;
constexpr double kSize = 40.0, kStep = kSize / kSteps;

using Heights = std::function<double(double, double)>;

std::string sheet(const Heights& height, int steps = kSteps) {
  return height_sheet(steps, kSize, kX, kY, height);
}

double slope(double x, double y) {
  return 300.0 + 0.2 * x - 0.1 * y;
}
double radius(double x, double y) {
  return std::hypot(x - 20.3, y - 19.6);
}
/// A spherical cap of height 3 and radius 9 at its foot.
constexpr double kCapHeight = 3.0, kCapFoot = 9.0,
                 kSphere = (kCapFoot * kCapFoot + kCapHeight * kCapHeight) / (2.0 * kCapHeight),
                 kCapVolume = tessera::kPi * kCapHeight * kCapHeight * (3.0 * kSphere - kCapHeight) / 3.0;
double cap(double x, double y) {
  const double r = radius(x, y);
  return r < kCapFoot ? std::sqrt(kSphere * kSphere - r * r) - (kSphere - kCapHeight) : 0.0;
}
constexpr double kConeVolume = tessera::kPi * 9.0 * 9.0 * 6.0 / 3.0;
double cone(double x, double y) {
  return std::max(0.0, 6.0 * (1.0 - radius(x, y) / 9.0));
}
/// By how much flat faces leave these: half a step's rise across their edges, and the sphere's sagitta.
constexpr double kFaceted = kStep * 0.5;

/// A polygon of n corners around the middle of the solids.
std::string circle(int n, double r, double x = 20.3, double y = 19.6) {
  std::string text;
  for (int k = 0; k <= n; ++k) {
    const tessera::SinCos a = tessera::sin_cos(2.0 * tessera::kPi * (k % n) / n);
    char corner[80];
    std::snprintf(corner, sizeof corner, "%s[%.17g,%.17g]", k > 0 ? "," : "", kX + x + r * a.cos,
                  kY + y + r * a.sin);
    text += corner;
  }
  return "{\"type\":\"Polygon\",\"coordinates\":[[" + text + "]]}";
}

CommandResult volume(std::vector<std::string> words) {
  words.insert(words.begin(), "volume");
  return tessera_command(words);
}

tessera::Json volumes(const TempFolder& folder, std::vector<std::string> words) {
  const auto json = folder.path() / "volumes.json";
  words.insert(words.end(), {"--json", json.string(), "--force"});
  const CommandResult r = volume(words);
  INFO(r.errors);
  REQUIRE(r.code == 0);
  return tessera::parse_json(file_bytes(json));
}

double number(const tessera::Json& row, const char* key) {
  return row.at(key).get<double>();
}
double net(const tessera::Json& report) {
  return number(report.at("areas")[0], "net");
}
double bound(const tessera::Json& report) {
  return number(report.at("areas")[0], "bound");
}

fs::path raster_of(const TempFolder& folder, const std::string& name, const fs::path& mesh,
                   const std::string& cell) {
  const fs::path out = folder.path() / name;
  const CommandResult r = tessera_command({"raster", mesh.string(), "-o", out.string(), "--cell", cell});
  INFO(r.errors);
  REQUIRE(r.code == 0);
  return out;
}

bool has_translate() {
  if (shell("gdal_translate --version").code == 0) return true;
  skip("there is no gdal_translate (gdal-bin)");
  return false;
}

std::vector<float> cells_of(const fs::path& file) {
  const TempFolder folder;
  const fs::path raw = folder / "raw";
  REQUIRE(shell("gdal_translate -q -of ENVI " + file.string() + " " + raw.string()).code == 0);
  const std::string bytes = file_bytes(raw);
  std::vector<float> out(bytes.size() / sizeof(float));
  std::memcpy(out.data(), bytes.data(), out.size() * sizeof(float));
  return out;
}

}  // namespace

TEST_CASE("volume: a dome, a cone and a pit on a slope over their toe lines, plane, mesh and raster",
          "[pipeline]") {
  const TempFolder folder;
  const fs::path ground = folder.write("ground.off", sheet(slope)),
                 areas = folder.write("foot.geojson", circle(48, 11.0)),
                 raster = raster_of(folder, "ground.tif", ground, "0.25");
  const struct {
    const char* name;
    Heights height;
    double net;
  } solids[] = {{"dome", cap, kCapVolume},
                {"cone", cone, kConeVolume},
                {"pit", [](double x, double y) { return -cone(x, y); }, -kConeVolume}};
  for (const auto& solid : solids) {
    CAPTURE(solid.name);
    const fs::path mesh =
        folder.write(std::string(solid.name) + ".off",
                     sheet([&](double x, double y) { return slope(x, y) + solid.height(x, y); }));
    const std::vector<std::string> common = {mesh.string(), "--within", areas.string(), "--tolerance",
                                             std::to_string(kFaceted)};
    const auto over = [&](const std::string& base, std::vector<std::string> more = {}) {
      std::vector<std::string> words = common;
      words.insert(words.end(), {"--base", base});
      words.insert(words.end(), more.begin(), more.end());
      return volumes(folder, words);
    };
    const tessera::Json before = over(ground.string(), {"--base-tolerance", "0"});
    CHECK(std::abs(net(before) - solid.net) < bound(before));
    CHECK(std::abs(net(before) - solid.net) < 0.01 * std::abs(solid.net));
    // The outline lies on the slope, which is one plane: all bases are the same.
    const tessera::Json toe = over("toe"), plane = over("toe-plane"),
                        tif = over(raster.string(), {"--base-tolerance", "0.0001"});
    for (const tessera::Json* r : {&toe, &plane}) {
      CHECK(net(*r) == Approx(net(before)).epsilon(1e-9));
      CHECK(std::abs(net(*r) - solid.net) < bound(*r));
      CHECK(number(r->at("areas")[0], "covered") ==
            Approx(number(r->at("areas")[0], "plan_area")).epsilon(1e-12));
      CHECK(number(r->at("areas")[0], "outline") == Approx(2 * 48 * 11.0 * std::sin(tessera::kPi / 48)));
      CHECK(number(r->at("areas")[0], "outline_uncovered") == Approx(0.0).margin(1e-7));
      CHECK(number(r->at("areas")[0], "base_surface") ==
            Approx(number(r->at("areas")[0], "plan_area") * std::sqrt(1.05)));
    }
    CHECK(std::abs(net(tif) - net(before)) < 0.0001 * number(tif.at("areas")[0], "plan_area"));
    CHECK(std::abs(net(tif) - solid.net) < bound(tif));
  }
  // The dome over a level, on level ground.
  const fs::path flat = folder.write("flat.off", sheet(cap));
  const tessera::Json level =
      volumes(folder, {flat.string(), "--base", "plane:0", "--tolerance", std::to_string(kFaceted)});
  CHECK(std::abs(net(level) - kCapVolume) < bound(level));
}

TEST_CASE("volume: a toe line follows the ground where a plane cannot, and holes stay out", "[pipeline]") {
  const TempFolder folder;
  // A roof: what its eaves and gables span, over a rectangle whose short sides cross the ridge.
  const fs::path roof =
      folder.write("roof.off", sheet([](double x, double) { return 10.0 - std::abs(x - 20.0); }));
  const auto rectangle = [](double x0, double y0, double x1, double y1) {
    char text[400];
    std::snprintf(text, sizeof text,
                  "[[%.17g,%.17g],[%.17g,%.17g],[%.17g,%.17g],[%.17g,%.17g],[%.17g,%.17g]]", kX + x0, kY + y0,
                  kX + x1, kY + y0, kX + x1, kY + y1, kX + x0, kY + y1, kX + x0, kY + y0);
    return std::string(text);
  };
  const fs::path narrow = folder.write(
      "narrow.geojson", "{\"type\":\"Polygon\",\"coordinates\":[" + rectangle(10, 19.9, 30, 20.1) + "]}");
  // The gables are so close that triangles run from one to the other: the base is the roof.
  const tessera::Json toe = volumes(folder, {roof.string(), "--base", "toe", "--within", narrow.string()}),
                      plane = volumes(folder,
                                      {roof.string(), "--base", "toe-plane", "--within", narrow.string()});
  CHECK(net(toe) == Approx(0.0).margin(0.01));
  // The plane of least squares lies level at the mean of the outline: cut and fill.
  CHECK(number(plane.at("areas")[0], "fill") > 1.0);
  CHECK(net(plane) == Approx(0.0).margin(0.3));
  // A flat ring around a hole: nothing above or below, and the hole is not in it.
  const fs::path dome = folder.write("dome.off", sheet([](double x, double y) { return 50.0 + cap(x, y); }));
  const fs::path ring =
      folder.write("ring.geojson", "{\"type\":\"Polygon\",\"coordinates\":[" + rectangle(2, 2, 38, 38) + "," +
                                       rectangle(11, 10, 30, 29) + "]}");
  const tessera::Json around = volumes(folder, {dome.string(), "--base", "toe", "--within", ring.string()});
  CHECK(number(around.at("areas")[0], "plan_area") == Approx(36.0 * 36 - 19 * 19));
  CHECK(number(around.at("areas")[0], "covered") == Approx(36.0 * 36 - 19 * 19));
  CHECK(net(around) == Approx(0.0).margin(1e-6));
}

TEST_CASE("volume: a plane against itself is nothing within its bounds", "[pipeline]") {
  const TempFolder folder;
  const fs::path ground = folder.write("ground.off", sheet(slope)),
                 areas = folder.write("area.geojson", circle(7, 15.0, 20.0, 20.0)),
                 raster = raster_of(folder, "ground.tif", ground, "0.5");
  for (const std::string& base :
       {std::string("toe"), std::string("toe-plane"), ground.string(), raster.string()}) {
    CAPTURE(base);
    const tessera::Json r = volumes(folder, {ground.string(), "--base", base, "--within", areas.string(),
                                             "--tolerance", "0.00002", "--base-tolerance", "0.00002"});
    CHECK(std::abs(net(r)) <= bound(r));
    CHECK(number(r.at("areas")[0], "fill") < 0.02);
    CHECK(bound(r) > 0.0);
  }
}

TEST_CASE("volume: noise of points bounds volumes as statistics say", "[pipeline]") {
  const TempFolder folder;
  const fs::path areas = folder.write(
      "area.geojson",
      "{\"type\":\"Polygon\",\"coordinates\":[[[500004.25,5400004.5],[500036.25,5400004.5],[500036.25,"
      "5400036.5],[500004.25,5400036.5],[500004.25,5400004.5]]]}");
  constexpr double kNoise = 0.05;
  const double area = 32.0 * 32.0, known = 1.96 * kNoise * kStep * std::sqrt(area);
  int within = 0, toe_within = 0;
  double squares = 0.0, toe_squares = 0.0;
  constexpr int kRuns = 12;
  for (int run = 0; run < kRuns; ++run) {
    Random random(static_cast<std::uint64_t>(run) + 1);
    const auto normal = [&] {
      double sum = 0.0;
      for (int k = 0; k < 12; ++k) sum += random.in(-0.5, 0.5);
      return sum;
    };
    const fs::path mesh = folder.write("noisy.off", sheet([&](double, double) { return kNoise * normal(); }));
    const tessera::Json level = volumes(folder, {mesh.string(), "--base", "plane:0", "--within",
                                                 areas.string(), "--noise", "0.05", "--spacing", "0.5"});
    const tessera::Json& row = level.at("areas")[0];
    CHECK(number(row, "noise_bound") == Approx(known).epsilon(1e-3));
    CHECK(row.at("bound").is_null());
    within += std::abs(net(level)) < number(row, "noise_bound") ? 1 : 0;
    squares += std::pow(net(level) / known * 1.96, 2) / kRuns;
    const tessera::Json toe = volumes(folder, {mesh.string(), "--base", "toe", "--within", areas.string(),
                                               "--noise", "0.05", "--spacing", "0.5"});
    const double toe_bound = number(toe.at("areas")[0], "noise_bound");
    CHECK(toe_bound > known);
    toe_within += std::abs(net(toe)) < toe_bound ? 1 : 0;
    toe_squares += std::pow(net(toe) / toe_bound * 1.96, 2) / kRuns;
  }
  CHECK(within >= kRuns - 3);
  CHECK(toe_within >= kRuns - 3);
  // Neither is far too wide: standard deviations are those that the bounds were made of, the toe's from above.
  CHECK(squares > 0.4);
  CHECK(squares < 2.0);
  CHECK(toe_squares > 0.1);
  CHECK(toe_squares < 2.0);
  // What hangs together over the whole area moves it as one.
  const fs::path mesh = folder.write("flat.off", sheet([](double, double) { return 1.0; }));
  const tessera::Json whole = volumes(folder, {mesh.string(), "--base", "plane:0", "--within", areas.string(),
                                               "--noise", "0.05", "--noise-length", "1000"});
  CHECK(number(whole.at("areas")[0], "noise_bound") == Approx(1.96 * kNoise * area).epsilon(1e-3));
  const tessera::Json both =
      volumes(folder, {mesh.string(), "--base", mesh.string(), "--within", areas.string(), "--noise", "0.05",
                       "--spacing", "0.5", "--base-noise", "0.05", "--base-spacing", "0.5"});
  CHECK(number(both.at("areas")[0], "noise_bound") == Approx(known * std::sqrt(2.0)).epsilon(1e-3));
  CHECK(number(both.at("noise"), "spacing") == 0.5);
}

TEST_CASE("volume: two scans of one terrain differ by no more than their noise allows", "[pipeline]") {
  const TempFolder folder;
  std::vector<std::string> meshes;
  for (const char* seed : {"1", "2"}) {
    const std::string scan = (folder / (std::string(seed) + ".ply")).string(),
                      mesh = (folder / (std::string(seed) + ".mesh.ply")).string();
    REQUIRE(tessera_command({"synth", "--scene", "terrain", "--points", "60k", "--noise", "0.2", "--normals",
                             "--seed", seed, "-o", scan})
                .code == 0);
    REQUIRE(tessera_command({"reconstruct", scan, "-o", mesh, "-q"}).code == 0);
    meshes.push_back(mesh);
  }
  // A million square units hold 60,000 points: 4.2 apart.
  const tessera::Json r =
      volumes(folder, {meshes[1], "--base", meshes[0], "--noise", "0.2", "--spacing", "4.2", "--base-noise",
                       "0.2", "--base-spacing", "4.2", "--tolerance", "0.5", "--base-tolerance", "0.5"});
  const tessera::Json& row = r.at("areas")[0];
  CHECK(number(row, "covered") > 0.99e6);
  CHECK(number(row, "fill") > 1e4);
  CHECK(std::abs(net(r)) < number(row, "noise_bound"));
  CHECK(number(row, "noise_bound") < 0.003 * number(row, "covered"));
  CHECK(std::abs(net(r)) < bound(r));
}

TEST_CASE("volume: two halves of a real flight differ by no more than their noise allows",
          "[pipeline][.shared]") {
  if (!has_shared_data()) return;
  const fs::path scan = kSharedData / "lidar/ign-2023.laz";
  const TempFolder folder;
  REQUIRE(tessera_command({"convert", scan.string(), "-o", (folder / "all.xyz").string()}).code == 0);
  std::istringstream lines(file_bytes(folder / "all.xyz"));
  std::string halves[2];
  bool odd = false;
  for (std::string line; std::getline(lines, line); odd = !odd) halves[odd ? 1 : 0] += line + "\n";
  std::vector<std::string> meshes;
  for (const int half : {0, 1}) {
    const fs::path points = folder.write(std::to_string(half) + ".xyz", halves[half]);
    meshes.push_back((folder / (std::to_string(half) + ".ply")).string());
    REQUIRE(
        tessera_command({"reconstruct", points.string(), "-o", meshes.back(), "--surface", "ground", "-q"})
            .code == 0);
  }
  // What is left of plants and taken of banks hangs together over some metres.
  const tessera::Json r = volumes(folder, {meshes[1], "--base", meshes[0], "--noise", "0.1", "--noise-length",
                                           "8", "--base-noise", "0.1", "--base-noise-length", "8"});
  const tessera::Json& row = r.at("areas")[0];
  CHECK(number(row, "covered") > 0.99e6);
  CHECK(std::abs(net(r)) < number(row, "noise_bound"));
  CHECK(number(row, "noise_bound") < 0.005 * number(row, "covered"));
}

TEST_CASE("volume: a raster with holes covers less, of any type, turned too", "[pipeline]") {
  if (!has_translate()) return;
  const TempFolder folder;
  // Half the ground is missing: cells there have no data, and those beside it no triangle.
  const fs::path ground = folder.write("ground.off", sheet(slope)),
                 whole = raster_of(folder, "whole.tif", ground, "0.5"),
                 mesh = folder.write("dome.off",
                                     sheet([](double x, double y) { return slope(x, y) + cap(x, y); }));
  const tessera::Json all = volumes(folder, {mesh.string(), "--base", whole.string()});
  // The surface ends at the centres of the outermost cells, whose edges lie at halves of units.
  CHECK(number(all.at("areas")[0], "covered") == Approx(39.75 * 40.0).epsilon(0.01));
  CHECK(std::abs(net(all) - kCapVolume) < 0.02 * kCapVolume);
  const std::string half = (folder / "half.tif").string();
  REQUIRE(shell("gdal_translate -q -srcwin 0 0 40 80 " + whole.string() + " " + half).code == 0);
  const tessera::Json west = volumes(folder, {mesh.string(), "--base", half});
  CHECK(number(west.at("areas")[0], "covered") < 0.52 * number(all.at("areas")[0], "covered"));
  CHECK(number(west.at("areas")[0], "covered") > 0.47 * number(all.at("areas")[0], "covered"));
  // Doubles, tiled, with another value for no data, and shorts with a scale.
  const std::string doubles = (folder / "doubles.tif").string(), shorts = (folder / "shorts.tif").string();
  REQUIRE(shell("gdal_translate -q -ot Float64 -co TILED=YES -co COMPRESS=LZW -a_nodata -1 " +
                whole.string() + " " + doubles)
              .code == 0);
  CHECK(volumes(folder, {mesh.string(), "--base", doubles}).at("areas") == all.at("areas"));
  REQUIRE(shell("gdal_translate -q -ot Int16 -scale 0 327.67 0 32767 -a_scale 0.01 -a_nodata none " +
                whole.string() + " " + shorts)
              .code == 0);
  CHECK(net(volumes(folder, {mesh.string(), "--base", shorts})) == Approx(net(all)).margin(0.005 * 1600));
}

TEST_CASE("volume: a map shows heights over the base, and adds up to the net volume", "[pipeline]") {
  if (!has_translate()) return;
  const TempFolder folder;
  const fs::path mesh = folder.write("dome.off",
                                     sheet([](double x, double y) { return slope(x, y) + cap(x, y); })),
                 ground = folder.write("ground.off", sheet(slope)),
                 raster = raster_of(folder, "g.tif", ground, "0.5"),
                 areas = folder.write("foot.geojson", circle(48, 11.0)), map = folder / "map.tif";
  for (const std::string& base :
       {std::string("toe"), std::string("toe-plane"), ground.string(), raster.string()}) {
    CAPTURE(base);
    const tessera::Json r = volumes(folder, {mesh.string(), "--base", base, "--within", areas.string(),
                                             "--map", map.string(), "--cell", "0.25"});
    const std::vector<float> cells = cells_of(map);
    double sum = 0.0;
    float highest = 0.0F;
    std::size_t count = 0;
    for (const float c : cells)
      if (c > -9000.0F) sum += c, ++count, highest = std::max(highest, c);
    CHECK(sum * 0.0625 == Approx(net(r)).epsilon(0.005));
    CHECK(static_cast<double>(count) * 0.0625 == Approx(number(r.at("areas")[0], "plan_area")).epsilon(0.01));
    CHECK(highest == Approx(3.0).margin(0.02));
  }
  // Without polygons wherever both are; over a level.
  volumes(folder, {mesh.string(), "--base", "plane:300", "--map", map.string(), "--cell", "1"});
  const std::vector<float> cells = cells_of(map);
  CHECK(std::count_if(cells.begin(), cells.end(), [](float c) { return c > -9000.0F; }) >= 1600);
}

TEST_CASE("volume: the same bytes over toes, rasters and maps with any cap and threads", "[pipeline]") {
  const TempFolder folder;
  const auto waves = [](double x, double y) { return slope(x, y) + std::sin(x) * std::cos(0.7 * y); };
  const fs::path mesh = folder.write("waves.off", sheet(waves, 300)),
                 ground = folder.write("ground.off", sheet(slope)),
                 raster = raster_of(folder, "g.tif", ground, "0.1"),
                 areas = folder.write("areas.geojson", "{\"type\":\"GeometryCollection\",\"geometries\":[" +
                                                           circle(5, 9.0) + "," + circle(31, 17.0, 20, 20) +
                                                           "]}");
  for (const std::string& base : {std::string("toe"), std::string("toe-plane"), raster.string()}) {
    std::string want;
    for (const auto& how :
         {std::vector<std::string>{"-t", "1", "--memory", "2G"}, {"-t", "2", "--memory", "160M"}}) {
      std::vector<std::string> words = {"volume",         mesh.string(),
                                        "--base",         base,
                                        "--within",       areas.string(),
                                        "--map",          (folder / "m.tif").string(),
                                        "--cell",         "0.5",
                                        "--json",         (folder / "v.json").string(),
                                        "--csv",          (folder / "v.csv").string(),
                                        "--noise",        "0.02",
                                        "--noise-length", "0.3",
                                        "--tolerance",    "0.01",
                                        "--force"};
      words.insert(words.end(), how.begin(), how.end());
      const CommandResult r = tessera_command(words);
      CAPTURE(base, r.errors);
      REQUIRE(r.code == 0);
      const std::string bytes =
          file_bytes(folder / "v.json") + file_bytes(folder / "v.csv") + file_bytes(folder / "m.tif");
      if (want.empty()) want = bytes;
      CHECK((bytes == want));
    }
    CHECK(file_bytes(folder / "v.csv").substr(0, 60) ==
          "area,plan_area,covered,fill,cut,net,bound,noise_bound,outlin");
  }
}

TEST_CASE("volume: four million cells below and above stay below a cap of 128 MiB, GDAL included",
          "[memory]") {
  const TempFolder folder;
  const fs::path mesh = folder.write("dome.off",
                                     sheet([](double x, double y) { return slope(x, y) + cap(x, y); })),
                 ground = folder.write("ground.off", sheet(slope)),
                 raster = raster_of(folder, "g.tif", ground, "0.02");
  const CommandResult r =
      volume({mesh.string(), "--base", raster.string(), "--map", (folder / "m.tif").string(), "--cell",
              "0.02", "--memory", "128M", "-t", "2"});
  INFO(r.errors);
  REQUIRE(r.code == 0);
  CHECK(r.peak_bytes < std::uint64_t{128} << 20);
}

TEST_CASE("volume: stopped by a signal it leaves nothing behind", "[fault]") {
  const TempFolder folder;
  const fs::path mesh = folder.write("ground.off", sheet(slope)),
                 raster = raster_of(folder, "g.tif", mesh, "0.5"), scratch = folder / "scratch";
  fs::create_directory(scratch);
  for (const char* fault : {"TESSERA_FAULT=stop:1", "TESSERA_FAULT=stop:3"}) {
    const CommandResult r =
        tessera_command({"volume", mesh.string(), "--base", raster.string(), "--map",
                         (folder / "m.tif").string(), "--cell", "0.5", "--temp", scratch.string()},
                        0, fault);
    CAPTURE(fault, r.errors);
    CHECK(r.code == 143);
    CHECK(fs::is_empty(scratch));
    CHECK_FALSE(fs::exists(folder / "m.tif"));
  }
}

TEST_CASE("volume: bases, noise and maps that cannot be are refused in a sentence", "[pipeline]") {
  const TempFolder folder;
  const fs::path mesh = folder.write("dome.off",
                                     sheet([](double x, double y) { return slope(x, y) + cap(x, y); })),
                 inside = folder.write("in.geojson", circle(12, 11.0)),
                 outside = folder.write("out.geojson", circle(12, 11.0, 32.0, 20.0)),
                 far = folder.write("far.geojson", circle(12, 5.0, 320.0, 20.0)),
                 crossing = folder.write(
                     "bow.geojson",
                     "{\"type\":\"Polygon\",\"coordinates\":[[[500005,5400005],[500015,5400015],["
                     "500015,5400005],[500005,5400016],[500005,5400005]]]}");
  const auto refused = [&](std::vector<std::string> words, int code, const std::string& why) {
    words.insert(words.begin(), mesh.string());
    const CommandResult r = volume(words);
    CAPTURE(words, r.errors);
    CHECK(r.code == code);
    CHECK_THAT(r.errors, Catch::Contains(why));
  };
  refused({"--base", "toe"}, 2, "--within");
  refused({"--base", "toe", "--within", outside.string()}, 3, "polygon 1 leaves the mesh");
  refused({"--base", "toe", "--within", far.string()}, 3, "(100 %) have no mesh");
  refused({"--base", "toe", "--within", far.string(), "--toe-gap", "1000"}, 3, "polygon 1 leaves the mesh");
  refused({"--base", "toe", "--within", crossing.string()}, 3, "crosses or touches itself");
  refused({"--base", "plane:0", "--noise", "0.1"}, 2, "--noise-length");
  refused({"--base", "plane:0", "--spacing", "0.1"}, 2, "--noise is missing");
  refused({"--base", "plane:0", "--base-noise", "0.1", "--base-spacing", "1"}, 2, "only a mesh or a raster");
  refused({"--base", "plane:0", "--map", (folder / "m.tif").string()}, 2, "--cell is missing");
  refused({"--base", "plane:0", "--cell", "1"}, 2, "--map");
  refused({"--base", "plane:0", "--map", (folder / "m.png").string(), "--cell", "1"}, 2, ".tif");
  refused({"--base", (folder / "none.tif").string()}, 3, "none.tif");
  refused({"--base", folder.write("no.tif", "no raster").string()}, 3, "no GeoTIFF");
  // A gap that the line may cross: the outline runs 2 beyond the mesh for about 13.
  const tessera::Json gap = volumes(
      folder, {mesh.string(), "--base", "toe", "--within",
               folder.write("gap.geojson", circle(64, 11.0, 31.0, 20.0)).string(), "--toe-gap", "20"});
  CHECK(number(gap.at("areas")[0], "outline_uncovered") > 10.0);
  CHECK(number(gap.at("areas")[0], "covered") < number(gap.at("areas")[0], "plan_area"));
  if (!has_translate()) return;
  const fs::path good = raster_of(folder, "good.tif", mesh, "1");
  const std::string two = (folder / "two.tif").string(), bare = (folder / "bare.tif").string();
  REQUIRE(shell("gdal_translate -q -b 1 -b 1 " + good.string() + " " + two).code == 0);
  refused({"--base", two}, 3, "has 2 bands");
  REQUIRE(shell("gdal_translate -q -co PROFILE=BASELINE " + good.string() + " " + bare).code == 0);
  fs::remove(bare + ".aux.xml");
  refused({"--base", bare}, 3, "not georeferenced");
  // Nothing is left, and no input is written over.
  refused({"--base", good.string(), "--map", good.string(), "--cell", "1", "--force"}, 2, "good.tif");
  CHECK_FALSE(fs::exists(folder / "m.tif"));
}

}  // namespace volume_bases_test
