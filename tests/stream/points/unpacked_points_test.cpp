#include "stream/points/unpacked_points.h"

#include <catch2/catch.hpp>

#include <cmath>
#include <fstream>
#include <limits>

#include "octree/error.h"
#include "tests/helpers/temp_folder.h"

namespace tessera::unpacked_points_test {
namespace {

PointChunk chunk_of(std::size_t n, bool on_grid) {
  PointChunk c;
  for (std::size_t i = 0; i < n; ++i) {
    const auto k = static_cast<std::int32_t>(i * 7919 % 100003) - 50000;
    c.x.push_back(k * 0.01 + 5e5), c.y.push_back(-k * 0.01 + 4.5e6), c.z.push_back(k * 0.001);
    c.echo.push_back({static_cast<std::uint8_t>(i % 20), 1, 2});
    c.rgba.push_back(static_cast<std::uint32_t>(i * 77) | 0xff000000u);
    c.intensity.push_back(static_cast<std::uint16_t>(i * 3));
  }
  if (!on_grid) c.z[n / 2] = std::nextafter(c.z[n / 2], 1e9);
  return c;
}

const PositionGrid kGrid = {{0.01, 0.01, 0.001}, {5e5, 4.5e6, 0.0}};

bool same(const PointChunk& a, const PointChunk& b) {
  return a.x == b.x && a.y == b.y && a.z == b.z && a.echo == b.echo && a.rgba == b.rgba &&
         a.intensity == b.intensity && a.nx == b.nx && a.sensor == b.sensor;
}

}  // namespace

TEST_CASE("unpacked points: chunks come back bit for bit, on the grid, beside it and with odd values",
          "[unit]") {
  const test::TempFolder folder;
  const auto path = folder.path() / "0.points";
  std::vector<PointChunk> chunks = {chunk_of(1000, true), chunk_of(500, false), chunk_of(7, true)};
  chunks[2].nx = chunks[2].ny = chunks[2].nz = std::vector<float>(7, 0.5f);
  chunks[2].sensor.assign(7, 3);
  chunks[2].x[3] = std::numeric_limits<double>::infinity();
  chunks[2].y[4] = 1e300;
  ReadCounts counts;
  counts.points = 1600, counts.other_class = 93, counts.outside = 4, counts.missing = 2, counts.withheld = 1;
  counts.warnings = {"one sentence", "and another"};
  std::uint64_t bytes = 0;
  {
    UnpackedWriter writer(path);
    for (std::size_t i = 0; i < chunks.size(); ++i)
      writer.add(static_cast<std::uint32_t>(i), kGrid, chunks[i]);
    bytes = writer.finish(counts);
  }
  CHECK(bytes == std::filesystem::file_size(path));
  std::size_t next = 0;
  const auto grid = [](std::uint32_t) { return kGrid; };
  const ReadCounts back = read_unpacked(path, true, grid, [&](std::uint32_t file, const PointChunk& c) {
    REQUIRE(file == next);
    CHECK(same(c, chunks[next]));
    ++next;
  });
  CHECK(next == 3);
  CHECK(back.points == 1600);
  CHECK(back.other_class == 93);
  CHECK(back.outside == 4);
  CHECK(back.missing == 2);
  CHECK(back.withheld == 1);
  CHECK(back.warnings == counts.warnings);
  read_unpacked(path, false, grid, [&](std::uint32_t, const PointChunk& c) {
    CHECK(c.rgba.empty());
    CHECK(c.intensity.empty());
  });
}

TEST_CASE("unpacked points: 19 bytes a point on the grid", "[unit]") {
  const test::TempFolder folder;
  PointChunk c = chunk_of(50000, true);
  c.intensity.clear();
  UnpackedWriter writer(folder.path() / "0.points");
  writer.add(0, kGrid, c);
  const std::uint64_t bytes = writer.finish({});
  CHECK(bytes > 19 * c.size());
  CHECK(bytes < 19 * c.size() + 1000);
}

TEST_CASE("unpacked points: damage is found, and so is a file that is gone", "[fault]") {
  const test::TempFolder folder;
  const auto path = folder.path() / "0.points";
  UnpackedWriter writer(path);
  writer.add(0, kGrid, chunk_of(100, true));
  writer.finish({});
  std::string bytes = test::file_bytes(path);
  bytes[200] ^= 1;
  std::ofstream(path, std::ios::binary) << bytes;
  const auto read = [&] {
    read_unpacked(
        path, true, [](std::uint32_t) { return kGrid; }, [](std::uint32_t, const PointChunk&) {});
  };
  CHECK_THROWS_AS(read(), InputError);
  std::filesystem::remove(path);
  CHECK_THROWS_AS(read(), InputError);
}

}  // namespace tessera::unpacked_points_test
