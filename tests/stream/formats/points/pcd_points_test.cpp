#include "stream/formats/points/pcd_points.h"

#include <array>
#include <cmath>
#include <limits>

#include "tests/helpers/lzf_block.h"
#include "tests/helpers/point_reading.h"
#include "tests/helpers/random.h"
#include "tests/helpers/skip.h"
#include "tests/helpers/temp_folder.h"

namespace tessera::pcd_points_test {
namespace {

std::string header(const std::string& points, const std::string& data,
                   const std::string& viewpoint = "0 0 0 1 0 0 0") {
  return "# .PCD v0.7 - Point Cloud Data file format\nVERSION 0.7\nFIELDS x y _ z normal_x normal_y normal_z "
         "rgb intensity\n"
         "SIZE 4 4 2 8 4 4 4 4 1\nTYPE F F U F F F F F U\nCOUNT 1 1 3 1 1 1 1 1 1\nWIDTH " +
         points + "\nHEIGHT 1\nVIEWPOINT " + viewpoint + "\nPOINTS " + points + "\nDATA " + data + "\n";
}
constexpr std::size_t kStride = 39;

/// Point i of these files: position (i, -i, i/4), normal (0, 0, 1), colour i, 2i, 3i.
std::string records(int count) {
  std::string bytes;
  for (int i = 0; i < count; ++i) {
    test::put(bytes, static_cast<float>(i)), test::put(bytes, static_cast<float>(-i));
    bytes += "??????";
    test::put(bytes, i * 0.25);
    test::put(bytes, 0.0f), test::put(bytes, 0.0f), test::put(bytes, 1.0f);
    const auto c = static_cast<std::uint32_t>(i) & 63u;
    test::put(bytes, c << 16 | 2 * c << 8 | 3 * c);
    bytes += '\7';
  }
  return bytes;
}

/// Field after field.
std::string fields(const std::string& records) {
  std::string bytes;
  std::size_t at = 0;
  for (const std::size_t size : {4, 4, 6, 8, 4, 4, 4, 4, 1}) {
    for (std::size_t r = 0; r < records.size(); r += kStride) bytes += records.substr(r + at, size);
    at += size;
  }
  return bytes;
}

std::string block(const std::string& bytes) {
  const std::string packed = test::lzf_block(bytes);
  std::string out;
  test::put(out, static_cast<std::uint32_t>(packed.size())),
      test::put(out, static_cast<std::uint32_t>(bytes.size()));
  return out + packed;
}

void require_points(const test::ReadResult& r, int count) {
  REQUIRE(r.points.size() == static_cast<std::size_t>(count));
  for (int i = 0; i < count; ++i) {
    const auto k = static_cast<std::size_t>(i);
    const auto c = static_cast<std::uint32_t>(i) & 63u;
    REQUIRE(r.points.x[k] == i);
    REQUIRE(r.points.y[k] == -i);
    REQUIRE(r.points.z[k] == i * 0.25);
    REQUIRE(r.points.nz[k] == 1.0f);
    REQUIRE(r.points.rgba[k] == (0xff000000u | 3 * c << 16 | 2 * c << 8 | c));
  }
}

TEST_CASE("pcd points: binary and compressed say the same, whatever the slices", "[unit]") {
  const test::TempFolder folder;
  const int n = GENERATE(1, 5, 3000);
  const std::string count = std::to_string(n);
  const auto binary = folder.write("a.pcd", header(count, "binary", "1 2 3 1 0 0 0") + records(n));
  const auto packed =
      folder.write("b.pcd", header(count, "binary_compressed", "1 2 3 1 0 0 0") + block(fields(records(n))));
  for (const auto& path : {binary, packed}) {
    const auto r = test::read_points(path);
    CHECK(r.info.warnings.empty());
    CHECK(r.info.declared_points == static_cast<std::uint64_t>(n));
    CHECK(r.info.sensors == std::vector<Double3>{{1, 2, 3}});
    CHECK(r.info.attributes.intensity);
    CHECK(missing_points(r.info, r.counts) == 0);
    require_points(r, n);
    test::require_slices_agree(path);
  }
  CHECK(test::read_points(binary).info.format == "PCD binary");
  CHECK(test::read_points(packed).info.format == "PCD binary compressed");
  CHECK(test::read_points(folder.write("c.pcd", header(count, "binary") + records(n))).info.sensors.empty());
}

TEST_CASE(
    "pcd points: rows of a depth camera were seen from the origin, unless they do not fit or are told "
    "otherwise",
    "[unit]") {
  const test::TempFolder folder;
  constexpr int kWidth = 64, kHeight = 48;
  // A camera before bumps; moved away, the rays of a row lie in no plane with the origin.
  const auto cloud = [&](const Double3& camera, const std::string& size, const std::string& viewpoint) {
    std::string out = "VERSION .7\nFIELDS x y z\nSIZE 4 4 4\nTYPE F F F\n" + size + "\nVIEWPOINT " +
                      viewpoint + "\nPOINTS 3072\nDATA ascii\n";
    for (int row = 0; row < kHeight; ++row)
      for (int column = 0; column < kWidth; ++column) {
        const double depth = 2.0 + 0.6 * std::sin(0.4 * column) * std::cos(0.5 * row);
        out += std::to_string(camera[0] + depth * (column - kWidth / 2) / 60.0) + " " +
               std::to_string(camera[1] + depth * (row - kHeight / 2) / 60.0) + " " +
               std::to_string(camera[2] + depth) + "\n";
      }
    return test::read_points(folder.write("a.pcd", out)).info.sensors;
  };
  const std::string grid = "WIDTH 64\nHEIGHT 48", none = "0 0 0 1 0 0 0";
  CHECK(cloud({}, grid, none) == std::vector<Double3>{{0, 0, 0}});
  CHECK(cloud({}, grid, "7 8 9 1 0 0 0") == std::vector<Double3>{{7, 8, 9}});
  CHECK(cloud({}, "WIDTH 3072\nHEIGHT 1", none).empty());
  CHECK(cloud({3, -2, 1}, grid, none).empty());
  CHECK(cloud({400000, 5000000, 300}, grid, none).empty());
}

TEST_CASE("pcd points: ascii, with packed colours as floats and as whole numbers", "[unit]") {
  const test::TempFolder folder;
  for (const std::string end : {"\n", "\r\n"}) {
    const std::string text = "# .PCD v0.7" + end + "VERSION .7" + end + "FIELDS x y z rgb" + end +
                             "SIZE 4 4 4 4" + end + "TYPE F F F F" + end + "WIDTH 3" + end + "HEIGHT 1" +
                             end + "DATA ascii" + end + "1 2 3 4.2108e+06" + end + "nan nan nan 0" + end +
                             "4 5 6 2.3509887e-38" + end;
    const auto path = folder.write("a.pcd", text);
    const auto r = test::read_points(path);
    REQUIRE(r.points.size() == 3);
    CHECK(r.points.x[0] == 1);
    CHECK(std::isnan(r.points.z[1]));
    CHECK(r.points.rgba[0] == 0xffe08080u);  // 4.2108e6 as a float is 0x4a8080e0
    CHECK(r.points.rgba[2] == 0xff000000u);
    CHECK(missing_points(r.info, r.counts) == 0);
    test::require_slices_agree(path);
  }
  const std::string old =
      "COLUMNS x y z rgba\nSIZE 4 4 4 4\nTYPE F F F U\nPOINTS 2\nDATA ascii\n1 2 3 4286578943\n4 5 6 255\n";
  CHECK(test::read_points(folder.write("b.pcd", old)).points.rgba ==
        std::vector<std::uint32_t>{0xffff0080u, 0xffff0000u});
}

TEST_CASE("pcd points: fields are the same in capitals, colours of any type and scale", "[unit]") {
  const test::TempFolder folder;
  const auto head = [](const std::string& fields, const std::string& size, const std::string& type,
                       const std::string& data) {
    return "VERSION 0.7\nFIELDS " + fields + "\nSIZE " + size + "\nTYPE " + type +
           "\nWIDTH 2\nHEIGHT 1\nPOINTS 2\nDATA " + data + "\n";
  };
  using V = std::vector<std::uint32_t>;
  auto r = test::read_points(folder.write(
      "a.pcd", head("X Y Z Intensity Red Green Blue ring", "8 8 8 2 2 2 2 1", "F F F U U U U U", "ascii") +
                   "1 2 3 7 65535 0 0 5\n4 5 6 7 0 32896 0 5\n"));
  CHECK(r.points.x == std::vector<double>{1, 4});
  CHECK(r.points.rgba == V{0xff0000ffu, 0xff008000u});
  CHECK(r.info.left_out == std::vector<std::string>{"ring"});
  r = test::read_points(folder.write(
      "b.pcd", head("x y z r g b", "4 4 4 4 4 4", "F F F F F F", "ascii") + "1 2 3 1 0 0\n4 5 6 0 0.5 0\n"));
  CHECK(r.points.rgba == V{0xff0000ffu, 0xff008000u});
  r = test::read_points(folder.write("c.pcd", head("x y z r g b", "4 4 4 4 4 4", "F F F F F F", "ascii") +
                                                  "1 2 3 255 0 0\n4 5 6 0 128 0\n"));
  CHECK(r.points.rgba == V{0xff0000ffu, 0xff008000u});
  for (const std::string kind : {"binary", "binary_compressed"}) {
    std::string rows, columns;
    const std::array<std::array<float, 6>, 2> v = {{{1, 2, 3, 1, 0, 0}, {4, 5, 6, 0, 0.5f, 0}}};
    for (const auto& row : v)
      for (const float x : row) test::put(rows, x);
    for (std::size_t c = 0; c < 6; ++c)
      for (const auto& row : v) test::put(columns, row[c]);
    r = test::read_points(folder.write("d.pcd", head("X y Z R G B", "4 4 4 4 4 4", "F F F F F F", kind) +
                                                    (kind == "binary" ? rows : block(columns))));
    CHECK(r.points.z == std::vector<double>{3, 6});
    CHECK(r.points.rgba == V{0xff0000ffu, 0xff008000u});
  }
}

TEST_CASE("pcd points: blocks of any content unpack to what was packed", "[property]") {
  const test::TempFolder folder;
  test::Random random(5);
  for (int round = 0; round < 30; ++round) {
    const std::size_t n = 1 + random.below(4000);
    std::string x;
    for (std::size_t i = 0; i < n; ++i) {
      const bool far = random.below(50) == 0;  // a match that reaches back as far as can be
      test::put(x, static_cast<float>(far ? 1e9 * random.unit()
                                          : static_cast<double>(random.below(3 + 97 * (i / 500 % 2)))));
    }
    const std::string all = x + x + x;
    const auto path =
        folder.write("a.pcd", "FIELDS x y z\nSIZE 4 4 4\nTYPE F F F\nPOINTS " + std::to_string(n) +
                                  "\nDATA binary_compressed\n" + block(all));
    const auto r = test::read_points(path);
    REQUIRE(r.points.size() == n);
    for (std::size_t i = 0; i < n; ++i) {
      float value = 0;
      std::memcpy(&value, x.data() + 4 * i, 4);
      REQUIRE(r.points.x[i] == value);
      REQUIRE(r.points.z[i] == value);
    }
  }
}

TEST_CASE("pcd points: counts that lie and files that end early", "[fault]") {
  const test::TempFolder folder;
  const std::string many = "1000000000000";
  for (const std::string kind : {"binary", "binary_compressed"}) {
    const std::string data = kind == "binary" ? records(5) : block(fields(records(5)));
    auto path = folder.write("a.pcd", header(many, kind) + data);
    auto r = test::read_points(path);
    require_points(r, 5);
    CHECK(r.counts.missing == 1000000000000 - 5);
    CHECK(r.info.warnings.size() == 1);
    test::require_slices_agree(path);
    r = test::read_points(folder.write("a.pcd", header("2", kind) + data));
    require_points(r, 5);
  }
  const std::string whole = header("300", "binary_compressed") + block(fields(records(300)));
  bool partly = false;
  for (std::size_t i = 0; i < 200; ++i) {
    const std::size_t bytes = 1 + i * (whole.size() - 1) / 200;
    CAPTURE(bytes);
    const auto path = folder.write("a.pcd", whole.substr(0, bytes));
    const std::string error = test::reading_error(path);
    if (!error.empty()) continue;
    const auto r = test::read_points(path);
    REQUIRE(r.points.size() + r.counts.missing == 300);
    require_points(r, static_cast<int>(r.points.size()));
    partly = partly || (r.points.size() > 0 && r.counts.missing > 0);
  }
  CHECK(partly);
}

TEST_CASE("pcd points: what makes no sense is named with its line or byte", "[fault]") {
  const test::TempFolder folder;
  const auto error = [&](const std::string& text) {
    return test::reading_error(folder.write("a.pcd", text));
  };
  const std::string good = "FIELDS x y z\nSIZE 4 4 4\nTYPE F F F\nPOINTS 1\n";
  REQUIRE(error(good + "DATA ascii\n1 2 3\n").empty());
  CHECK_THAT(error(good), Catch::Contains("no DATA line"));
  CHECK_THAT(error(good + "DATA packed\n"), Catch::Contains("line 5") && Catch::Contains("'packed'"));
  CHECK_THAT(error(good + "COLOUR 3\nDATA ascii\n"),
             Catch::Contains("line 5") && Catch::Contains("'COLOUR'"));
  CHECK_THAT(error("FIELDS x y z\nSIZE 4 4\nTYPE F F F\nDATA ascii\n"), Catch::Contains("2 SIZEs"));
  CHECK_THAT(error("FIELDS x y z\nSIZE 4 4 3\nTYPE F F F\nDATA ascii\n"), Catch::Contains("field 'z'"));
  CHECK_THAT(error("FIELDS x y u\nSIZE 4 4 4\nTYPE F F F\nDATA ascii\n"), Catch::Contains("lack x, y or z"));
  CHECK_THAT(error(good + "POINTS -1\n"), Catch::Contains("'-1'"));
  CHECK_THAT(error("FIELDS x y z\nSIZE 4 4 4\nTYPE F F F\nCOUNT 1 1 99999999\nDATA binary\n"),
             Catch::Contains("65536"));
  CHECK_THAT(error(good + "DATA ascii\n1 2\n3 4 5\n"), Catch::Contains("line 6") && Catch::Contains("'1 2'"));
  CHECK_THAT(error(good + "DATA binary_compressed\n123"), Catch::Contains("truncated"));
  std::string lone = good + "DATA binary_compressed\n";
  test::put(lone, std::uint32_t{3}), test::put(lone, std::uint32_t{12});
  CHECK_THAT(error(lone + "\x20\x05z"), Catch::Contains("byte " + std::to_string(lone.size())) &&
                                            Catch::Contains("before their beginning"));
  std::string odd = good + "DATA binary_compressed\n";
  test::put(odd, std::uint32_t{3}), test::put(odd, std::uint32_t{7});
  CHECK_THAT(error(odd + "abc"), Catch::Contains("no whole number of records"));
}

TEST_CASE("pcd points: the catalogue's files are read whole", "[unit][.shared]") {
  if (!test::has_shared_data()) return;
  const auto office = test::read_points(test::kSharedData / "dirty/rgbd-office1.pcd");
  CHECK(office.points.size() == 307200);
  CHECK(std::count_if(office.points.x.begin(), office.points.x.end(),
                      [](double x) { return std::isnan(x); }) == 52744);
  CHECK(office.info.sensors == std::vector<Double3>{{0, 0, 0}});  // its viewpoint turns
  const auto rs1 = test::read_points(test::kSharedData / "scans/pcl-rs1.pcd");
  CHECK(rs1.points.size() == 289541);
  CHECK(rs1.info.sensors.empty());
}

}  // namespace
}  // namespace tessera::pcd_points_test
