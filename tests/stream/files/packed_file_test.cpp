#include <array>
#include <catch2/catch.hpp>
#include <cstring>
#include <fstream>
#include <numeric>

#include "octree/error.h"
#include "stream/files/packed_file.h"
#include "stream/points/point_overlay.h"
#include "tests/helpers/point_reading.h"
#include "tests/helpers/temp_folder.h"

namespace packed_file_test {

using namespace tessera;
using namespace tessera::test;

namespace {

constexpr PackedKind kKind = {"TSTESTS1", "a test file"};

struct Entry {
  std::uint64_t key = 0;
  Section section;
};

std::vector<std::uint32_t> numbers(std::size_t count) {
  std::vector<std::uint32_t> out(count);
  std::iota(out.begin(), out.end(), 7u);
  return out;
}

std::uint64_t write_two(const std::filesystem::path& path, std::uint64_t first_key = 3) {
  PackedWriter file(path, kKind, 4096);
  std::vector<Entry> table;
  table.push_back({first_key, file.append(bytes_of(numbers(5000)))});
  table.push_back({first_key + 5, file.append({bytes_of(numbers(10)), bytes_of(numbers(1))})});
  const std::array<std::uint64_t, 1> info = {99};
  return file.finish(table, bytes_of(info));
}

void read_all(const std::filesystem::path& path) {
  const PackedFile file(path, kKind, sizeof(Entry), 8);
  for (const Entry& e : file.table<Entry>()) file.load<std::uint32_t>(e.section);
}

void write_bytes(const std::filesystem::path& path, const std::string& bytes) {
  std::ofstream(path, std::ios::binary | std::ios::trunc) << bytes;
}

}  // namespace

TEST_CASE("packed file: sections, table and info come back, whole, in parts and as a stream", "[unit]") {
  const TempFolder folder;
  const auto path = folder / "a.tst";
  const std::uint64_t written = write_two(path);
  CHECK(written == std::filesystem::file_size(path));
  const PackedFile file(path, kKind, sizeof(Entry), 8);
  std::uint64_t info = 0;
  std::memcpy(&info, file.info().data(), sizeof info);
  CHECK(info == 99);
  const auto table = file.table<Entry>();
  REQUIRE(table.size() == 2);
  CHECK(file.entries<Entry>(1, 1)[0].key == 8);
  CHECK(file.load<std::uint32_t>(table[0].section) == numbers(5000));
  std::vector<std::uint32_t> maximum(10), last(1);
  file.read(table[1].section, {buffer_of(maximum), buffer_of(last)});
  CHECK(maximum == numbers(10));
  CHECK(last == numbers(1));
  std::uint32_t third = 0;
  file.read_part(table[1].section, 8, &third, sizeof third);
  CHECK(third == 9);
  SectionReader reader(file, table[0].section);
  std::vector<std::uint32_t> part(1000);
  for (std::uint32_t first = 7; reader.left() > 0; first += 1000) {
    reader.next(part.data(), 4000);
    CHECK(part.front() == first);
  }
}

TEST_CASE("packed file: every flipped byte and every cut is found and named", "[fault]") {
  const TempFolder folder;
  const auto path = folder / "a.tst";
  const auto size = write_two(path);
  const std::string bytes = file_bytes(path);
  for (std::uint64_t at = 0; at < size; at += at < 20000 ? 977 : 1) {
    std::string bad = bytes;
    bad[at] = static_cast<char>(bad[at] ^ 0x10);
    write_bytes(path, bad);
    CAPTURE(at, size);
    CHECK_THROWS_AS(read_all(path), InputError);
    CHECK_THROWS_WITH(read_all(path), Catch::Contains("a.tst: byte ") && Catch::Contains("--force"));
  }
  for (const std::uint64_t left : {size - 1, size - 64, size / 2, std::uint64_t{70}, std::uint64_t{0}}) {
    write_bytes(path, bytes.substr(0, left));
    CHECK_THROWS_AS(read_all(path), InputError);
  }
}

TEST_CASE("packed file: other kinds and other versions are refused", "[fault]") {
  const TempFolder folder;
  const auto path = folder / "a.tst";
  write_two(path);
  CHECK_THROWS_WITH(PackedFile(path, {"TSTESTS2", "a test file"}, sizeof(Entry), 8),
                    Catch::Contains("not a test file of this version"));
  CHECK_THROWS_AS(PackedFile(path, kKind, sizeof(Section), 8), InputError);
  CHECK_THROWS_AS(PackedFile(path, kKind, sizeof(Entry), 16), InputError);
}

TEST_CASE("packed tables: files of a job follow one another, mixed ones are refused", "[fault]") {
  const TempFolder folder;
  PackedWriter(folder / "0", kKind).finish(std::vector<Entry>{{3, {}}, {8, {}}});
  PackedWriter(folder / "1", kKind).finish(std::vector<Entry>{{9, {}}});
  const PackedTables<Entry> tables({folder / "0", folder / "1"}, kKind);
  CHECK(tables.index_of(9) == 2);
  CHECK(tables.find(4) == nullptr);
  CHECK(tables.file_index(2) == 1);
  CHECK(tables.file_range(1) == std::pair<std::size_t, std::size_t>{2, 3});
  CHECK_THROWS_AS(PackedTables<Entry>({folder / "1", folder / "0"}, kKind), InputError);
}

TEST_CASE("point overlay: checksums cover records, surfels, facts and votes", "[fault]") {
  const TempFolder folder;
  const auto path = folder / "0.tsn";
  BrickOrientation orientation;
  orientation.patches = 2;
  orientation.boundary.resize(3);
  orientation.stats.resize(2);
  orientation.votes.resize(4);
  orientation.coarse.resize(5);
  OverlayFileWriter writer(path);
  writer.brick(11, std::vector<PointOverlayRecord>(6), orientation);
  writer.finish();
  const std::string bytes = file_bytes(path);
  const auto load = [&] {  // no assertions: they would keep what is thrown
    const PointOverlay overlay({path});
    overlay.load_records(0, 0, 6);
    return overlay.load_boundary(0).size() == 3 && overlay.load_stats(0).size() == 2 &&
           overlay.load_votes(0).size() == 4 && overlay.load_coarse(0).size() == 5;
  };
  CHECK(load());
  for (std::size_t at = 0; at < bytes.size(); at += 5) {
    std::string bad = bytes;
    bad[at] = static_cast<char>(bad[at] ^ 1);
    write_bytes(path, bad);
    CAPTURE(at);
    CHECK_THROWS_AS(load(), InputError);
  }
}

}  // namespace packed_file_test
