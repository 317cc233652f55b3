#include "stream/formats/points/e57_points.h"

#include <cmath>

#include "octree/points.h"
#include "stream/formats/e57/e57_pages.h"
#include "tests/fuzz/point_reader_check.h"
#include "tests/helpers/command.h"
#include "tests/helpers/e57_writer.h"
#include "tests/helpers/point_reading.h"
#include "tests/helpers/random.h"
#include "tests/helpers/skip.h"
#include "tests/helpers/temp_folder.h"

namespace tessera::e57_points_test {
namespace {

using test::e57_doubles;
using test::E57TestScan;
using test::E57Values;
using test::kE57Cartesian;
using test::kE57Spherical;

E57Values integers(const std::string& name, std::int64_t minimum, std::int64_t maximum,
                   std::vector<std::int64_t> values, const std::string& type = "Integer", double scale = 1.0,
                   double offset = 0.0) {
  return {name, type, {}, std::move(values), minimum, maximum, scale, offset, {}};
}

E57TestScan scan(std::vector<E57Values> fields, std::string xml = {}) {
  E57TestScan s;
  s.fields = std::move(fields);
  s.xml = std::move(xml);
  return s;
}
E57TestScan with(E57TestScan s, std::vector<E57Values> more) {
  for (E57Values& f : more) s.fields.push_back(std::move(f));
  return s;
}

/// Three points: (1 2 3), (4 5 6), (7 8 9).
E57TestScan three(const std::string& xml = {}) {
  return scan(e57_doubles(kE57Cartesian, {{1, 4, 7}, {2, 5, 8}, {3, 6, 9}}), xml);
}

const std::string kRotation90 =
    test::e57_pose("0.70710678118654752", "0", "0", "0.70710678118654752", "100", "200", "300");

TEST_CASE("e57 points: checksums are those of CRC-32C", "[unit]") {
  CHECK(crc32c("123456789", 9) == 0xe3069283u);  // the check value of its catalogue entry
  CHECK(crc32c("", 0) == 0u);
  std::string bytes(1020, '\0');
  for (std::size_t i = 0; i < bytes.size(); ++i) bytes[i] = static_cast<char>(i * 7 + i / 256);
  CHECK(crc32c(bytes.data(), bytes.size()) == test::slow_crc32c(bytes.data(), bytes.size()));
}

TEST_CASE("e57 points: floats and integers of any width come back, whatever the packets and slices",
          "[unit]") {
  const test::TempFolder folder;
  test::Random random(7);
  const unsigned bits =
      GENERATE(1u, 2u, 5u, 7u, 8u, 11u, 16u, 19u, 24u, 31u, 32u, 33u, 47u, 53u, 57u, 58u, 61u, 63u);
  const bool skewed = GENERATE(false, true);
  const std::size_t packets = GENERATE(std::size_t{1}, std::size_t{3}, std::size_t{11});
  const std::int64_t minimum = bits > 60 ? 0 : -(std::int64_t{1} << (bits - 1));
  const std::int64_t maximum = minimum + static_cast<std::int64_t>((std::uint64_t{1} << bits) - 1);
  std::vector<std::int64_t> a, b;
  std::vector<double> c;
  for (int i = 0; i < 300; ++i) {
    const auto value = [&] {
      return minimum + static_cast<std::int64_t>((random.bits() << 11 | random.below(2048)) >> (64 - bits));
    };
    a.push_back(i == 0 ? minimum : value());
    b.push_back(i == 1 ? maximum : value());
    c.push_back(random.in(-1, 1));
  }
  E57TestScan s = scan({integers("cartesianX", minimum, maximum, a),
                        integers("ignored", 0, 5, std::vector<std::int64_t>(300, 3)),
                        integers("cartesianY", minimum, maximum, b, "ScaledInteger", 0.001, 12.5),
                        {"cartesianZ", "single", c, {}, 0, 0, 1.0, 0.0, {}}});
  s.packets = packets;
  s.skewed = skewed;
  const auto path = folder.write("a.e57", test::e57_file({s}));
  const auto r = test::read_points(path);
  REQUIRE(r.points.size() == 300);
  CHECK(r.info.format == "E57 with 1 scan");
  CHECK(r.info.warnings.empty());
  CHECK_FALSE(r.info.attributes.sensor);
  for (std::size_t i = 0; i < 300; ++i) {
    REQUIRE(r.points.x[i] == static_cast<double>(a[i]));
    REQUIRE(r.points.y[i] == static_cast<double>(b[i]) * 0.001 + 12.5);
    REQUIRE(r.points.z[i] == static_cast<double>(static_cast<float>(c[i])));
  }
  test::require_slices_agree(path);
}

TEST_CASE("e57 points: a field of one value is stored in no bytes", "[unit]") {
  const test::TempFolder folder;
  const auto constant = [](const char* name, std::int64_t v) { return integers(name, v, v, {v, v, v}); };
  auto r = test::read_points(
      folder.write("a.e57", test::e57_file({scan({integers("cartesianX", 0, 7, {1, 2, 7}),
                                                  constant("cartesianY", 5), constant("cartesianZ", -6)})})));
  CHECK(r.points.x == std::vector<double>{1, 2, 7});
  CHECK(r.points.y == std::vector<double>{5, 5, 5});
  CHECK(r.points.z == std::vector<double>{-6, -6, -6});
  // Nothing is stored at all: the count is all there is, and no more is believed than the file has bytes.
  E57TestScan s = scan({constant("cartesianX", 1), constant("cartesianY", 5), constant("cartesianZ", -6)});
  CHECK(test::read_points(folder.write("b.e57", test::e57_file({s}))).points.size() == 3);
  s.declared = std::int64_t{1} << 60;
  r = test::read_points(folder.write("c.e57", test::e57_file({s})));
  CHECK(r.points.size() < 10000);
  CHECK(r.counts.missing + r.points.size() == std::uint64_t{1} << 60);
}

TEST_CASE("e57 points: spherical positions", "[unit]") {
  const test::TempFolder folder;
  const double quarter = std::acos(0.0);
  const auto path = folder.write(
      "a.e57", test::e57_file({with(
                   scan(e57_doubles(kE57Spherical,
                                    {{2, 2, 2, 3, 1}, {0, quarter, 1, -2, 1e300}, {0, 0, quarter, 0.5, 0}})),
                   {integers("sphericalInvalidState", 0, 2, {0, 0, 0, 0, 0})})}));
  const auto r = test::read_points(path);
  const double expected[4][3] = {
      {2, 0, 0},
      {0, 2, 0},
      {0, 0, 2},
      {3 * std::cos(0.5) * std::cos(-2), 3 * std::cos(0.5) * std::sin(-2), 3 * std::sin(0.5)}};
  REQUIRE(r.points.size() == 5);
  for (std::size_t i = 0; i < 4; ++i) {
    CHECK(r.points.x[i] == Approx(expected[i][0]).margin(1e-14));
    CHECK(r.points.y[i] == Approx(expected[i][1]).margin(1e-14));
    CHECK(r.points.z[i] == Approx(expected[i][2]).margin(1e-14));
  }
  CHECK(std::isnan(r.points.x[4]));
  CHECK(r.info.sensors == std::vector<Double3>{{0, 0, 0}});  // it is measured from the scanner
}

TEST_CASE("e57 points: poses move points and normals and are the scanners' places, scan by scan", "[unit]") {
  const test::TempFolder folder;
  std::vector<E57TestScan> scans = {three(kRotation90), three(),
                                    three(test::e57_pose("1", "0", "0", "0", "5", "6", "7")),
                                    three("<pose type=\"Structure\"><translation type=\"Structure\"><z "
                                          "type=\"Float\">-1</z></translation></pose>")};
  scans[0] = with(scans[0], e57_doubles({"nor:normalX", "nor:normalY", "nor:normalZ"},
                                        {{1, 0, 0}, {0, 1, 0}, {0, 0, 1}}, "single"));
  const auto path = folder.write("a.e57", test::e57_file(scans));
  const auto r = test::read_points(path);
  REQUIRE(r.points.size() == 12);
  CHECK(r.info.format == "E57 with 4 scans");
  CHECK(r.info.sensors == std::vector<Double3>{{100, 200, 300}, {5, 6, 7}, {0, 0, -1}});
  const auto none = static_cast<std::uint16_t>(kNoSensor);
  CHECK(r.points.sensor == std::vector<std::uint16_t>{0, 0, 0, none, none, none, 1, 1, 1, 2, 2, 2});
  CHECK(r.points.x[0] == Approx(98));  // x to y, y to -x
  CHECK(r.points.y[0] == Approx(201));
  CHECK(r.points.z[0] == Approx(303));
  CHECK(r.points.nx[0] == Approx(0).margin(1e-7));
  CHECK(r.points.ny[0] == Approx(1));
  CHECK(r.points.nx[1] == Approx(-1));
  CHECK(r.points.nz[2] == Approx(1));
  CHECK(r.points.nx[3] == 0);
  CHECK(r.points.x[3] == 1);
  CHECK(r.points.x[6] == 6);
  CHECK(r.points.z[9] == 2);
  test::require_slices_agree(path);
}

TEST_CASE("e57 points: rows and columns, or spherical bounds, tell a scan in its scanner's frame", "[unit]") {
  const test::TempFolder folder;
  const auto sensors = [&](const E57TestScan& s) {
    return test::read_points(folder.write("a.e57", test::e57_file({s}))).info.sensors;
  };
  const std::vector<Double3> origin = {{0, 0, 0}};
  const std::vector<std::int64_t> index = {0, 1, 2};
  CHECK(sensors(three()).empty());
  CHECK(sensors(three(test::e57_pose("1", "0", "0", "0", "0", "0", "0"))).empty());
  CHECK(sensors(with(three(), {integers("rowIndex", 0, 2, index), integers("columnIndex", 0, 2, index)})) ==
        origin);
  CHECK(sensors(with(three(), {integers("rowIndex", 0, 2, index)})).empty());
  CHECK(sensors(three("<sphericalBounds type=\"Structure\"/>")) == origin);
}

TEST_CASE("e57 points: world coordinates refute a pose, by rows and columns or by their distance", "[unit]") {
  const test::TempFolder folder;
  // Terrain of 40 x 40 points, 0.5 apart, in the coordinates of a map.
  const auto terrain = [](const Double3& shift, bool grid, const std::string& xml) {
    std::vector<double> x, y, z;
    std::vector<std::int64_t> row, column;
    for (int i = 0; i < 40; ++i)
      for (int j = 0; j < 40; ++j) {
        x.push_back(shift[0] + 0.5 * i), y.push_back(shift[1] + 0.5 * j);
        z.push_back(shift[2] + 1.5 * std::sin(0.1 * i) * std::cos(0.07 * j));
        row.push_back(i), column.push_back(j);
      }
    const E57TestScan s = scan(e57_doubles(kE57Cartesian, {x, y, z}), xml);
    return grid ? with(s, {integers("rowIndex", 0, 39, row), integers("columnIndex", 0, 39, column)}) : s;
  };
  const std::string identity = test::e57_pose("1", "0", "0", "0", "0", "0", "0");
  const std::string world = test::e57_pose("1", "0", "0", "0", "500010", "5400010", "310");
  ReadOptions options;
  options.grid_normals = true;
  for (const E57TestScan& s :
       {terrain({500000, 5400000, 300}, true, ""), terrain({500000, 5400000, 300}, true, identity),
        terrain({300, 100, 2}, true, ""), terrain({300, 100, 200}, true, identity),
        terrain({-10, -10, -0.5}, true, identity),
        terrain({500000, 5400000, 300}, true, world),  // applied twice
        terrain({500000, 5400000, 300}, false, world)}) {
    for (const bool requested : {false, true}) {
      options.grid_normals = requested;
      const auto path = folder.write("a.e57", test::e57_file({s, s}));
      const auto r = test::read_points(path, ~std::uint64_t{0}, options);
      CHECK(r.info.sensors.empty());
      CHECK_FALSE(r.info.attributes.grid_normals);
      REQUIRE(r.info.warnings.size() == 1);
      CHECK_THAT(r.info.warnings[0], Catch::StartsWith("all 2 scans: no scanner can have stood at"));
      test::require_slices_agree(path, options, {700});
    }
  }
  // Without a grid a pose nearby stays.
  const auto path = folder.write("a.e57", test::e57_file({terrain({-10, -10, -5}, false, world)}));
  CHECK(test::read_points(path).info.sensors == std::vector<Double3>{{500010, 5400010, 310}});
}

TEST_CASE("e57 points: invalid points are empty, invalid colours none, limits scale colours, returns",
          "[unit]") {
  const test::TempFolder folder;
  const E57TestScan s =
      with(three("<colorLimits type=\"Structure\"><colorGreenMinimum type=\"Integer\">10</colorGreenMinimum>"
                 "<colorGreenMaximum type=\"Integer\">20</colorGreenMaximum></colorLimits>"),
           {integers("cartesianInvalidState", 0, 2, {0, 1, 0}), integers("colorRed", 0, 255, {1, 2, 255}),
            integers("colorGreen", 0, 255, {15, 15, 20}),
            integers("colorBlue", 0, 65535, {0x1234, 0, 0xffff}), integers("isColorInvalid", 0, 1, {0, 0, 1}),
            integers("returnIndex", 0, 3, {0, 0, 2}), integers("returnCount", 0, 3, {0, 1, 3})});
  const auto path = folder.write("a.e57", test::e57_file({s}));
  const auto r = test::read_points(path);
  CHECK(r.points.x == std::vector<double>{1, 7});
  CHECK(r.counts.empty == 1);
  CHECK(missing_points(r.info, r.counts) == 0);
  CHECK(refuted_claims(r.info, r.counts, {1, 2, 3}, {7, 8, 9}).empty());
  CHECK(r.points.rgba == std::vector<std::uint32_t>{0xff128001u, 0});
  CHECK(r.points.echo == std::vector<Echo>{Echo{}, Echo{0, 3, 3}});
  test::require_slices_agree(path);
}

TEST_CASE("e57 points: bounds are claims where no pose moves them", "[unit]") {
  const test::TempFolder folder;
  const auto bounds = [](const std::string& highest) {
    std::string xml = "<cartesianBounds type=\"Structure\">";
    for (const std::string a : {"x", "y", "z"})
      xml += "<" + a + "Minimum type=\"Float\"/><" + a + "Maximum type=\"Float\">" + highest + "</" + a +
             "Maximum>";
    return xml + "</cartesianBounds>";
  };
  const auto info = [&](const std::string& xml) {
    return test::read_points(folder.write("a.e57", test::e57_file({three(xml)}))).info;
  };
  CHECK(info(bounds("9")).has_bounds);
  CHECK(info(bounds("9")).declared_max == Double3{9, 9, 9});
  CHECK_FALSE(info(bounds("1.79769313486231571e+308")).has_bounds);
  CHECK_FALSE(info(bounds("9") + kRotation90).has_bounds);
}

TEST_CASE("e57 points: a count that lies is survived, and so is a section that ends early", "[fault]") {
  const test::TempFolder folder;
  E57TestScan s = three();
  s.declared = 1'000'000'000'000;
  const auto path = folder.write("a.e57", test::e57_file({s, three()}));
  auto r = test::read_points(path);
  CHECK(r.points.x == std::vector<double>{1, 4, 7, 1, 4, 7});
  CHECK(r.counts.missing == 1'000'000'000'000 - 3);
  REQUIRE(r.info.warnings.size() == 1);
  CHECK_THAT(r.info.warnings[0],
             Catch::Contains("scan 1: the header declares 1000000000000 points, the file holds 3"));
  test::require_slices_agree(path);
  s.declared = 2;
  r = test::read_points(folder.write("a.e57", test::e57_file({s})));
  CHECK(r.points.size() == 2);
}

TEST_CASE("e57 points: a wrong checksum is named with its byte", "[fault]") {
  const test::TempFolder folder;
  E57TestScan s =
      scan(e57_doubles(kE57Cartesian, std::vector<std::vector<double>>(3, std::vector<double>(500, 1.5))));
  const std::string good = test::e57_file({s});
  REQUIRE(good.size() > 8 * 1024);
  for (const std::size_t at : {std::size_t{100}, std::size_t{5 * 1024 + 17}, std::size_t{6 * 1024 + 1023}}) {
    std::string bad = good;
    bad[at] = static_cast<char>(bad[at] ^ 4);
    CHECK_THAT(
        test::reading_error(folder.write("a.e57", bad)),
        Catch::Contains("byte " + std::to_string(at / 1024 * 1024) + ":") && Catch::Contains("checksum"));
  }
}

TEST_CASE("e57 points: what makes no sense is named", "[fault]") {
  const test::TempFolder folder;
  test::E57Builder builder;
  builder.add(three());
  const std::string good = builder.file();
  const auto error = [&](std::string bytes) {
    return test::reading_error(folder.write("a.e57", test::e57_sealed(std::move(bytes))));
  };
  const auto patched = [&](std::size_t at, std::uint64_t value) {
    std::string bytes = good;
    std::memcpy(bytes.data() + at, &value, 8);
    return error(bytes);
  };
  const auto xml = [&](const std::string& inside) {
    return error(builder.file("<e57Root><data3D>" + inside + "</data3D></e57Root>"));
  };
  const auto changed = [&](const std::string& from, const std::string& to) {
    std::string text = builder.scans_xml();
    const std::size_t at = text.find(from);
    REQUIRE(at != std::string::npos);
    return xml(text.replace(at, from.size(), to));
  };
  REQUIRE(error(good).empty());
  REQUIRE(changed("cartesianX", "cartesianX").empty());
  CHECK_THAT(patched(8, 2), Catch::Contains("byte 8") && Catch::Contains("version 2.0"));
  CHECK_THAT(patched(40, 512), Catch::Contains("byte 40") && Catch::Contains("1024"));
  CHECK_THAT(patched(24, 1 << 20), Catch::Contains("byte 24") && Catch::Contains("truncated"));
  CHECK_THAT(patched(24, 1022), Catch::Contains("byte 24"));
  CHECK_THAT(patched(32, ~std::uint64_t{0}), Catch::Contains("byte 24"));
  CHECK_THAT(patched(32, 60), Catch::Contains("ends before its root"));
  CHECK_THAT(patched(64, 1 << 20), Catch::Contains("first packet") && Catch::Contains("byte 1048576"));
  CHECK_THAT(patched(48, 7), Catch::Contains("byte 48") && Catch::Contains("start with 1"));
  CHECK_THAT(patched(80, 9), Catch::Contains("byte 80") && Catch::Contains("type 9"));
  CHECK_THAT(patched(80, 1 | std::uint64_t{63} << 16 | std::uint64_t{7} << 32),
             Catch::Contains("7 bytestreams"));
  CHECK_THAT(patched(80, 1 | std::uint64_t{63} << 16 | std::uint64_t{3} << 32 | std::uint64_t{0xffff} << 48),
             Catch::Contains("longer than it is"));
  CHECK_THAT(changed("fileOffset=\"48\"", "fileOffset=\"99999999999999\""),
             Catch::Contains("byte 99999999999999"));
  CHECK_THAT(changed("fileOffset=\"48\"", "fileOffset=\"1021\""), Catch::Contains("byte 1021"));
  CHECK_THAT(changed("recordCount=\"3\"", "recordCount=\"-3\""), Catch::Contains("recordCount=\"-3\""));
  CHECK_THAT(changed("cartesianX", "cartesianY"), Catch::Contains("twice"));
  CHECK_THAT(changed("cartesianX", "elsewhere"),
             Catch::Contains("scan 1") && Catch::Contains("no positions"));
  CHECK_THAT(changed("cartesianX type=\"Float\"", "cartesianX type=\"Blob\""), Catch::Contains("'Blob'"));
  CHECK_THAT(changed("type=\"Float\"", "type=\"Integer\" minimum=\"3\" maximum=\"2\""),
             Catch::Contains("above its maximum"));
  CHECK_THAT(changed("type=\"Float\"", "type=\"Integer\" minimum=\"0x\""), Catch::Contains("minimum=\"0x\""));
  CHECK_THAT(changed("<codecs type=\"Vector\" allowHeterogeneousChildren=\"1\"/>",
                     "<codecs><vectorChild><zipCodec/></vectorChild></codecs>"),
             Catch::Contains("'zipCodec'"));
  CHECK_THAT(changed("</points>", ""), Catch::Contains("XML section"));
  CHECK_THAT(changed("<points", test::e57_pose("0", "0", "0", "0", "1", "2", "3") + "<points"),
             Catch::Contains("no motion"));
  CHECK_THAT(changed("<points", test::e57_pose("1", "0", "0", "0", "1e999", "2", "3") + "<points"),
             Catch::Contains("no motion"));
  CHECK_THAT(changed("<points", test::e57_pose("1", "0", "0", "0", "one", "2", "3") + "<points"),
             Catch::Contains("no number"));
  CHECK_THAT(error(builder.file("<scan/>")), Catch::Contains("e57Root"));
}

TEST_CASE("e57 points: XML that means harm is refused in little memory", "[fault]") {
  const test::TempFolder folder;
  const auto error = [&](const std::string& xml) {
    return test::reading_error(folder.write("a.e57", test::E57Builder().file(xml)));
  };
  std::string entities = "<!DOCTYPE e57Root [<!ENTITY a0 \"ha\">";
  for (int i = 1; i < 40; ++i) {
    const std::string before = "&a" + std::to_string(i - 1) + ";";
    entities += "<!ENTITY a" + std::to_string(i) + " \"" + before + before + "\">";
  }
  CHECK_THAT(error(entities + "]><e57Root>&a39;</e57Root>"), Catch::Contains("document type"));
  CHECK_THAT(error("<!DOCTYPE e57Root [<!ENTITY a \"&b;\"><!ENTITY b \"&a;\">]><e57Root>&a;</e57Root>"),
             Catch::Contains("document type"));
  std::string deep = "<e57Root>";
  for (int i = 0; i < 100000; ++i) deep += "<a>";
  CHECK_THAT(error(deep), Catch::Contains("deeper than 64"));
  CHECK_THAT(error("<e57Root>" + std::string("<") + std::string(3 << 20, 'a')), Catch::Contains("1 MiB"));
  CHECK_THAT(error("<e57Root a=\"" + std::string(3 << 20, 'a')), Catch::Contains("1 MiB"));
  std::string many = "<e57Root><data3D>";
  for (int i = 0; i < 17000; ++i) many += "<vectorChild/>";
  CHECK_THAT(error(many), Catch::Contains("16384 scans"));
  CHECK(error("<e57Root>" + std::string(3 << 20, 'a') + "</e57Root>" + std::string(5, '\0')).empty());
}

TEST_CASE("e57 points: what a file claims takes no memory", "[memory]") {
  const test::TempFolder folder;
  const auto peak = [&](const std::string& bytes) {
    const test::CommandResult r = test::tessera_command({"info", folder.write("a.e57", bytes).string()});
    INFO(r.errors);
    CHECK(r.code == 0);
    return r.peak_bytes;
  };
  E57TestScan s = three();
  const std::uint64_t usual = peak(test::e57_file({s}));
  s.declared = 1'000'000'000'000;
  CHECK(peak(test::e57_file({s})) < usual + (1u << 20));
  // Sixteen thousand scans whose records all lie in the same place.
  test::E57Builder builder;
  builder.add(three(kRotation90));
  std::string xml = "<e57Root><data3D>";
  for (int i = 0; i < 16000; ++i) xml += builder.scans_xml();
  CHECK(peak(builder.file(xml + "</data3D></e57Root>")) < usual + (40u << 20));
}

TEST_CASE("e57 points: a file cut anywhere is refused with a sentence", "[fault]") {
  const test::TempFolder folder;
  E57TestScan s = three(kRotation90);
  for (E57Values& f : s.fields) f.floats.resize(400, 2.5);
  s.packets = 3;
  const std::string whole = test::e57_file({s, s});
  for (std::size_t i = 0; i < 200; ++i) {
    const std::size_t bytes = 1 + i * (whole.size() - 1) / 200;
    CAPTURE(bytes);
    const std::string error = test::reading_error(folder.write("a.e57", whole.substr(0, bytes)));
    REQUIRE_THAT(error, Catch::Contains("byte ") || Catch::Contains("misnamed"));
  }
}

TEST_CASE("e57 points: the catalogue's files are read whole", "[unit][.shared]") {
  if (!test::has_shared_data()) return;
  const auto bunny = test::read_points(test::kSharedData / "scans/bunny-double.e57");
  CHECK(bunny.points.size() == 30571);
  CHECK(bunny.info.warnings.empty());
  CHECK(bunny.info.has_bounds);
  const auto path = test::kSharedData / "scans/pump.e57";
  const auto pump = test::read_points(path);
  CHECK(pump.points.size() == 155201);
  CHECK(pump.info.attributes.colour);
  CHECK(pump.info.attributes.intensity);
  CHECK(pump.info.sensors == std::vector<Double3>{{0, 0, 0}});
  CHECK(pump.points.x[0] == Approx(1.702286).epsilon(1e-12));
  CHECK(pump.points.rgba[0] == 0xff314133u);
  test::require_slices_agree(path, {}, {100000});
}

}  // namespace
}  // namespace tessera::e57_points_test
