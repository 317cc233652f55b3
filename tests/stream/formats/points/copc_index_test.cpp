#include "stream/formats/points/copc_index.h"

#include <catch2/catch.hpp>

#include <algorithm>
#include <limits>
#include <vector>

#include "octree/error.h"
#include "tests/helpers/copc_file.h"
#include "tests/helpers/point_reading.h"
#include "tests/helpers/temp_folder.h"

namespace tessera::copc_index_test {
namespace {

using test::CopcFile;
using test::set_bytes;

std::vector<Double3> sorted(const PointChunk& c, const PointBox& box) {
  std::vector<Double3> points;
  for (std::size_t i = 0; i < c.size(); ++i) {
    const Double3 p = {c.x[i], c.y[i], c.z[i]};
    bool in = true;
    for (std::size_t a = 0; a < 3; ++a) in = in && p[a] >= box.min[a] && p[a] <= box.max[a];
    if (in) points.push_back(p);
  }
  std::sort(points.begin(), points.end());
  return points;
}

TEST_CASE("copc: a box reads the chunks that it meets and loses no point", "[unit]") {
  const test::TempFolder folder;
  for (const int format : {6, 7, 8}) {
    const CopcFile f = test::copc_file(false, format);
    const auto path = folder.write("a.copc.laz", f.bytes);
    const auto twin = test::read_points(folder.write("a.las", f.twin));
    const auto whole = test::read_points(path);
    CHECK(whole.info.octree);
    CHECK(whole.counts.points == f.points);
    CHECK(sorted(whole.points, {}) == sorted(twin.points, {}));
    std::mt19937 random(3);
    for (int i = 0; i < 40; ++i) {
      PointBox box;
      for (std::size_t a = 0; a < 3; ++a) {
        const double at = 499880.0 + static_cast<double>(random() % 24000) * 0.01;
        box.min[a] = at, box.max[a] = at + static_cast<double>(random() % 6000) * 0.01;
      }
      ReadOptions options;
      options.bounds = box;
      const auto part = test::read_points(path, ~std::uint64_t{0}, options);
      CHECK(sorted(part.points, box) == sorted(twin.points, box));
      CHECK(part.counts.points < f.points);
      CHECK(part.info.declared_points == part.counts.points);
      CHECK(part.counts.missing == 0);
    }
  }
}

TEST_CASE("copc: levels up to the resolution that is asked for", "[unit]") {
  const test::TempFolder folder;
  const CopcFile f = test::copc_file();
  const auto path = folder.write("a.copc.laz", f.bytes);
  const auto points = [&](double limit) {
    ReadOptions options;
    options.resolution_limit = limit;
    return test::read_points(path, 2000, options).counts.points;
  };
  // The spacing is 8, 4, 2.
  CHECK(points(100.0) == f.of_level[0]);
  CHECK(points(8.0) == f.of_level[0]);
  CHECK(points(7.9) == f.of_level[0] + f.of_level[1]);
  CHECK(points(4.0) == f.of_level[0] + f.of_level[1]);
  CHECK(points(3.0) == f.points);
  CHECK(points(1e-9) == f.points);
}

TEST_CASE("copc: a box that no node meets gives no point", "[unit]") {
  const test::TempFolder folder;
  ReadOptions options;
  options.bounds = PointBox{{0, 0, 0}, {1, 1, 1}};
  CHECK(test::read_points(folder.write("a.laz", test::copc_file().bytes), 1000, options).counts.points == 0);
}

TEST_CASE("copc: a hierarchy that lies is refused, and harms nobody who does not ask for it", "[fault]") {
  const test::TempFolder folder;
  const CopcFile f = test::copc_file();
  const auto refused = [&](const std::string& bytes, const std::string& why) {
    const auto path = folder.write("a.laz", bytes);
    ReadOptions options;
    options.bounds = PointBox{};
    CHECK_THROWS_WITH(test::read_points(path, 3000, options),
                      Catch::StartsWith(path.string()) && Catch::Contains(why));
    return path;
  };
  const auto changed = [&](std::size_t at, auto value) {
    std::string bytes = f.bytes;
    set_bytes(bytes, at, value);
    return bytes;
  };
  const auto count =
      test::read_points(refused(changed(f.root + 28, std::int32_t{41}), "the chunk table says")).counts;
  CHECK(count.points == f.points);
  refused(changed(f.root + 16, std::uint64_t{1} << 50), "the chunk table says");
  refused(changed(f.root + 24, std::int32_t{7}), "the chunk table says");
  refused(changed(f.root + 28, std::int32_t{-2}), "cannot be");
  refused(changed(f.root, std::int32_t{32}), "cannot be");
  refused(changed(f.root, std::int32_t{-1}), "cannot be");
  refused(changed(f.root + 4, std::int32_t{1}), "cannot be");
  refused(changed(f.root + 24, std::int32_t{0}), "cannot be");
  refused(changed(f.second - 16, static_cast<std::uint64_t>(f.root)), "comes back");
  refused(changed(f.second - 16, std::uint64_t{1} << 60), "no page");
  refused(changed(f.second - 8, std::int32_t{33}), "no page");
  refused(changed(f.info + 48, ~std::uint64_t{31}), "no page");
  refused(changed(f.info + 48, std::uint64_t{0}), "no page");
  std::string twice = f.bytes;
  twice.replace(f.root + 32 + 16, 16, f.bytes.substr(f.root + 16, 16));
  refused(twice, "two nodes");
  refused(test::copc_file(true).bytes, "outside its cube");
  refused(f.bytes.substr(0, f.root + 100), "no page");
  for (const double v : {0.0, -1.0, std::numeric_limits<double>::quiet_NaN()}) {
    refused(changed(f.info + 24, v), "cube");
    refused(changed(f.info + 32, v), "spacing");
  }
}

TEST_CASE("copc: damaged files give points or a sentence", "[fault]") {
  const test::TempFolder folder;
  const CopcFile f = test::copc_file();
  std::mt19937 random(11);
  int read = 0;
  constexpr int kTries = 600;
  for (int i = 0; i < kTries; ++i) {
    std::string bytes = f.bytes;
    for (int n = 0; n < 2; ++n) {
      const std::size_t at =
          random() % 2 == 0 ? f.root + random() % (bytes.size() - f.root) : f.info + random() % 160;
      bytes[at] = static_cast<char>(random() % 3 == 0 ? random() : bytes[at] ^ (1 << random() % 8));
    }
    ReadOptions options;
    options.bounds = PointBox{{499900, 499900, 499900}, {500010, 500010, 500010}};
    options.resolution_limit = i % 2 == 0 ? 4.0 : 0.0;
    const auto path = folder.write("m.laz", bytes);
    try {
      test::read_points(path, 3000, options);
      ++read;
    } catch (const InputError& e) {
      REQUIRE(std::string(e.what()).find(path.string()) == 0);
    }
  }
  CHECK(read > kTries / 20);
  CHECK(read < kTries - kTries / 20);
}

}  // namespace
}  // namespace tessera::copc_index_test
