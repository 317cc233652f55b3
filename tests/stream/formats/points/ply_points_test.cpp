#include "stream/formats/points/ply_points.h"

#include <cmath>
#include <limits>

#include "tests/helpers/point_reading.h"
#include "tests/helpers/skip.h"
#include "tests/helpers/temp_folder.h"

namespace tessera::ply_points_test {
namespace {

using test::put;

/// Vertices with everything in an awkward order, a face element and a list between; `count` vertices.
std::string awkward(const std::string& format, int count, bool list, const std::string& end = "\n") {
  const bool big = format == "binary_big_endian";
  std::string header = "ply" + end + "format " + format + " 1.0" + end + "comment hello" + end +
                       "element thing 2" + end + "property uchar a" + end + "element vertex " +
                       std::to_string(count) + end + "property double z" + end + "property uchar blue" + end +
                       "property float nx" + end;
  if (list) header += "property list uchar short ring" + end;
  header += "property float x" + end + "property uchar red" + end + "property uchar green" + end +
            "property float ny" + end + "property float nz" + end + "property int y" + end +
            "element face 1" + end + "property list uchar int vertex_indices" + end + "end_header" + end;
  std::string data;
  if (format == "ascii") {
    data = "1" + end + "2" + end;
    for (int i = 0; i < count; ++i) {
      data += std::to_string(i) + ".25 " + std::to_string(i % 256) + " 1e0" + (list ? " 2 7 8" : "") + " " +
              std::to_string(i) + ".5 3 4 -0.5 0 " + std::to_string(-i) + end;
    }
    data += "3 0 1 2" + end;
  } else {
    data = "\1\2";
    for (int i = 0; i < count; ++i) {
      put(data, i + 0.25, big), put(data, static_cast<std::uint8_t>(i % 256)), put(data, 1.0f, big);
      if (list) data += "\2abcd";
      put(data, static_cast<float>(i) + 0.5f, big), data += "\3\4", put(data, -0.5f, big),
          put(data, 0.0f, big), put(data, -i, big);
    }
    data += "\3" + std::string(12, '\0');
  }
  return header + data;
}

void check_awkward(const test::ReadResult& r, std::size_t count) {
  REQUIRE(r.points.size() == count);
  CHECK(r.counts.missing == 0);
  CHECK(r.info.attributes.normals);
  CHECK(r.info.attributes.colour);
  CHECK(r.info.warnings.empty());
  for (std::size_t i = 0; i < count; ++i) {
    const auto d = static_cast<double>(i);
    REQUIRE(r.points.x[i] == d + 0.5);
    REQUIRE(r.points.y[i] == -d);
    REQUIRE(r.points.z[i] == d + 0.25);
    REQUIRE(r.points.nx[i] == 1.0f);
    REQUIRE(r.points.ny[i] == -0.5f);
    REQUIRE(r.points.rgba[i] == (0xff000403u | (i % 256) << 16));
  }
}

TEST_CASE("ply points: any order and type, elements around, lists, three encodings", "[unit]") {
  const test::TempFolder folder;
  for (const std::string format : {"ascii", "binary_little_endian", "binary_big_endian"}) {
    for (const bool list : {false, true}) {
      for (const std::string end : {"\n", "\r\n", "\r"}) {
        CAPTURE(format, list, end);
        const auto path = folder.write("a.ply", awkward(format, 700, list, end));
        const auto r = test::read_points(path);
        check_awkward(r, 700);
        CHECK(r.info.declared_points == 700);
        test::require_slices_agree(path);
      }
    }
  }
}

TEST_CASE("ply points: a file cut anywhere gives the whole vertices before the cut", "[fault]") {
  const test::TempFolder folder;
  for (const std::string format : {"ascii", "binary_little_endian", "binary_big_endian"}) {
    for (const bool list : {false, true}) {
      const std::string whole = awkward(format, 20, list);
      const std::size_t data = whole.find("end_header\n") + 11;
      for (std::size_t bytes = data; bytes < whole.size(); ++bytes) {
        CAPTURE(format, list, bytes - data);
        const auto path = folder.write("cut.ply", whole.substr(0, bytes));
        const auto r = test::read_points(path);
        REQUIRE(r.points.size() + r.counts.missing == 20);
        REQUIRE(missing_points(r.info, r.counts) == r.counts.missing);
        for (std::size_t i = 0; i < r.points.size(); ++i) REQUIRE(r.points.y[i] == -static_cast<double>(i));
        if (r.counts.missing > 0)
          REQUIRE(r.info.warnings.size() + r.counts.warnings.size() + (format == "ascii" || list) > 0);
      }
    }
  }
}

std::string cloud(const std::string& format, const std::string& count, const std::string& properties,
                  const std::string& data) {
  return "ply\nformat " + format + " 1.0\nelement vertex " + count + "\n" + properties + "end_header\n" +
         data;
}
const std::string kXyz = "property float x\nproperty float y\nproperty float z\n";

std::string triples(int n) {
  std::string data;
  for (int i = 0; i < n; ++i) put(data, static_cast<float>(i)), put(data, 1.0f), put(data, 2.0f);
  return data;
}

TEST_CASE("ply points: counts that lie are survived and reported", "[fault]") {
  const test::TempFolder folder;
  const auto read = [&](const std::string& count, const std::string& data) {
    const auto path = folder.write("lie.ply", cloud("binary_little_endian", count, kXyz, data));
    test::require_slices_agree(path);
    return test::read_points(path);
  };
  auto r = read("18446744073709551615", triples(5));  // no allocation by the header
  CHECK(r.points.size() == 5);
  CHECK(r.counts.missing == 18446744073709551610u);
  CHECK(r.info.warnings.size() == 1);
  r = read("0", triples(5));
  CHECK(r.points.size() == 5);
  CHECK(r.info.warnings.size() == 1);
  r = read("3", triples(5));
  CHECK(r.points.size() == 5);
  CHECK(r.info.warnings.size() == 1);
  r = read("3", triples(5) + "x");  // not whole records: what else it is, nobody knows
  CHECK(r.points.size() == 3);
  CHECK(r.info.warnings.size() == 1);
  r = read("5", triples(5) + "\n");
  CHECK(r.points.size() == 5);
  CHECK(r.info.warnings.empty());
  r = read("0", "");
  CHECK(r.points.size() == 0);
  CHECK(r.info.warnings.empty());

  const auto ascii = folder.write("lie2.ply", cloud("ascii", "9", kXyz, "0 0 0\n1 1 1\n\n2 2 2\n"));
  r = test::read_points(ascii);
  CHECK(r.points.size() == 3);
  CHECK(missing_points(r.info, r.counts) == 6);
  CHECK(refuted_claims(r.info, r.counts, {0, 0, 0}, {2, 2, 2}).size() == 1);
}

TEST_CASE("ply points: ascii slices at line boundaries, torn and bad lines", "[fault]") {
  const test::TempFolder folder;
  std::string data;
  for (int i = 0; i < 300; ++i) data += std::to_string(i) + (i % 3 == 0 ? " 1 2\r\n" : "\t-1.5e-3 2 extra\n");
  auto path = folder.write("a.ply", cloud("ascii", "300", kXyz, data));
  CHECK(test::read_points(path).points.size() == 300);
  test::require_slices_agree(path, {}, {1, 2, 3, 5, 17, 1000});

  path = folder.write("torn.ply", cloud("ascii", "300", kXyz, data + "300 4"));
  test::require_slices_agree(path);
  const auto r = test::read_points(path);
  CHECK(r.points.size() == 300);
  CHECK(r.counts.missing == 1);

  path = folder.write("bad.ply", cloud("ascii", "302", kXyz, data + "300 4 x\n301 0 0\n"));
  CHECK_THAT(test::reading_error(path), Catch::Contains("line 308") && Catch::Contains("300 4 x"));
}

TEST_CASE("ply points: lines with more values than declared are counted", "[unit]") {
  const test::TempFolder folder;
  std::string text =
      "ply\nformat ascii 1.0\nMade by hand\nelement vertex 40\nproperty float x\nproperty float y\nproperty "
      "float z\nend_header\n";
  for (int i = 0; i < 40; ++i) text += "1 2 " + std::to_string(i) + (i % 4 == 0 ? " 255 0 7\n" : " \n");
  const auto path = folder.write("a.ply", text);
  const auto r = test::read_points(path);
  CHECK(r.points.size() == 40);
  CHECK(r.points.z[39] == 39);
  CHECK(r.counts.surplus == 10);
  const auto sentences = refuted_claims(r.info, r.counts, {1, 2, 0}, {1, 2, 39});
  REQUIRE(sentences.size() == 1);
  CHECK_THAT(sentences[0], Catch::Contains("10 lines hold more values"));
  REQUIRE(r.info.warnings.size() == 1);
  CHECK_THAT(r.info.warnings[0], Catch::Contains("line 3"));
  test::require_slices_agree(path);
}

TEST_CASE("ply points: not-a-number passes on, in every encoding", "[unit]") {
  const test::TempFolder folder;
  const float nan = std::numeric_limits<float>::quiet_NaN();
  std::string data;
  for (const float v : {nan, 1.0f, std::numeric_limits<float>::infinity()}) put(data, v);
  const auto check = [&](const std::string& text) {
    const auto r = test::read_points(folder.write("nan.ply", text));
    REQUIRE(r.points.size() == 1);
    CHECK(std::isnan(r.points.x[0]));
    CHECK(r.points.y[0] == 1);
    CHECK(std::isinf(r.points.z[0]));
  };
  check(cloud("binary_little_endian", "1", kXyz, data));
  check(cloud("ascii", "1", kXyz, "nan 1 inf\n"));
  check(cloud("ascii", "1", kXyz, "-1.#IND 1 1.#INF\n"));
}

TEST_CASE("ply points: colours of 16 bits and floats are scaled by what the file holds", "[unit]") {
  const test::TempFolder folder;
  const auto colour = [&](const std::string& type, const auto& values) {
    std::string data;
    for (const auto v : values)
      put(data, 0.0f), put(data, 0.0f), put(data, 0.0f), put(data, v), put(data, v), put(data, v);
    const auto path = folder.write("c.ply", cloud("binary_little_endian", std::to_string(values.size()),
                                                  kXyz + "property " + type + " red\nproperty " + type +
                                                      " green\nproperty " + type + " blue\n",
                                                  data));
    test::require_slices_agree(path);
    return test::read_points(path).points.rgba;
  };
  using V = std::vector<std::uint32_t>;
  CHECK(colour("ushort", std::vector<std::uint16_t>{0, 65535, 128 * 257, 128 * 256}) ==
        V{0xff000000u, 0xffffffffu, 0xff808080u, 0xff808080u});
  CHECK(colour("ushort", std::vector<std::uint16_t>{0, 255, 7}) == V{0xff000000u, 0xffffffffu, 0xff070707u});
  CHECK(colour("float", std::vector<float>{0, 1, 0.5f}) == V{0xff000000u, 0xffffffffu, 0xff808080u});
  CHECK(colour("float", std::vector<float>{0, 255, 7}) == V{0xff000000u, 0xffffffffu, 0xff070707u});
  CHECK(colour("uchar", std::vector<std::uint8_t>{0, 1, 255}) == V{0xff000000u, 0xff010101u, 0xffffffffu});
  const auto r = test::read_points(folder.write(
      "d.ply",
      cloud("ascii", "1",
            kXyz + "property uchar diffuse_red\nproperty uchar diffuse_green\nproperty uchar diffuse_blue\n",
            "1 2 3 4 5 6\n")));
  CHECK(r.points.rgba == V{0xff060504u});
}

TEST_CASE(
    "ply points: fields are the same in capitals, with other names for colours, and none goes without a word",
    "[unit]") {
  const test::TempFolder folder;
  const auto read = [&](const std::string& properties, const std::string& line) {
    return test::read_points(folder.write("c.ply", cloud("ascii", "1", properties, line)));
  };
  const std::string upper = "property double X\nproperty double Y\nproperty double Z\n";
  auto r = read(upper + "property uchar Red\nproperty uchar Green\nproperty uchar Blue\n", "1 2 3 4 5 6\n");
  CHECK(r.points.z == std::vector<double>{3});
  CHECK(r.points.rgba == std::vector<std::uint32_t>{0xff060504u});
  r = read(upper +
               "property float R\nproperty float g\nproperty float B\nproperty float NX\nproperty float Ny\n"
               "property float nZ\nproperty float curvature\nproperty uchar alpha\n",
           "1 2 3 1 0.5 0 0 0 1 9 255\n");
  CHECK(r.points.rgba == std::vector<std::uint32_t>{0xff0080ffu});
  CHECK(r.points.nz == std::vector<float>{1});
  CHECK(r.info.left_out == std::vector<std::string>{"curvature"});
  r = read(
      kXyz + "property ushort diffuse_red\nproperty ushort diffuse_green\nproperty ushort diffuse_blue\n",
      "1 2 3 65535 32896 0\n");
  CHECK(r.points.rgba == std::vector<std::uint32_t>{0xff0080ffu});
  // Spelling before capitals: both are there.
  r = read(kXyz + "property float X\n", "1 2 3 9\n");
  CHECK(r.points.x == std::vector<double>{1});
}

TEST_CASE("ply points: records behind the declared ones are points only where they lie near them",
          "[fault]") {
  const test::TempFolder folder;
  std::string tail;
  while (tail.size() < 1200) tail += "written by a scanner; ";
  const auto path =
      folder.write("t.ply", cloud("binary_little_endian", "5", kXyz, triples(5) + tail.substr(0, 1200)));
  const auto r = test::read_points(path);
  CHECK(r.points.size() == 5);
  CHECK(r.info.warnings.size() == 1);
}

TEST_CASE("ply points: the other endianness shows as absurd numbers, not as a crash", "[fault]") {
  const test::TempFolder folder;
  const auto r = test::read_points(folder.write("e.ply", cloud("binary_big_endian", "4", kXyz, triples(4))));
  CHECK(r.points.size() == 4);
}

TEST_CASE("ply points: files without points to read are refused with a reason", "[fault]") {
  const test::TempFolder folder;
  CHECK_THAT(test::reading_error(folder.write("a.ply", cloud("ascii", "1", "property float x\n", "1\n"))),
             Catch::Contains("lacks x, y or z"));
  CHECK_THAT(
      test::reading_error(folder.write("b.ply", "ply\nformat ascii 1.0\nelement face 0\nend_header\n")),
      Catch::Contains("no element 'vertex'"));
  CHECK_THAT(test::reading_error(folder.write(
                 "c.ply", cloud("ascii", "1",
                                "property list uchar float x\nproperty float y\nproperty float z\n", "1\n"))),
             Catch::Contains("lacks x, y or z"));
}

TEST_CASE("ply points: real files have the points that their catalogue says", "[pipeline][.shared]") {
  if (!test::has_shared_data()) return;
  const std::filesystem::path data = test::kSharedData;
  const std::vector<std::pair<std::string, std::size_t>> files = {
      {"scans/bunny-raw.ply", 362272},
      {"scans/drill-raw.ply", 50643},
      {"scans/armadillo-points-normals.ply", 38294},
      {"meshes/bunny.ply", 35947},
      {"meshes/horse.ply", 48485},
      {"meshes/gargo.ply", 25002},
      {"meshes/rocker-arm.ply", 40177},
      {"meshes/turbineblade.ply", 99519},
      {"dirty/brain-tristrips.ply", 18844},
      {"dirty/cycloidal.ply", 21384}};
  for (const auto& [name, count] : files) {
    CAPTURE(name);
    const auto r = test::read_points(data / name);
    CHECK(r.points.size() == count);
    CHECK(r.counts.missing == 0);
    CHECK(r.info.warnings.empty());
    test::require_slices_agree(data / name, {}, {100000});
  }
}

}  // namespace
}  // namespace tessera::ply_points_test
