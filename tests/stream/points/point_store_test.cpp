#include <catch2/catch.hpp>
#include <fstream>

#include "octree/error.h"
#include "stream/points/point_sort.h"
#include "stream/points/point_store.h"
#include "tests/helpers/random_points.h"
#include "tests/helpers/serial_job.h"
#include "tests/helpers/stored_points.h"

namespace point_store_test {

using namespace tessera;
using namespace tessera::test;

namespace {

constexpr int kBrickQuanta = kBrickCells * kQuantaPerCell;

/// Canonically ordered random points of a few bricks around (1..3)^3, one of them dense.
std::vector<PointRecord> some_points(std::size_t count) {
  Random random(11);
  std::vector<PointRecord> points(count);
  for (std::size_t i = 0; i < count; ++i) {
    const double spread = i % 3 == 0 ? 0.2 : 2.9;
    for (std::size_t a = 0; a < 3; ++a)
      points[i].q[a] = static_cast<std::int32_t>(random.in(1.0, 1.0 + spread) * kBrickQuanta);
    points[i].normal =
        encode_normal(static_cast<float>(random.in(-1, 1)), static_cast<float>(random.in(-1, 1)), 0.5f);
    points[i].rgba = static_cast<std::uint32_t>(random.bits()) | 0xff000000u;
    points[i].sensor = static_cast<std::uint16_t>(i % 5);
    if (i % 97 == 0) points[i].normal = kNoNormal;
    if (i % 3 == 0) points[i].flags = kPointGround;
    if (i % 89 == 0) points[i].flags = kPointOutlier;
  }
  std::sort(points.begin(), points.end(), [](const PointRecord& a, const PointRecord& b) {
    const auto key = [](const Int3& q) {
      return std::pair{brick_key({q[0] >> 16, q[1] >> 16, q[2] >> 16}), key_in_brick(q)};
    };
    return key(a.q) < key(b.q);
  });
  return points;
}

std::uint64_t key_of(const PointRecord& p) {
  return brick_key({p.q[0] >> 16, p.q[1] >> 16, p.q[2] >> 16});
}

/// Two files, the second from the middle brick on.
std::vector<std::filesystem::path> write_store(const std::filesystem::path& folder,
                                               const std::vector<PointRecord>& points) {
  const std::uint64_t middle = key_of(points[points.size() / 2]);
  std::vector<std::filesystem::path> files = {folder / "0.tsp", folder / "1.tsp"};
  PointFileWriter first(files[0], 8192);
  PointFileWriter second(files[1]);
  for (std::size_t i = 0; i < points.size();) {
    std::size_t end = i;
    while (end < points.size() && key_of(points[end]) == key_of(points[i])) ++end;
    (key_of(points[i]) < middle ? first : second).brick(key_of(points[i]), {points.data() + i, end - i});
    i = end;
  }
  first.finish();
  const std::uint64_t size = second.finish();
  CHECK(size == std::filesystem::file_size(files[1]));
  return files;
}

void flip_byte(const std::filesystem::path& file, std::uint64_t at) {
  std::fstream f(file, std::ios::in | std::ios::out | std::ios::binary);
  f.seekg(static_cast<std::streamoff>(at));
  const char c = static_cast<char>(f.get() ^ 0x40);
  f.seekp(static_cast<std::streamoff>(at));
  f.put(c);
}

}  // namespace

TEST_CASE("point store: a box holds exactly its points, in canonical order", "[unit]") {
  const TempFolder folder;
  const auto points = some_points(20000);
  const PointStore store(write_store(folder.path(), points));
  CHECK(store.point_count() == points.size());
  const Int3 origin = GENERATE(Int3{64, 64, 64}, Int3{128, 64, 128}, Int3{0, 0, 0}, Int3{100, 70, 90});
  const Int3 cells = GENERATE(Int3{64, 64, 64}, Int3{128, 128, 128});
  const int halo = GENERATE(0, 4, 7);
  CAPTURE(origin, cells, halo);
  const PointBlock block = store.load(origin, cells, halo, {.sensor = true, .flags = true});
  std::size_t n = 0;
  bool same = true;
  std::uint64_t bound = 0;
  for (const PointRecord& p : points) {
    bool inside = true;
    for (std::size_t a = 0; a < 3; ++a) {
      const int low = (origin[a] - halo) * kQuantaPerCell;
      const int high = (origin[a] + cells[a] + halo) * kQuantaPerCell;
      inside = inside && p.q[a] >= low && p.q[a] < high;
    }
    if (!inside) continue;
    ++bound;
    if (p.flags & kPointOutlier) continue;
    REQUIRE(n < block.size());
    const Float3 normal = decode_normal(p.normal);
    same = same && block.x[n] == static_cast<float>(p.q[0] - origin[0] * 1024) / 1024.0f &&
           block.y[n] == static_cast<float>(p.q[1] - origin[1] * 1024) / 1024.0f &&
           block.z[n] == static_cast<float>(p.q[2] - origin[2] * 1024) / 1024.0f &&
           block.nx[n] == normal[0] && block.ny[n] == normal[1] && block.nz[n] == normal[2] &&
           block.rgba[n] == p.rgba && block.sensor[n] == p.sensor && block.flags[n] == p.flags;
    ++n;
  }
  CHECK(same);
  CHECK(n == block.size());
  CHECK(store.count_bound(origin, cells, halo) >= bound);
  CHECK(block.nz.size() == n);
  CHECK(store.load(origin, cells, halo).flags.empty());
  const PointBlock positions = store.load(origin, cells, halo, {.normals = false});
  CHECK((positions.x == block.x && positions.y == block.y && positions.z == block.z));
  CHECK((positions.nx.empty() && positions.rgba.empty()));
}

TEST_CASE("point store: bricks come back whole", "[unit]") {
  const TempFolder folder;
  const auto points = some_points(5000);
  const auto files = write_store(folder.path(), points);
  const PointStore store(files);
  const auto stored = stored_points(files);
  REQUIRE(stored.size() == points.size());
  for (std::size_t n = 0; n < points.size(); ++n) CHECK(stored[n].q == points[n].q);
  CHECK(store.find(brick_key({9, 9, 9})) == nullptr);
  CHECK(store.load({1000, 1000, 1000}, {64, 64, 64}, 4).size() == 0);
}

TEST_CASE("point store: scans without colour have none in a block", "[unit]") {
  const TempFolder folder;
  auto points = some_points(100);
  for (PointRecord& p : points) p.rgba = 0;
  const PointStore store(write_store(folder.path(), points));
  const PointBlock block = store.load({0, 0, 0}, {512, 512, 512}, 0);
  CHECK(block.size() > 90);
  CHECK(block.rgba.empty());
  CHECK(block.sensor.empty());
}

TEST_CASE("point store: every damaged section is named", "[fault]") {
  const TempFolder folder;
  const auto points = some_points(3000);
  const auto files = write_store(folder.path(), points);
  const std::uint64_t size = std::filesystem::file_size(files[0]);
  const auto load_all = [&] {
    const PointStore store(files);
    store.load({0, 0, 0}, {512, 512, 512}, 0);
    for (const BrickEntry& b : store.bricks()) {
      const Int3 at = brick_of_key(b.key);
      store.load({at[0] * 64 + 8, at[1] * 64 + 8, at[2] * 64 + 8}, {64, 64, 64}, 4);
    }
  };
  CHECK_NOTHROW(load_all());
  SECTION("magic") {
    flip_byte(files[0], 0);
  }
  SECTION("record") {
    flip_byte(files[0], 64 + 24 * 17 + 3);
  }
  SECTION("block table") {
    const PointStore store(files);
    flip_byte(files[0], store.bricks().front().block_table().offset + 4);
  }
  SECTION("brick table") {
    flip_byte(files[0], size - 64 - 40);
  }
  SECTION("footer") {
    flip_byte(files[0], size - 60);
  }
  SECTION("truncated") {
    std::filesystem::resize_file(files[0], size - 7);
  }
  SECTION("empty") {
    std::filesystem::resize_file(files[0], 0);
  }
  CHECK_THROWS_WITH(load_all(), Catch::Contains("0.tsp"));
  CHECK_THROWS_AS(load_all(), InputError);
}

TEST_CASE("point store: files out of order are refused", "[fault]") {
  const TempFolder folder;
  auto files = write_store(folder.path(), some_points(3000));
  std::swap(files[0], files[1]);
  CHECK_THROWS_AS(PointStore(files), InputError);
}

}  // namespace point_store_test
