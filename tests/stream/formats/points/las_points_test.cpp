#include "stream/formats/points/las_points.h"

#include <algorithm>
#include <array>
#include <limits>

#include "tests/helpers/point_reading.h"
#include "tests/helpers/skip.h"
#include "tests/helpers/temp_folder.h"

namespace tessera::las_points_test {
namespace {

using test::put;

constexpr std::array<std::size_t, 11> kRecordBytes = {20, 28, 26, 34, 57, 63, 30, 36, 38, 59, 67};
constexpr std::array<int, 11> kColourOffset = {-1, -1, 20, 28, -1, 28, -1, 30, 30, -1, 30};

/// What a test wants to be wrong with a file.
struct Las {
  int minor = 2;
  int format = 3;
  std::size_t extra = 0;     ///< bytes added to each record
  std::uint64_t count = 10;  ///< points in the file
  std::uint64_t declared = 10;
  std::uint32_t legacy = 10;
  std::uint16_t colour_step = 257;
  int withheld_every = 0;
  double scale = 0.001;
  bool bounds = true;
};

template <class T>
void set(std::string& bytes, std::size_t at, T value) {
  std::string v;
  put(v, value);
  bytes.replace(at, v.size(), v);
}

std::string make(const Las& las) {
  const std::size_t head = las.minor >= 4 ? 375 : las.minor == 3 ? 235 : 227;
  const auto format = static_cast<std::size_t>(las.format);
  const std::size_t record = kRecordBytes[format] + las.extra;
  std::string f(head, '\0');
  f.replace(0, 4, "LASF");
  set(f, 24, std::uint8_t{1}), set(f, 25, static_cast<std::uint8_t>(las.minor));
  set(f, 94, static_cast<std::uint16_t>(head)), set(f, 96, static_cast<std::uint32_t>(head + 2));
  set(f, 104, static_cast<std::uint8_t>(las.format)), set(f, 105, static_cast<std::uint16_t>(record));
  set(f, 107, las.legacy);
  for (std::size_t a = 0; a < 3; ++a) {
    set(f, 131 + 8 * a, las.scale), set(f, 155 + 8 * a, 1e6);
    if (!las.bounds) continue;
    set(f, 179 + 16 * a, 1e6 + static_cast<double>(las.count) * 0.001);
    set(f, 187 + 16 * a, 1e6 - static_cast<double>(las.count) * 0.001);
  }
  if (las.minor >= 4) set(f, 247, las.declared);
  f += "\xdd\xcc";
  for (std::uint64_t i = 0; i < las.count; ++i) {
    std::string r(record, 'e');
    set(r, 0, static_cast<std::int32_t>(i)), set(r, 4, -static_cast<std::int32_t>(i)),
        set(r, 8, std::int32_t{7});
    r[15] = 0;
    const std::uint64_t every = static_cast<std::uint64_t>(las.withheld_every);
    if (every > 0 && i % every == 0) r[15] = static_cast<char>(las.format >= 6 ? 0x04 : 0x80);
    for (int c = 0; c < 3 && kColourOffset[format] >= 0; ++c) {
      set(r, static_cast<std::size_t>(kColourOffset[format] + 2 * c),
          static_cast<std::uint16_t>((i + static_cast<std::uint64_t>(c)) % 256 * las.colour_step));
    }
    f += r;
  }
  return f;
}

TEST_CASE("las points: all versions and point formats, extra bytes", "[unit]") {
  const test::TempFolder folder;
  for (int minor = 0; minor <= 4; ++minor) {
    for (int format = 0; format <= 10; ++format) {
      for (const std::size_t extra : {std::size_t{0}, std::size_t{5}}) {
        CAPTURE(minor, format, extra);
        Las las{
            .minor = minor, .format = format, .extra = extra, .count = 300, .declared = 300, .legacy = 300};
        const auto path = folder.write("a.las", make(las));
        const auto r = test::read_points(path);
        REQUIRE(r.points.size() == 300);
        CHECK(r.info.format == "LAS 1." + std::to_string(minor) + " point format " + std::to_string(format));
        CHECK(r.info.warnings.empty());
        CHECK(r.info.has_bounds);
        CHECK(r.info.attributes.colour == (kColourOffset[static_cast<std::size_t>(format)] >= 0));
        CHECK(r.points.x[41] == 41 * 0.001 + 1e6);
        CHECK(r.points.y[41] == -41 * 0.001 + 1e6);
        CHECK(r.points.z[41] == 7 * 0.001 + 1e6);
        if (r.info.attributes.colour) CHECK(r.points.rgba[41] == (0xff000000u | 43 << 16 | 42 << 8 | 41));
        test::require_slices_agree(path);
      }
    }
  }
}

TEST_CASE("las points: 8-bit colours in 16 bits are told from 16-bit ones by the file, not the slice",
          "[unit]") {
  const test::TempFolder folder;
  for (const std::uint16_t step : {std::uint16_t{1}, std::uint16_t{256}, std::uint16_t{257}}) {
    CAPTURE(step);
    const auto path =
        folder.write("c.las", make({.count = 5000, .declared = 5000, .legacy = 5000, .colour_step = step}));
    test::require_slices_agree(path);
    const auto r = test::read_points(path);
    for (std::size_t i = 0; i < 5000; ++i) REQUIRE((r.points.rgba[i] & 0xff) == i % 256);
  }
}

TEST_CASE("las points: withheld points are dropped and counted", "[unit]") {
  const test::TempFolder folder;
  for (const int format : {1, 3, 6, 7}) {
    const auto path = folder.write("w.las", make({.minor = 4,
                                                  .format = format,
                                                  .count = 100,
                                                  .declared = 100,
                                                  .legacy = 100,
                                                  .withheld_every = 3}));
    const auto r = test::read_points(path);
    CHECK(r.counts.withheld == 34);
    CHECK(r.points.size() == 66);
    CHECK(r.points.x[0] == 0.001 + 1e6);
    CHECK(missing_points(r.info, r.counts) == 0);
    test::require_slices_agree(path);
  }
}

TEST_CASE("las points: class and return of formats with three and with four bits", "[unit]") {
  const test::TempFolder folder;
  const auto echo = [&](int format, std::uint8_t returns, std::uint8_t flags, std::uint8_t kind) {
    std::string f = make({.minor = 4, .format = format, .count = 1, .declared = 1, .legacy = 1});
    const std::size_t record = f.size() - kRecordBytes[static_cast<std::size_t>(format)];
    set(f, record + 14, returns), set(f, record + 15, flags), set(f, record + 16, kind);
    const auto r = test::read_points(folder.write("e.las", f));
    REQUIRE(r.points.echo.size() == 1);
    return r.points.echo[0];
  };
  // Scan direction and edge of line are set, they are not ours.
  CHECK(echo(1, 0b11'101'010, 0b001'00010, 77) == Echo{2, 2, 5});
  CHECK(echo(3, 0b00'001'001, 0b000'11111, 77) == Echo{31, 1, 1});
  CHECK(echo(6, 0b1111'0011, 0b1100'0000, 18) == Echo{18, 3, 15});
  CHECK(echo(7, 0b0010'0010, 0, 200) == Echo{200, 2, 2});
  CHECK_FALSE(Echo{0, 3, 15}.last());
  CHECK_FALSE(Echo{0, 2, 2}.first());
  CHECK((Echo{0, 0, 0}.first() && Echo{0, 0, 0}.last()));
}

TEST_CASE("las points: counts that lie are survived and reported", "[fault]") {
  const test::TempFolder folder;
  const auto read = [&](const Las& las, const std::string& tail = "") {
    const auto path = folder.write("l.las", make(las) + tail);
    test::require_slices_agree(path);
    return test::read_points(path);
  };
  auto r = read({.count = 10, .legacy = 0xffffffffu});
  CHECK(r.points.size() == 10);
  CHECK(r.counts.missing == 0xffffffffu - 10);
  CHECK(r.info.warnings.size() == 1);
  r = read({.minor = 4, .count = 10, .declared = ~std::uint64_t{0}, .legacy = 0});
  CHECK(r.points.size() == 10);
  CHECK(r.info.warnings.size() == 1);
  r = read({.count = 10, .legacy = 0});
  CHECK(r.points.size() == 10);
  CHECK(r.info.warnings.size() == 1);
  r = read({.minor = 4, .count = 10, .declared = 0, .legacy = 10});
  CHECK(r.points.size() == 10);
  CHECK(r.info.warnings.size() == 1);
  r = read({.count = 10, .legacy = 4});
  CHECK(r.points.size() == 10);
  r = read({.count = 10, .legacy = 4}, "tail");
  CHECK(r.points.size() == 4);
  r = read({.count = 0, .declared = 0, .legacy = 0});
  CHECK(r.points.size() == 0);
  CHECK(r.info.warnings.empty());
}

TEST_CASE("las points: bytes behind the declared points are points only where they lie within the bounds",
          "[fault]") {
  const test::TempFolder folder;
  const auto read = [&](const Las& las, const std::string& tail) {
    const auto path = folder.write("l.las", make(las) + tail);
    test::require_slices_agree(path);
    return test::read_points(path);
  };
  for (const int format : {0, 1, 3}) {
    const std::size_t record = kRecordBytes[static_cast<std::size_t>(format)];
    std::string text = "exported by a field controller, project 17, operator 3\r\n";
    while (text.size() < 40 * record) text += text;
    for (const std::string& tail : {text.substr(0, 40 * record), std::string(100 * record, '\0'),
                                    std::string(record, ' '), std::string(5000 * record, '\xff')}) {
      for (const bool bounds : {true, false}) {
        CAPTURE(format, tail.size(), bounds);
        const auto r = read({.format = format, .bounds = bounds}, tail);
        CHECK(r.points.size() == 10);
        REQUIRE_FALSE(r.info.warnings.empty());
        CHECK_THAT(r.info.warnings.back(), Catch::Contains("no point") || Catch::Contains("bounds"));
      }
    }
  }
  // Points of a writer that did not come back to its header are points.
  CHECK(read({.count = 300, .legacy = 299}, "").points.size() == 300);
  CHECK(read({.count = 300, .legacy = 100, .bounds = false}, "").points.size() == 300);
}

TEST_CASE("las points: extended records behind the points are not points", "[unit]") {
  const test::TempFolder folder;
  std::string f = make({.minor = 4, .format = 7, .declared = 0, .legacy = 0});
  set(f, 235, static_cast<std::uint64_t>(f.size())), set(f, 243, std::uint32_t{1});
  const auto r = test::read_points(folder.write("e.las", f + std::string(360, 'v')));
  CHECK(r.points.size() == 10);
}

TEST_CASE("las points: bounds that lie are detected", "[fault]") {
  const test::TempFolder folder;
  auto r = test::read_points(folder.write("a.las", make({.bounds = false})));
  CHECK_FALSE(r.info.has_bounds);
  CHECK(r.info.warnings.size() == 1);
  std::string f = make({});
  set(f, 179, std::numeric_limits<double>::quiet_NaN());
  r = test::read_points(folder.write("b.las", f));
  CHECK_FALSE(r.info.has_bounds);
  CHECK(r.info.warnings.size() == 1);
  r = test::read_points(folder.write("c.las", make({})));
  CHECK(refuted_claims(r.info, r.counts, {1e6, 1e6, 1e6}, {1e6 + 5, 1e6, 1e6}).size() == 1);
  CHECK(refuted_claims(r.info, r.counts, {1e6 - 0.01, 1e6 - 0.01, 1e6 - 0.01},
                       {1e6 + 0.01, 1e6 + 0.01, 1e6 + 0.01})
            .empty());
}

TEST_CASE("las points: a file cut anywhere is refused in its header and read in its points", "[fault]") {
  const test::TempFolder folder;
  for (const int minor : {2, 3, 4}) {
    const std::string whole = make({.minor = minor, .format = 1});
    const std::size_t head = minor == 4 ? 375 : minor == 3 ? 235 : 227;
    for (std::size_t bytes = 0; bytes < whole.size(); ++bytes) {
      CAPTURE(minor, bytes);
      const auto path = folder.write("cut.las", whole.substr(0, bytes));
      if (bytes < head) {
        REQUIRE_FALSE(test::reading_error(path).empty());
        continue;
      }
      const auto r = test::read_points(path);
      REQUIRE(r.points.size() == (bytes < head + 2 ? 0 : (bytes - head - 2) / 28));
      REQUIRE(r.points.size() + r.counts.missing == 10);
      REQUIRE(r.info.warnings.size() == 1);
    }
  }
}

TEST_CASE("las points: headers that make no sense are refused with field and value", "[fault]") {
  const test::TempFolder folder;
  const auto error = [&](std::size_t at, auto value) {
    std::string f = make({});
    set(f, at, value);
    return test::reading_error(folder.write("h.las", f));
  };
  CHECK_THAT(error(104, std::uint8_t{131}),
             Catch::Contains("compressed") && Catch::Contains("laszip encoded"));
  CHECK_THAT(error(104, std::uint8_t{11}), Catch::Contains("point format 11"));
  CHECK_THAT(error(105, std::uint16_t{33}), Catch::Contains("33 bytes") && Catch::Contains("34"));
  CHECK_THAT(error(105, std::uint16_t{0}), Catch::Contains("0 bytes"));
  CHECK_THAT(error(24, std::uint8_t{2}), Catch::Contains("version 2.2"));
  CHECK_THAT(error(96, std::uint32_t{100}), Catch::Contains("byte 100"));
  CHECK_THAT(error(139, 0.0), Catch::Contains("scale of y"));
  CHECK_THAT(error(131, std::numeric_limits<double>::infinity()), Catch::Contains("scale of x"));
  CHECK_THAT(error(171, std::numeric_limits<double>::quiet_NaN()), Catch::Contains("offset of z"));
  std::string far = make({});
  set(far, 96, std::uint32_t{0xffffffffu});
  const auto r = test::read_points(folder.write("far.las", far));
  CHECK(r.points.size() == 0);
  CHECK(r.counts.missing == 10);
}

TEST_CASE("las points: real files have the points that their catalogue says", "[pipeline][.shared]") {
  if (!test::has_shared_data()) return;
  const std::filesystem::path data = test::kSharedData;
  const std::vector<std::pair<std::string, std::size_t>> files = {{"scans/autzen-stadium-crop.las", 363212},
                                                                  {"scans/lion-takanawa.las", 341989},
                                                                  {"lidar/autzen-trim.las", 110000},
                                                                  {"lidar/certainty3d.las", 10126}};
  for (const auto& [name, count] : files) {
    CAPTURE(name);
    const auto r = test::read_points(data / name);
    CHECK(r.points.size() + r.counts.withheld == count);
    CHECK(r.counts.missing == 0);
    test::require_slices_agree(data / name, {}, {100000});
    for (std::size_t i = 0; i < r.points.size() && r.info.has_bounds; ++i) {
      REQUIRE(r.points.x[i] >= r.info.declared_min[0] - 0.01);
      REQUIRE(r.points.x[i] <= r.info.declared_max[0] + 0.01);
    }
    std::uint32_t lightest = 0;
    for (const std::uint32_t c : r.points.rgba) lightest = std::max(lightest, c & 0xff);
    CHECK(lightest > 64);
  }
  const auto trim = test::read_points(data / "lidar/autzen-trim.las").points.echo;
  const auto count = [&](const auto& is) { return std::count_if(trim.begin(), trim.end(), is); };
  CHECK(count([](const Echo& e) { return e.kind == 1; }) == 83893);
  CHECK(count([](const Echo& e) { return e.kind == 2; }) == 26107);
  CHECK(count([](const Echo& e) { return e.of > 1; }) == 19779);
  CHECK(count([](const Echo& e) { return !e.last(); }) == 10764);
}

}  // namespace
}  // namespace tessera::las_points_test
