#include "stream/formats/points/ptx_points.h"

#include <cmath>
#include <sstream>

#include "octree/points.h"
#include "tests/helpers/point_reading.h"
#include "tests/helpers/temp_folder.h"

namespace tessera::ptx_points_test {
namespace {

const std::string kIdentity = "1 0 0 0\n0 1 0 0\n0 0 1 0\n0 0 0 1\n";
const std::string kRotated = "0 1 0 0\n-1 0 0 0\n0 0 1 0\n100 200 300 1\n";  // x to y, y to -x

std::string header(const std::string& size, const std::string& position, const std::string& matrix) {
  return size + position + "\n1 0 0\n0 1 0\n0 0 1\n" + matrix;
}

std::string two_scans() {
  return header("2\n3\n", "100 200 300", kRotated) +
         "1 2 3 0.5\n0 0 0 0.5\n4 5 6 0.5\n0 0 0 0\n0 0 0 0.5\n7 8 9 1\n" +
         header("1\n2\n", "5 6 7", kIdentity) + "1 2 3 0.5 10 20 30\n4 5 6 0.5 40 50 60\n";
}

TEST_CASE("ptx points: scans, matrices, sensors, empty returns, colours", "[unit]") {
  const test::TempFolder folder;
  for (const std::string end : {"\n", "\r\n", "\r"}) {
    std::string text;
    for (const char c : two_scans()) text += c == '\n' ? end : std::string(1, c);
    for (const char* name : {"a.ptx", "a.txt"}) {
      const auto path = folder.write(name, text);
      const auto r = test::read_points(path);
      CHECK(r.info.format == "PTX with 2 scans");
      CHECK(r.info.declared_points == 8);
      CHECK(r.info.warnings.empty());
      CHECK(r.info.sensors == std::vector<Double3>{{100, 200, 300}, {5, 6, 7}});
      CHECK(r.points.x == std::vector<double>{98, 95, 92, 1, 4});
      CHECK(r.points.y == std::vector<double>{201, 204, 207, 2, 5});
      CHECK(r.points.z == std::vector<double>{303, 306, 309, 3, 6});
      CHECK(r.points.sensor == std::vector<std::uint16_t>{0, 0, 0, 1, 1});
      CHECK(r.points.rgba == std::vector<std::uint32_t>{0, 0, 0, 0xff1e140au, 0xff3c3228u});
      CHECK(r.counts.empty == 3);
      CHECK(missing_points(r.info, r.counts) == 0);
      test::require_slices_agree(path, {}, {1, 5, 10, 33, 1000});
    }
  }
}

TEST_CASE("ptx points: the matrix gives the sensor where the position is zero", "[unit]") {
  const test::TempFolder folder;
  const auto sensor = [&](const std::string& position, const std::string& matrix) {
    return test::read_points(folder.write("a.ptx", header("1\n1\n", position, matrix) + "1 1 1 0\n")).info;
  };
  CHECK(sensor("0 0 0", kRotated).sensors == std::vector<Double3>{{100, 200, 300}});
  CHECK(sensor("1 2 3", kIdentity).sensors == std::vector<Double3>{{1, 2, 3}});
  CHECK(sensor("1 2 3", kRotated).sensors == std::vector<Double3>{{1, 2, 3}});
  CHECK(sensor("1 2 3", kRotated).warnings.size() == 1);
}

TEST_CASE("ptx points: counts that lie are survived and reported", "[fault]") {
  const test::TempFolder folder;
  const auto read = [&](const std::string& size) {
    const auto path = folder.write("a.ptx", header(size, "1 2 3", kIdentity) + "1 1 1 0\n2 2 2 0\n" +
                                                header("1\n1\n", "1 2 3", kIdentity) + "3 3 3 0\n");
    test::require_slices_agree(path);
    return test::read_points(path);
  };
  auto r = read("18446744073709551615\n18446744073709551615\n");
  CHECK(r.points.size() == 3);
  CHECK(r.counts.missing > 1000);
  CHECK(r.info.warnings.size() == 1);
  r = read("1\n1\n");
  CHECK(r.points.size() == 3);
  CHECK(r.counts.missing == 0);
  CHECK(r.info.warnings.size() == 1);
  r = read("0\n5\n");
  CHECK(r.points.size() == 3);
}

TEST_CASE("ptx points: a file cut anywhere is refused in a header and read in its points", "[fault]") {
  const test::TempFolder folder;
  const std::string whole = two_scans();
  for (std::size_t bytes = 1; bytes < whole.size(); ++bytes) {
    CAPTURE(bytes);
    const auto path = folder.write("a.ptx", whole.substr(0, bytes));
    const std::string error = test::reading_error(path);
    if (!error.empty()) {
      CHECK_THAT(error, Catch::Contains("line "));
      continue;
    }
    const auto r = test::read_points(path);
    REQUIRE(r.points.size() + r.counts.empty + r.counts.missing == r.info.declared_points);
    test::require_slices_agree(path, {}, {10});
  }
}

TEST_CASE("ptx points: headers and lines that make no sense are named", "[fault]") {
  const test::TempFolder folder;
  const auto error = [&](const std::string& text) {
    return test::reading_error(folder.write("a.ptx", text));
  };
  const std::string good = header("1\n2\n", "1 2 3", kIdentity);
  CHECK_THAT(error("x\n"), Catch::Contains("line 1") && Catch::Contains("columns"));
  CHECK_THAT(error("1\nx\n"), Catch::Contains("line 2") && Catch::Contains("rows"));
  CHECK_THAT(error(header("1\n1\n", "1 2", kIdentity)),
             Catch::Contains("line 3") && Catch::Contains("3 numbers"));
  CHECK_THAT(error(header("1\n1\n", "1 2 3", "1 0 0 0\n0 1 0 0\n0 0 0 0\n0 0 0 1\n")),
             Catch::Contains("no motion"));
  CHECK_THAT(error(header("1\n1\n", "1 2 3", "nan 0 0 0\n0 1 0 0\n0 0 1 0\n0 0 0 1\n")),
             Catch::Contains("no motion"));
  CHECK_THAT(error(good + "1 2 x 4\n1 2 3 4\n"), Catch::Contains("'1 2 x 4'"));
  CHECK_THAT(error(good + "1 2 3 4\n7\n"), Catch::Contains("truncated"));
}

/// Terrain of 40 x 40 points, 0.5 apart, in the coordinates of a map, with the pose of no scan.
std::string terrain(const Double3& shift, const std::string& size = "40\n40\n") {
  std::ostringstream text;
  text.precision(12);
  text << header(size, "0 0 0", kIdentity);
  for (int i = 0; i < 40; ++i)
    for (int j = 0; j < 40; ++j)
      text << shift[0] + 0.5 * i << ' ' << shift[1] + 0.5 * j << ' '
           << shift[2] + 1.5 * std::sin(0.1 * i) * std::cos(0.07 * j) << " 0.5\n";
  return text.str();
}

TEST_CASE("ptx points: world coordinates with an identity pose have no scanner, and that is told", "[unit]") {
  const test::TempFolder folder;
  ReadOptions options;
  options.grid_normals = true;
  const std::vector<std::string> scans = {terrain({500000, 5400000, 300}), terrain({300, 100, 2}),
                                          terrain({300, 100, 200}), terrain({-10, -10, -0.5}),
                                          // No grid: all in one column, or lines that are missing.
                                          terrain({500000, 5400000, 300}, "1\n1600\n"),
                                          terrain({300, 100, 2}, "1600\n1\n"),
                                          terrain({500000, 5400000, 300}, "40\n50\n")};
  for (std::size_t i = 0; i < scans.size(); ++i) {
    CAPTURE(i);
    const auto path = folder.write("a.ptx", scans[i]);
    const auto r = test::read_points(path, ~std::uint64_t{0}, options);
    CHECK(r.info.sensors.empty());
    CHECK_FALSE(r.info.attributes.sensor);
    CHECK_FALSE(r.info.attributes.grid_normals);
    REQUIRE_FALSE(r.info.warnings.empty());
    CHECK_THAT(r.info.warnings.back(), Catch::Contains("no scanner can have stood at 0 0 0"));
    CHECK(r.points.size() == 1600);
    test::require_slices_agree(path, options, {500, 5000});
  }
  // The same terrain as a scanner above it sees it, and a file of one scan of each kind.
  std::ostringstream seen;
  seen.precision(12);
  seen << header("40\n40\n", "0 0 0", kIdentity);
  for (int i = 0; i < 40; ++i)
    for (int j = 0; j < 40; ++j) {
      const double yaw = 0.05 * i, down = 0.2 + 0.02 * j, range = 4.0 + std::sin(0.9 * i) * std::cos(0.7 * j);
      seen << range * std::cos(down) * std::cos(yaw) << ' ' << range * std::cos(down) * std::sin(yaw) << ' '
           << -range * std::sin(down) << " 0.5\n";
    }
  const auto right = test::read_points(folder.write("a.ptx", seen.str()), ~std::uint64_t{0}, options);
  CHECK(right.info.sensors == std::vector<Double3>{{0, 0, 0}});
  CHECK(right.info.warnings.empty());
  const auto path = folder.write("a.ptx", terrain({500000, 5400000, 300}) + seen.str());
  const auto both = test::read_points(path, ~std::uint64_t{0}, options);
  CHECK(both.info.sensors == std::vector<Double3>{{0, 0, 0}});
  CHECK(both.points.sensor.front() == kNoSensor);
  CHECK(both.points.sensor.back() == 0);
  REQUIRE(both.info.warnings.size() == 1);
  CHECK_THAT(both.info.warnings[0], Catch::StartsWith("scan 1:"));
  test::require_slices_agree(path, options, {500, 5000});
}

}  // namespace
}  // namespace tessera::ptx_points_test
