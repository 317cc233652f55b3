#include "stream/formats/points/laz_points.h"

#include <random>

#include "stream/formats/laz/chunk_decoder.h"
#include "stream/formats/points/las_points.h"
#include "stream/formats/points/laz_chunks.h"
#include "tests/fuzz/point_reader_check.h"
#include "tests/helpers/laz_file.h"
#include "tests/helpers/point_reading.h"
#include "tests/helpers/skip.h"
#include "tests/helpers/temp_folder.h"

namespace tessera::laz_points_test {
namespace {

using test::LazBytes;
using test::LazSample;

constexpr std::uint32_t kVariable = laz::Schema::kVariable;

std::string message(const std::vector<std::string>& warnings) {
  std::string all;
  for (const std::string& w : warnings) all += w + "\n";
  return all;
}

/// Whether the first points of `all` are those of `part`, bit for bit.
bool starts_with(PointChunk all, const PointChunk& part) {
  const std::size_t n = part.size();
  if (n > all.size()) return false;
  for (auto* v : {&all.x, &all.y, &all.z}) v->resize(n);
  if (!all.rgba.empty()) all.rgba.resize(n);
  all.echo.resize(n);
  return test::same_points(all, part);
}

TEST_CASE("laz points: those of the uncompressed twin, whatever format, version and chunks", "[unit]") {
  const test::TempFolder folder;
  for (int format = 0; format <= 10; ++format) {
    for (const std::uint32_t chunk : {1u, 7u, 50u, 300u, 50000u, kVariable}) {
      for (int version = format >= 6 ? 3 : 1; version <= (format >= 6 ? 4 : 2); ++version) {
        const LazSample s{.minor = format >= 6 ? 4 : 2,
                          .format = format,
                          .extra = static_cast<std::size_t>(format % 3),
                          .chunk_points = chunk,
                          .version = static_cast<std::uint16_t>(version)};
        CAPTURE(format, chunk, version);
        const std::string records = test::las_records(s);
        const auto las = test::read_points(folder.write("a.las", test::las_twin(s, records)));
        const auto path = folder.write("a.laz", test::laz_file(s, records).bytes);
        const auto laz = test::read_points(path);
        REQUIRE(laz.info.warnings.empty());
        REQUIRE(laz.info.format.starts_with("LAZ 1."));
        REQUIRE(laz.counts.withheld == las.counts.withheld);
        REQUIRE(laz.counts.missing == 0);
        REQUIRE(test::same_points(laz.points, las.points));
        test::require_slices_agree(path, {}, {1, 64, 5000});
      }
    }
  }
}

TEST_CASE("laz points: one run without chunks, as the first files were", "[unit]") {
  const test::TempFolder folder;
  for (const int format : {0, 1, 2, 3}) {
    const LazSample s{.format = format, .version = 1, .chunked = false};
    const std::string records = test::las_records(s);
    const auto las = test::read_points(folder.write("a.las", test::las_twin(s, records)));
    const auto path = folder.write("a.laz", test::laz_file(s, records).bytes);
    CHECK(test::same_points(test::read_points(path).points, las.points));
    CHECK(open_point_file(path, {})->slices(0, 1).size() == 1);
    test::require_slices_agree(path);
  }
}

TEST_CASE("laz points: colours of 8 bits in 16 are told as in the uncompressed twin", "[unit]") {
  const test::TempFolder folder;
  for (const int format : {2, 7}) {
    for (const bool bright : {false, true}) {
      LazSample s{.minor = 4, .format = format, .points = 40000, .chunk_points = 1000};
      std::string records = test::las_records(s);
      const std::size_t bytes = test::schema_of(s).record_bytes();
      const std::size_t red = format == 2 ? 20 : 30;
      for (std::size_t i = 0; i < s.points; ++i)
        for (std::size_t c = 0; c < 3; ++c) records[i * bytes + red + 2 * c + 1] = '\0';
      // In the last run of records that are looked at.
      if (bright) records[(39375 + 100) * bytes + red + 1] = '\x40';
      const auto las = test::read_points(folder.write("c.las", test::las_twin(s, records)));
      const auto path = folder.write("c.laz", test::laz_file(s, records).bytes);
      CHECK(test::same_points(test::read_points(path).points, las.points));
      const auto light = [](std::uint32_t c) { return (c & 0xff) > 0x40; };
      CHECK(std::any_of(las.points.rgba.begin(), las.points.rgba.end(), light) != bright);
    }
  }
}

TEST_CASE("laz points: a chunk table at the end of the file, missing or damaged", "[fault]") {
  const test::TempFolder folder;
  for (const int format : {1, 3, 6, 7}) {
    for (const std::uint32_t chunk : {50u, kVariable}) {
      CAPTURE(format, chunk);
      const LazSample s{.minor = 4, .format = format, .chunk_points = chunk};
      const std::string records = test::las_records(s);
      const LazBytes file = test::laz_file(s, records);
      const auto whole = test::read_points(folder.write("a.laz", file.bytes));

      std::string late = file.bytes;
      test::set_bytes(late, file.points, std::int64_t{-1});
      test::put(late, static_cast<std::uint64_t>(file.table));
      const auto at_end = test::read_points(folder.write("late.laz", late));
      CHECK(test::same_points(at_end.points, whole.points));
      CHECK(at_end.info.warnings.empty());

      std::vector<std::string> broken(3, file.bytes);
      test::set_bytes(broken[0], file.points, static_cast<std::uint64_t>(file.points));  // never written
      broken[1].resize(file.table);
      broken[2][file.table] = 7;
      for (const std::uint64_t lie : {std::uint64_t{1}, file.table + 1, std::uint64_t{1} << 62,
                                      std::uint64_t{1} << 63, ~std::uint64_t{0} - 1}) {
        broken.push_back(file.bytes);
        test::set_bytes(broken.back(), file.points, lie);
      }
      // Readable, but of other chunks than there are.
      for (const std::uint32_t count : {0u, 1u, 3u}) {
        broken.push_back(file.bytes);
        test::set_bytes(broken.back(), file.table + 4, count);
      }
      broken.push_back(file.bytes);
      std::fill(broken.back().begin() + static_cast<std::ptrdiff_t>(file.table), broken.back().end(), '\0');
      const std::vector<laz::ChunkSize> one = {
          {300u, static_cast<std::uint32_t>(file.table - file.points - 8)}};
      const std::vector<char> other = laz::chunk_table(one, chunk == kVariable);
      if (format >= 6) {  // their sizes add up, so that heads alone tell
        broken.push_back(file.bytes.substr(0, file.table) + std::string(other.begin(), other.end()));
      }
      for (const std::string& bytes : broken) {
        const auto path = folder.write("b.laz", bytes);
        if (chunk == kVariable && format < 6) {
          CHECK_THAT(test::reading_error(path), Catch::Contains("chunk table"));
          continue;
        }
        const auto r = test::read_points(path);
        CHECK(test::same_points(r.points, whole.points));
        CHECK_THAT(message(r.info.warnings), Catch::Contains("chunk table"));
        CHECK(r.counts.missing == 0);
        test::require_slices_agree(path, {}, {1, 5000});
      }
      for (const std::uint32_t count : {1u, 1000u, 0xffffffffu}) {
        std::string lie = file.bytes;
        test::set_bytes(lie, file.table + 4, count);
        const auto path = folder.write("l.laz", lie);
        const std::string error = test::reading_error(path);
        if (error.empty()) CHECK(starts_with(whole.points, test::read_points(path).points));
      }
    }
  }
}

TEST_CASE("laz points: the count of the header against the chunks", "[fault]") {
  const test::TempFolder folder;
  for (const int format : {1, 6}) {
    for (const std::uint32_t chunk : {50u, kVariable}) {
      const LazSample s{.format = format, .points = 290, .chunk_points = chunk};
      const std::string records = test::las_records(s);
      const LazBytes file = test::laz_file(s, records);
      const auto whole = test::read_points(folder.write("a.laz", file.bytes));
      const bool known = format == 6 || chunk == kVariable;  // by the chunks
      for (const std::uint32_t declared : {0u, 40u, 250u, 289u, 291u, 300u, 1000u, 0xffffffffu}) {
        CAPTURE(format, chunk, declared);
        std::string lie = file.bytes;
        test::set_bytes(lie, 107, declared);
        const auto path = folder.write("l.laz", lie);
        if (known) {
          const auto r = test::read_points(path);
          CHECK(test::same_points(r.points, whole.points));
          CHECK_THAT(message(r.info.warnings), Catch::Contains(std::to_string(declared)));
          CHECK(missing_points(r.info, r.counts) == (declared > 290 ? declared - 290 : 0));
          continue;
        }
        const std::string error = test::reading_error(path);
        if (declared == 289 || declared > 290) {
          CHECK_THAT(error, Catch::Contains("chunk 6 of 6 is damaged"));
        } else {
          REQUIRE(error.empty());
          const auto r = test::read_points(path);
          CHECK(starts_with(whole.points, r.points));
          CHECK_THAT(message(r.info.warnings), Catch::Contains("or more"));
        }
      }
    }
  }
}

TEST_CASE("laz points: a file that was cut off is read as far as it goes", "[fault]") {
  const test::TempFolder folder;
  for (const int format : {0, 3, 6, 8}) {
    const LazSample s{.minor = 4, .format = format, .points = 500, .chunk_points = 60};
    const std::string records = test::las_records(s);
    const LazBytes file = test::laz_file(s, records);
    const auto whole = test::read_points(folder.write("a.laz", file.bytes));
    std::size_t maximum = 0;
    for (std::size_t i = 0; i < 200; ++i) {
      const std::size_t bytes = i * file.bytes.size() / 200;
      CAPTURE(format, bytes);
      const auto path = folder.write("cut.laz", file.bytes.substr(0, bytes));
      if (bytes < file.points) {
        CHECK_FALSE(test::reading_error(path).empty());
        continue;
      }
      const auto r = test::read_points(path);
      REQUIRE(starts_with(whole.points, r.points));
      REQUIRE(r.counts.missing + r.counts.points + r.counts.withheld == 500);
      REQUIRE(r.points.size() + r.counts.withheld >= maximum);
      REQUIRE(r.info.warnings.size() == 1);
      maximum = r.points.size() + r.counts.withheld;
      test::require_slices_agree(path, {}, {1});
    }
    CHECK(maximum > 400);
  }
}

TEST_CASE("laz points: what cannot be points is one sentence with file and byte", "[fault]") {
  const test::TempFolder folder;
  const LazSample s{.format = 3};
  const std::string records = test::las_records(s);
  const LazBytes file = test::laz_file(s, records);
  const auto error = [&](std::size_t at, auto value) {
    std::string bad = file.bytes;
    test::set_bytes(bad, at, value);
    return test::reading_error(folder.write("bad.laz", bad));
  };
  CHECK_THAT(error(100, std::uint32_t{0}), Catch::Contains("laszip encoded"));
  CHECK_THAT(error(file.record, std::uint16_t{9}), Catch::Contains("compressor 9"));
  CHECK_THAT(error(file.record + 2, std::uint16_t{1}), Catch::Contains("coder 1"));
  CHECK_THAT(error(file.record + 34, std::uint16_t{10}), Catch::Contains("items"));
  CHECK_THAT(error(file.record + 38, std::uint16_t{5}), Catch::Contains("version 5"));
  CHECK_THAT(error(104, std::uint8_t{0x80 + 11}), Catch::Contains("point format 11"));
  CHECK_THAT(error(104, std::uint8_t{0xc3}), Catch::Contains("point format 67"));
  CHECK_THAT(error(105, std::uint16_t{60000}), Catch::Contains("extra bytes"));
  // In the middle of the second chunk.
  const std::size_t middle = file.points + (file.table - file.points) / 4;
  CHECK_THAT(error(middle, std::uint64_t{0x5a5a5a5a5a5a5a5a}), Catch::Contains("is damaged"));
}

TEST_CASE("laz points: damaged files give points or a sentence", "[fault]") {
  std::mt19937_64 random(20261122);
  int read = 0;
  int tried = 0;
  for (const int format : {0, 3, 5, 6, 8, 9}) {
    for (const std::uint32_t chunk : {40u, kVariable}) {
      const LazSample s{.minor = 4, .format = format, .extra = 1, .points = 150, .chunk_points = chunk};
      const std::string whole = test::laz_file(s, test::las_records(s)).bytes;
      for (int i = 0; i < 170; ++i) {
        std::string bad = whole;
        for (std::uint64_t k = random() % 3 + 1; k > 0; --k) {
          const std::size_t at = random() % bad.size();
          switch (random() % 4) {
            case 0:
              bad[at] = static_cast<char>(random());
              break;
            case 1:
              bad.erase(at, random() % 9);
              break;
            case 2:
              bad.insert(at, 1 + random() % 9, static_cast<char>(random()));
              break;
            default:
              if (at + 8 < bad.size())
                test::set_bytes(bad, at,
                                random() % 2 ? ~std::uint64_t{0} : std::uint64_t{1} << random() % 64);
          }
        }
        ++tried;
        CAPTURE(format, chunk, i);
        REQUIRE_NOTHROW(read += fuzz::check_reader(open_las_points, bad) ? 1 : 0);
      }
    }
  }
  CHECK(tried >= 2000);
  CHECK(read > tried / 20);
  CHECK(read < tried - tried / 20);
}

TEST_CASE("laz points: real files have the points of their twins and headers", "[pipeline][.shared]") {
  if (!test::has_shared_data()) return;
  const std::filesystem::path data = test::kSharedData;
  const auto las = test::read_points(data / "lidar/autzen-trim.las");
  const auto laz = test::read_points(data / "lidar/autzen-trim.laz");
  CHECK(test::same_points(laz.points, las.points));
  CHECK(laz.points.size() == 110000);
  test::require_slices_agree(data / "lidar/autzen-trim.laz", {}, {100000});

  const auto ign = test::read_points(data / "lidar/ign-2023.laz");
  CHECK(ign.points.size() == 289055);
  CHECK(ign.info.warnings.empty());
  for (std::size_t a = 0; a < 3; ++a) {
    const auto& v = a == 0 ? ign.points.x : a == 1 ? ign.points.y : ign.points.z;
    CHECK(*std::min_element(v.begin(), v.end()) == Approx(ign.info.declared_min[a]).margin(1e-9));
    CHECK(*std::max_element(v.begin(), v.end()) == Approx(ign.info.declared_max[a]).margin(1e-9));
  }
  test::require_slices_agree(data / "lidar/ign-2023.laz", {}, {1000000});

  // Some readers give up after 1,122 points of this tile; all of it decodes, to the last byte, into one smooth slope.
  const auto tile = test::read_points(data / "dirty/churo-corrupt-tile.laz");
  CHECK(tile.points.size() == 1278);
  const auto [low, high] = std::minmax_element(tile.points.z.begin(), tile.points.z.end());
  CHECK(*low > 3545);
  CHECK(*high < 3583);
}

TEST_CASE("laz points: chunks of other programs are coded into their very bytes", "[pipeline][.shared]") {
  if (!test::has_shared_data()) return;
  for (const char* name : {"lidar/autzen-trim.laz", "lidar/ign-2023.laz"}) {
    const ReadFile file(std::filesystem::path(test::kSharedData) / name);
    std::string bytes(file.size(), '\0');
    file.read_at(0, bytes.data(), bytes.size());
    const LasHeader header(file);
    const laz::Schema schema = find_laz_schema(file, header);
    const LazChunks chunks = find_laz_chunks(file, header, schema);
    for (std::size_t i = 0; i < chunks.size(); ++i) {
      const std::string_view chunk = std::string_view(bytes).substr(
          chunks.edges[i].begin, chunks.edges[i + 1].begin - chunks.edges[i].begin);
      laz::ByteFeed feed(chunk);
      const auto decoder = schema.layered()
                               ? laz::decode_layered(
                                     schema,
                                     [&](std::uint64_t a, std::uint64_t b) {
                                       return std::make_unique<laz::ByteFeed>(chunk.substr(a, b - a));
                                     },
                                     laz::Layers::kAll)
                               : laz::decode_pointwise(schema, feed);
      std::string records(chunks.points_of(i) * schema.record_bytes(), '\0');
      decoder->decode(records.data(), chunks.points_of(i));
      const std::vector<char> again = laz::encode_chunk(schema, records);
      CHECK(std::string_view(again.data(), again.size()) == chunk);
    }
  }
}

}  // namespace
}  // namespace tessera::laz_points_test
