// One scan of many points in every format of points: the same points from each, whole and in slices. Files of other programs are read by
// the [.shared] cases of the readers' own tests.
#include <catch2/catch.hpp>

#include <cmath>
#include <cstdio>
#include <limits>
#include <memory>

#include "octree/portable_math.h"
#include "octree/vector.h"
#include "stream/files/durable_file.h"
#include "stream/formats/laz/chunk_decoder.h"
#include "stream/formats/points/crs.h"
#include "tests/helpers/e57_writer.h"
#include "tests/helpers/laz_file.h"
#include "tests/helpers/lzf_block.h"
#include "tests/helpers/point_reading.h"
#include "tests/helpers/temp_folder.h"

namespace tessera::made_scans_test {
namespace {

using test::put;

constexpr std::size_t kPoints = 110000;
constexpr double kScale = 0.01, kOffset = 5e5;  // those of test::las_header()

struct MadePoint {
  std::array<std::int32_t, 3> at;  ///< of kScale, from kOffset
  std::array<std::uint8_t, 3> colour;
  Echo echo;
  bool withheld;
};

/// Strips over hills with houses, several returns where there are trees.
const std::vector<MadePoint>& made_scan() {
  static const std::vector<MadePoint> scan = [] {
    std::vector<MadePoint> out;
    std::uint64_t pulse = 0;
    const auto chance = [&](std::uint64_t k) { return to_unit(random_bits(5, k, pulse)); };
    while (out.size() < kPoints) {
      ++pulse;
      const double x = 0.4 * static_cast<double>(pulse % 300) + 0.2 * chance(1);
      const double y = 0.4 * static_cast<double>(pulse / 300) + 0.2 * chance(2);
      const bool house = std::fmod(x, 40.0) > 25.0 && std::fmod(y, 50.0) > 30.0;
      const bool tree = !house && std::fmod(x + y, 37.0) > 30.0;
      const double ground = 6.0 * sin_cos(0.05 * x).sin * sin_cos(0.03 * y).cos;
      const auto of = static_cast<std::uint8_t>(tree ? 1 + static_cast<int>(3.0 * chance(3)) : 1);
      for (std::uint8_t number = 1; number <= of && out.size() < kPoints; ++number) {
        const double above = house ? 7.0 : 5.0 * (of - number) * (0.5 + chance(4));
        MadePoint p;
        const Double3 at = {x, y, ground + above};
        for (std::size_t k = 0; k < 3; ++k) p.at[k] = static_cast<std::int32_t>(std::lround(at[k] / kScale));
        p.colour = {static_cast<std::uint8_t>(40 + 180 * chance(5)), static_cast<std::uint8_t>(pulse),
                    number};
        p.echo = {static_cast<std::uint8_t>(house ? 6 : number == of ? 2 : 5), number, of};
        p.withheld = pulse % 97 == 0;
        out.push_back(p);
      }
    }
    return out;
  }();
  return scan;
}

double coordinate(const MadePoint& p, std::size_t k) {
  return static_cast<double>(p.at[k]) * kScale + kOffset;
}
std::uint32_t colour_of(const MadePoint& p) {
  return 0xff000000u | static_cast<std::uint32_t>(p.colour[2] << 16 | p.colour[1] << 8 | p.colour[0]);
}

/// What was read is the scan: positions to the bit, and colours.
void require_scan(const test::ReadResult& r, bool with_withheld = true) {
  std::size_t i = 0;
  const auto& scan = made_scan();
  for (const MadePoint& p : scan) {
    if (p.withheld && !with_withheld) continue;
    REQUIRE(i < r.points.size());
    REQUIRE(r.points.x[i] == coordinate(p, 0));
    REQUIRE(r.points.y[i] == coordinate(p, 1));
    REQUIRE(r.points.z[i] == coordinate(p, 2));
    if (!r.points.rgba.empty()) REQUIRE(r.points.rgba[i] == colour_of(p));
    ++i;
  }
  REQUIRE(r.points.size() == i);
  CHECK(r.points.size() + r.counts.withheld == kPoints);
  CHECK(r.counts.missing == 0);
  CHECK(r.info.warnings.empty());
  CHECK(r.counts.warnings.empty());
}

/// \param wide  colours of 16 bits, not of 8 in 16
std::string records_of(const test::LazSample& s, bool wide) {
  const std::size_t bytes = test::schema_of(s).record_bytes();
  const bool extended = s.format >= 6;
  std::string all;
  std::uint64_t i = 0;
  for (const MadePoint& p : made_scan()) {
    std::string r(bytes, '\0');
    for (std::size_t k = 0; k < 3; ++k) test::set_bytes(r, 4 * k, p.at[k]);
    test::set_bytes(r, 12, static_cast<std::uint16_t>(i * 7 % 4096));
    r[14] = static_cast<char>(p.echo.number | p.echo.of << (extended ? 4 : 3));
    r[15] = static_cast<char>(extended ? (p.withheld ? 0x04 : 0) : p.echo.kind | (p.withheld ? 0x80 : 0));
    if (extended) r[16] = static_cast<char>(p.echo.kind);
    test::set_bytes(r, extended ? 22 : 20, 3e5 + 1e-5 * static_cast<double>(i++));
    for (std::size_t k = 0; k < 3; ++k)
      test::set_bytes(r, (extended ? 30 : 28) + 2 * k,
                      static_cast<std::uint16_t>(p.colour[k] * (wide ? 257 : 1)));
    all += r;
  }
  return all;
}

/// The bounds that the points have, said in the header.
void set_bounds(std::string& file) {
  for (std::size_t k = 0; k < 3; ++k) {
    double low = 1e300, high = -1e300;
    for (const MadePoint& p : made_scan())
      low = std::min(low, coordinate(p, k)), high = std::max(high, coordinate(p, k));
    test::set_bytes(file, 179 + 16 * k, high), test::set_bytes(file, 187 + 16 * k, low);
  }
}

}  // namespace

TEST_CASE("made scans: LAS and LAZ of two versions have every point, colour and return", "[pipeline]") {
  const test::TempFolder folder;
  for (const int format : {3, 7}) {
    const bool wide = format == 7;
    CAPTURE(format);
    test::LazSample s;
    s.minor = format == 7 ? 4 : 2;
    s.format = format;
    s.points = kPoints;
    s.chunk_points = 50000;
    const std::string records = records_of(s, wide);
    std::string las = test::las_twin(s, records);
    set_bounds(las);
    const auto path = folder.write("a.las", las);
    const test::ReadResult r = test::read_points(path);
    require_scan(r, false);
    CHECK(r.info.has_bounds);
    std::size_t i = 0, several = 0;
    for (const MadePoint& p : made_scan()) {
      if (p.withheld) continue;
      REQUIRE(r.points.echo[i++] == p.echo);
      several += p.echo.of > 1;
    }
    CHECK(several > kPoints / 10);
    test::require_slices_agree(path, {}, {100000});

    std::string laz = test::laz_file(s, records).bytes;
    set_bounds(laz);
    const auto packed = folder.write("a.laz", laz);
    CHECK(laz.size() < las.size() / 2);
    CHECK(test::same_points(test::read_points(packed).points, r.points));
    test::require_slices_agree(packed, {}, {100000});
  }
}

TEST_CASE("made scans: a chunk of LAZ decodes to its records and is coded into its very bytes",
          "[pipeline]") {
  // The hash stands for bytes that LASzip would write too: laz_points_test.cpp codes chunks of real files again.
  for (const int format : {3, 7}) {
    CAPTURE(format);
    test::LazSample s;
    s.minor = format == 7 ? 4 : 2;
    s.format = format;
    s.points = 50000;
    const laz::Schema schema = test::schema_of(s);
    const std::string records = records_of(s, true).substr(0, s.points * schema.record_bytes());
    const std::vector<char> chunk = laz::encode_chunk(schema, records);
    const std::string_view bytes(chunk.data(), chunk.size());
    laz::ByteFeed feed(bytes);
    const auto decoder = schema.layered()
                             ? laz::decode_layered(
                                   schema,
                                   [&](std::uint64_t a, std::uint64_t b) {
                                     return std::make_unique<laz::ByteFeed>(bytes.substr(a, b - a));
                                   },
                                   laz::Layers::kAll)
                             : laz::decode_pointwise(schema, feed);
    std::string back(records.size(), '\0');
    decoder->decode(back.data(), s.points);
    CHECK(back == records);
    CHECK(hash_text(std::string(bytes)) == (format == 3 ? 0x1ac286c6700b0f3eu : 0xf83ec08c993791adu));
  }
}

TEST_CASE("made scans: PLY in its three encodings, with faces and strips behind the points", "[pipeline]") {
  const test::TempFolder folder;
  for (const std::string format : {"ascii", "binary_little_endian", "binary_big_endian"})
    for (const bool strips : {false, true}) {
      CAPTURE(format, strips);
      const bool text = format == "ascii", big = format == "binary_big_endian";
      std::string file = "ply\nformat " + format + " 1.0\ncomment made\nelement vertex " +
                         std::to_string(kPoints) +
                         "\nproperty double x\nproperty double y\nproperty double z\nproperty uchar red\n"
                         "property uchar green\nproperty uchar blue\n" +
                         (strips ? "element tristrips 1\nproperty list int int vertex_indices\nend_header\n"
                                 : "element face 1\nproperty list uchar int vertex_indices\nend_header\n");
      for (const MadePoint& p : made_scan()) {
        if (text) {
          char line[120];
          std::snprintf(line, sizeof line, "%.17g %.17g %.17g %d %d %d\n", coordinate(p, 0), coordinate(p, 1),
                        coordinate(p, 2), p.colour[0], p.colour[1], p.colour[2]);
          file += line;
          continue;
        }
        for (std::size_t k = 0; k < 3; ++k) put(file, coordinate(p, k), big);
        for (const std::uint8_t c : p.colour) put(file, c);
      }
      if (text) {
        file += "3 0 1 2\n";
      } else {
        if (strips)
          put(file, std::int32_t{3}, big);
        else
          put(file, std::uint8_t{3});
        for (const std::int32_t v : {0, 1, 2}) put(file, v, big);
      }
      const auto path = folder.write("a.ply", file);
      require_scan(test::read_points(path));
      test::require_slices_agree(path, {}, {100000});
    }
}

TEST_CASE("made scans: CSV with normals", "[pipeline]") {
  const test::TempFolder folder;
  std::string file = "x,y,z,nx,ny,nz\n";
  for (std::size_t i = 0; i < kPoints; ++i) {
    const MadePoint& p = made_scan()[i];
    char line[120];
    std::snprintf(line, sizeof line, "%.17g,%.17g,%.17g,%g,0,%g\n", coordinate(p, 0), coordinate(p, 1),
                  coordinate(p, 2), i % 2 == 0 ? 0.6 : -0.6, 0.8);
    file += line;
  }
  const auto path = folder.write("a.csv", file);
  const test::ReadResult r = test::read_points(path);
  require_scan(r);
  REQUIRE(r.info.attributes.normals);
  CHECK(r.points.nx[0] == 0.6f);
  CHECK(r.points.nx[kPoints - 1] == -0.6f);
  CHECK(r.points.nz[kPoints - 1] == 0.8f);
  test::require_slices_agree(path, {}, {1000, 100000});
}

TEST_CASE("made scans: PCD of a depth camera, with nothing where it saw nothing", "[pipeline]") {
  const test::TempFolder folder;
  constexpr int kWidth = 320, kHeight = 240;
  constexpr float kNan = std::numeric_limits<float>::quiet_NaN();
  const auto file = [&](const std::string& viewpoint) {
    std::string x, y, z;
    for (int i = 0; i < kWidth * kHeight; ++i) {
      const bool seen = random_bits(11, 1, static_cast<std::uint64_t>(i)) % 6 != 0;
      const float depth = 2.0f + 0.001f * static_cast<float>(i % 977);
      put(x, seen ? depth * static_cast<float>(i % kWidth - kWidth / 2) / 500.0f : kNan);
      put(y, seen ? depth * static_cast<float>(i / kWidth - kHeight / 2) / 500.0f : kNan);
      put(z, seen ? depth : kNan);
    }
    std::string out =
        "# .PCD v0.7 - Point Cloud Data file format\nVERSION 0.7\nFIELDS x y z\nSIZE 4 4 4\nTYPE F F "
        "F\nCOUNT 1 1 1\n"
        "WIDTH 320\nHEIGHT 240\nVIEWPOINT " +
        viewpoint + "\nPOINTS 76800\nDATA binary_compressed\n";
    const std::string fields = x + y + z, packed = test::lzf_block(fields);
    put(out, static_cast<std::uint32_t>(packed.size())), put(out, static_cast<std::uint32_t>(fields.size()));
    return out + packed;
  };
  const test::ReadResult rotated =
      test::read_points(folder.write("turned.pcd", file("0 0 0 0.7071068 0.7071068 0 0")));
  REQUIRE(rotated.points.size() == kWidth * kHeight);
  std::size_t empty = 0;
  for (std::uint64_t i = 0; i < rotated.points.size(); ++i) {
    const bool seen = random_bits(11, 1, i) % 6 != 0;
    REQUIRE(std::isnan(rotated.points.x[i]) != seen);
    empty += !seen;
  }
  CHECK(empty > kWidth * kHeight / 8);
  CHECK(rotated.info.sensors == std::vector<Double3>{{0, 0, 0}});
  CHECK(test::read_points(folder.write("plain.pcd", file("0 0 0 1 0 0 0"))).info.sensors ==
        std::vector<Double3>{{0, 0, 0}});
}

TEST_CASE("made scans: E57 of scaled integers with colours and intensity, and of doubles", "[pipeline]") {
  const test::TempFolder folder;
  const auto scaled = [](std::size_t k) {
    test::E57Values f{std::string("cartesian") + "XYZ"[k],
                      "ScaledInteger",
                      {},
                      {},
                      -(1 << 22),
                      1 << 22,
                      kScale,
                      kOffset,
                      {}};
    for (const MadePoint& p : made_scan()) f.integers.push_back(p.at[k]);
    return f;
  };
  test::E57TestScan scan;
  for (const std::size_t k : {0u, 1u, 2u}) scan.fields.push_back(scaled(k));
  const char* names[] = {"colorRed", "colorGreen", "colorBlue"};
  for (std::size_t k = 0; k < 3; ++k) {
    test::E57Values f{names[k], "Integer", {}, {}, 0, 255, 1.0, 0.0, {}};
    for (const MadePoint& p : made_scan()) f.integers.push_back(p.colour[k]);
    scan.fields.push_back(f);
  }
  test::E57Values intensity{"intensity", "single", {}, {}, 0, 0, 1.0, 0.0, {}};
  for (std::size_t i = 0; i < kPoints; ++i) intensity.floats.push_back(static_cast<double>(i % 256) / 256.0);
  scan.fields.push_back(intensity);
  scan.packets = 80;  // of at most 64 KiB
  const auto path = folder.write("a.e57", test::e57_file({scan}));
  const test::ReadResult r = test::read_points(path);
  require_scan(r);
  CHECK(r.info.attributes.colour);
  CHECK(r.info.attributes.intensity);
  test::require_slices_agree(path, {}, {100000});

  std::vector<std::vector<double>> at(3);
  for (const MadePoint& p : made_scan())
    for (std::size_t k = 0; k < 3; ++k) at[k].push_back(coordinate(p, k));
  test::E57TestScan doubles;
  doubles.fields = test::e57_doubles(test::kE57Cartesian, at);
  doubles.packets = 80;
  require_scan(test::read_points(folder.write("b.e57", test::e57_file({doubles}))));
}

TEST_CASE("made scans: the coordinate system of a LAS file, as three programs write it", "[unit]") {
  const auto record = [](std::uint16_t id, const std::string& bytes) {
    std::string r(2, '\0');
    r += "LASF_Projection" + std::string(1, '\0');
    put(r, id), put(r, static_cast<std::uint16_t>(bytes.size()));
    return r + std::string(32, '\0') + bytes;
  };
  const test::TempFolder folder;
  std::vector<std::string> warnings;
  const auto crs_of = [&](int minor, const std::vector<std::string>& records) {
    test::LazSample s;
    s.minor = minor;
    s.format = minor == 4 ? 7 : 3;
    s.points = 3;
    std::string head = test::las_header(s, test::schema_of(s).record_bytes());
    if (minor == 4) head[6] = 16;  // the system is a WKT
    test::set_bytes(head, 100, static_cast<std::uint32_t>(records.size()));
    for (const std::string& r : records) head += r;
    test::set_bytes(head, 96, static_cast<std::uint32_t>(head.size()));
    return las_crs(ReadFile(folder.write("a.las", head + test::las_records(s))), warnings);
  };
  const std::string esri =
      "PROJCS[\"NAD_1983_HARN_Lambert_Conformal_Conic\",GEOGCS[\"GCS_North_American_1983_HARN\",DATUM["
      "\"D_North_American_1983_HARN\",SPHEROID[\"GRS_1980\",6378137.0,298.257222101]],PRIMEM[\"Greenwich\",0."
      "0],"
      "UNIT[\"Degree\",0.0174532925199433]],PROJECTION[\"Lambert_Conformal_Conic\"],PARAMETER[\"False_"
      "Easting\","
      "1312335.958],UNIT[\"Foot\",0.3048]]";
  const Crs named = crs_of(2, {record(2112, esri + std::string(1, '\0'))});
  CHECK(named.name == "NAD_1983_HARN_Lambert_Conformal_Conic");
  CHECK(named.wkt == esri);
  std::string keys;
  for (const int word : {1, 1, 0, 2, 1024, 0, 1, 1, 3072, 0, 1, 2229})
    put(keys, static_cast<std::uint16_t>(word));
  CHECK(crs_of(2, {record(34735, keys)}).horizontal == 2229);
  const std::string coded =
      "PROJCS[\"RGF93 v1 / Lambert-93\",GEOGCS[\"RGF93 v1\",AUTHORITY[\"EPSG\",\"4171\"]],PROJECTION["
      "\"Lambert_Conformal_Conic_2SP\"],UNIT[\"metre\",1],AUTHORITY[\"EPSG\",\"2154\"]]";
  const Crs lambert = crs_of(4, {record(2112, coded)});
  CHECK(lambert.name == "RGF93 v1 / Lambert-93");
  CHECK(lambert.horizontal == 2154);
  CHECK(warnings.empty());
}

}  // namespace tessera::made_scans_test
