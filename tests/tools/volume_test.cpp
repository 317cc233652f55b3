// `volume` on meshes whose volumes are known.
#include <catch2/catch.hpp>

#include <cmath>
#include <functional>
#include <string>

#include "stream/files/json.h"
#include "tests/helpers/command.h"
#include "tests/helpers/height_sheet.h"
#include "tests/helpers/temp_folder.h"

namespace volume_test {

using namespace tessera::test;

namespace {

constexpr int kSteps = 40;

std::string heights(const std::function<double(double, double)>& height, double x0 = 0.0, double y0 = 0.0) {
  return height_sheet(kSteps, kSteps, x0, y0, height);
}

tessera::Json volumes(const TempFolder& folder, std::vector<std::string> words) {
  const auto json = folder.path() / "volumes.json";
  words.insert(words.begin(), "volume");
  words.insert(words.end(), {"--json", json.string(), "--force"});
  const CommandResult r = tessera_command(words);
  INFO(r.errors);
  REQUIRE(r.code == 0);
  return tessera::parse_json(file_bytes(json));
}

double number(const tessera::Json& row, const char* key) {
  return row.at(key).get<double>();
}

}  // namespace

TEST_CASE("volume: a roof over a level, cut and filled, the same bytes on any threads", "[pipeline]") {
  const TempFolder folder;
  // Two planes that meet in a ridge 10 above the eaves: 40 * 40 * 10 / 2 over the eaves.
  const auto roof =
      folder.write("roof.off", heights([](double x, double) { return 100.0 + std::min(x, 40.0 - x) / 2.0; }));
  const tessera::Json low = volumes(folder, {roof.string(), "--base", "plane:100", "-t", "1"});
  CHECK(number(low.at("areas")[0], "fill") == Approx(8000.0));
  CHECK(number(low.at("areas")[0], "cut") == 0.0);
  CHECK(number(low.at("areas")[0], "covered") == Approx(1600.0));
  CHECK(low.at("areas")[0].at("bound").is_null());
  CHECK(volumes(folder, {roof.string(), "--base", "plane:100", "-t", "2"}) == low);
  // Half way up: two thirds of a wedge on either side.
  const tessera::Json half = volumes(folder, {roof.string(), "--base", "plane:105", "--tolerance", "0.01"});
  CHECK(number(half.at("areas")[0], "fill") == Approx(2000.0));
  CHECK(number(half.at("areas")[0], "cut") == Approx(2000.0));
  CHECK(number(half.at("areas")[0], "bound") == Approx(0.01 * 1600.0 * std::sqrt(1.25)));
}

TEST_CASE("volume: a heap and a pit against the ground of another survey, per polygon, at survey coordinates",
          "[pipeline]") {
  const TempFolder folder;
  constexpr double kX = 500000.25, kY = 5400000.5;
  const auto ground = [](double x, double y) { return 300.0 + 0.1 * x - 0.05 * y; };
  const auto before = folder.write("before.off", heights(ground, kX, kY));
  // A pyramid of 10 x 10 x 4 on the ground, and one into it; by other triangles than the ground's: half a step aside.
  const auto bump = [](double x, double y, double cx, double cy) {
    return 4.0 * std::max(0.0, 1.0 - std::max(std::abs(x - cx), std::abs(y - cy)) / 5.0);
  };
  const auto after = folder.write(
      "after.off",
      heights([&](double x,
                  double y) { return ground(x + 0.5, y + 0.5) + bump(x, y, 10, 10) - bump(x, y, 30, 25); },
              kX + 0.5, kY + 0.5));
  const auto areas = folder.write("areas.geojson",
                                  R"({"type": "FeatureCollection", "features": [
        {"type": "Feature", "geometry": {"type": "Polygon", "coordinates": [[[500003,5400003],[500019,5400003],[500019,5400019],[500003,5400019],[500003,5400003]]]}},
        {"type": "Feature", "geometry": {"type": "Polygon", "coordinates": [[[500022,5400017],[500039,5400017],[500039,5400034],[500022,5400034],[500022,5400017]]]}},
        {"type": "Feature", "geometry": {"type": "Polygon", "coordinates": [[[500002,5400030],[500012,5400030],[500012,5400040],[500002,5400040],[500002,5400030]],
          [[500004,5400032],[500010,5400032],[500010,5400038],[500004,5400038],[500004,5400032]]]}}]})");
  const tessera::Json r =
      volumes(folder, {after.string(), "--base", before.string(), "--within", areas.string(), "--tolerance",
                       "0.001", "--base-tolerance", "0.002"});
  const tessera::Json& rows = r.at("areas");
  REQUIRE(rows.size() == 3);
  const double pyramid = 10.0 * 10.0 * 4.0 / 3.0;
  CHECK(number(rows[0], "fill") == Approx(pyramid).epsilon(0.02));  // its flanks are made of steps
  CHECK(number(rows[0], "cut") == Approx(0.0).margin(1e-6));
  CHECK(number(rows[0], "plan_area") == Approx(256.0));
  CHECK(number(rows[0], "covered") == Approx(256.0));
  CHECK(number(rows[1], "cut") == Approx(pyramid).epsilon(0.02));
  CHECK(number(rows[1], "fill") == Approx(0.0).margin(1e-6));
  CHECK(number(rows[2], "plan_area") == Approx(64.0));  // less its hole
  CHECK(number(rows[2], "net") == Approx(0.0).margin(1e-6));
  CHECK(number(rows[0], "bound") > 0.003 * 256.0);
  CHECK(number(rows[0], "bound") < 0.003 * 500.0);
  // A mesh against itself.
  const tessera::Json self = volumes(folder, {after.string(), "--base", after.string()});
  CHECK(number(self.at("areas")[0], "fill") == Approx(0.0).margin(1e-6));
  CHECK(number(self.at("areas")[0], "covered") == Approx(1600.0));
}

TEST_CASE("volume: what the report beside a mesh proves bounds its volumes, if the mesh is that one",
          "[pipeline]") {
  const TempFolder folder;
  const auto hill = folder.write("hill.off", heights([](double x, double y) {
                                   return 50.0 + 5.0 * std::sin(x / 6.0) * std::cos(y / 7.0);
                                 }));
  const auto small = folder.path() / "small.ply";
  REQUIRE(tessera_command(
              {"decimate", hill.string(), "-o", small.string(), "--tolerance", "0.05", "--no-html", "-q"})
              .code == 0);
  const tessera::Json report = tessera::parse_json(file_bytes(small.string() + ".report.json"));
  const double proven = report.at("certificate").at("certified_max").get<double>();
  const tessera::Json before = volumes(folder, {hill.string(), "--base", "plane:50"}),
                      after = volumes(folder, {small.string(), "--base", "plane:50"});
  const tessera::Json& row = after.at("areas")[0];
  CHECK(number(row, "bound") == Approx(proven * number(row, "surface")));
  CHECK(std::abs(number(row, "net") - number(before.at("areas")[0], "net")) < number(row, "bound"));
  // Another mesh under the same name.
  std::filesystem::copy_file(hill, folder.path() / "other.off");
  std::filesystem::copy_file(small.string() + ".report.json", folder.path() / "other.off.report.json");
  const tessera::Json other = volumes(folder, {(folder.path() / "other.off").string(), "--base", "plane:50"});
  CHECK(other.at("areas")[0].at("bound").is_null());
}

TEST_CASE("volume: a box has its volume over the ground that it stands on, and is no base", "[pipeline]") {
  const TempFolder folder;
  const auto box = folder.write("box.off",
                                "OFF 8 6 0\n0 0 1\n2 0 1\n2 3 1\n0 3 1\n0 0 5\n2 0 5\n2 3 5\n0 3 5\n"
                                "4 3 2 1 0\n4 4 5 6 7\n4 0 1 5 4\n4 1 2 6 5\n4 2 3 7 6\n4 3 0 4 7\n");
  const tessera::Json r = volumes(folder, {box.string(), "--base", "plane:0"});
  CHECK(number(r.at("areas")[0], "net") == Approx(24.0));
  const CommandResult closed = tessera_command({"volume", box.string(), "--base", box.string()});
  CHECK(closed.code == 2);
  CHECK_THAT(closed.errors, Catch::Contains("no one height"));
  for (const char* level : {"plane:x", "plane:", "plane:nan", "plane:inf", "plane:1e300", "plane:3m"})
    CHECK(tessera_command({"volume", box.string(), "--base", level}).code == 2);
  CHECK(tessera_command({"volume", box.string()}).code == 2);
}

}  // namespace volume_test
