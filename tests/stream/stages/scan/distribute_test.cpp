#include <catch2/catch.hpp>
#include <fstream>

#include "octree/error.h"
#include "stream/points/run_file.h"
#include "tests/helpers/point_chain.h"
#include "tests/helpers/random_points.h"
#include "tests/helpers/skip.h"

namespace distribute_test {

using namespace tessera;
using namespace tessera::test;

TEST_CASE("run file: points come back by bucket", "[unit]") {
  const TempFolder folder;
  const auto path = folder.path() / "0.run";
  RunWriter writer(path, 7, 5, 100);
  for (int i = 0; i < 1050; ++i) {
    PointRecord p;
    p.q = {i, 0, 0};
    writer.add(p, static_cast<std::uint32_t>(i * i % 5));
  }
  const std::uint64_t size = writer.finish();
  CHECK(size == std::filesystem::file_size(path));
  const PackedFile file = open_run_file(path);
  const auto extents = file.table<Extent>();
  std::vector<PointRecord> buffer;
  std::vector<int> seen(1050);
  for (const Extent& e : extents) {
    CHECK(e.file == 7);
    stream_extent(file, e, buffer, [&](std::span<const PointRecord> points) {
      for (const PointRecord& p : points) {
        CHECK(static_cast<std::uint32_t>(p.q[0] * p.q[0] % 5) == e.bucket);
        ++seen[static_cast<std::size_t>(p.q[0])];
      }
    });
  }
  CHECK(std::all_of(seen.begin(), seen.end(), [](int n) { return n == 1; }));
}

TEST_CASE("run file: damage is found", "[fault]") {
  const TempFolder folder;
  const auto path = folder.path() / "0.run";
  RunWriter writer(path, 0, 2, 100);
  for (int i = 0; i < 150; ++i) writer.add(PointRecord{}, static_cast<std::uint32_t>(i % 2));
  writer.finish();
  const auto extents = open_run_file(path).table<Extent>();
  const auto size = std::filesystem::file_size(path);
  std::string bytes = file_bytes(path);
  const auto write = [&] { std::ofstream(path, std::ios::binary) << bytes; };
  SECTION("points") {
    bytes[64 + 24 * 10] ^= 1;
    write();
    const PackedFile file = open_run_file(path);
    std::vector<PointRecord> buffer;
    CHECK_THROWS_AS(stream_extent(file, extents[0], buffer, [](auto) {}), InputError);
  }
  SECTION("table") {
    bytes[size - 80] ^= 1;
    write();
    CHECK_THROWS_AS(open_run_file(path).table<Extent>(), InputError);
  }
  SECTION("end") {
    bytes.resize(size - 3);
    write();
    CHECK_THROWS_AS(open_run_file(path).table<Extent>(), InputError);
  }
  SECTION("nearly nothing") {
    bytes.resize(20);
    write();
    CHECK_THROWS_AS(open_run_file(path).table<Extent>(), InputError);
  }
}

TEST_CASE("distribute: an input that changes after the survey is refused", "[fault]") {
  const TempFolder work;
  ChainSetup setup;
  auto points = sphere_points(5000, 100.0, {0, 0, 0});
  const JobState job = chain_job(work.path(), setup);
  run_stage(SurveyStage(job, chain_inputs(points, setup), setup.h, 0), job.work);
  points.pop_back();
  CHECK_THROWS_WITH(run_stage(DistributeStage(job, chain_inputs(points, setup)), job.work),
                    Catch::Contains("changed"));
}

TEST_CASE("distribute: sensor ids follow from the set of sensors", "[unit]") {
  const auto make = [](const Double3& sensor, const Double3& at) {
    auto file = std::make_unique<MemoryPoints>(
        std::vector<TestPoint>{{at, {}, 0}, {{at[0] + 1, at[1], at[2]}, {}, 0}}, 100);
    if (sensor != Double3{}) file->edit().sensors = {sensor};
    return file;
  };
  const Double3 a = {5, 0, 0};
  const Double3 b = {-5, 0, 0};
  std::vector<std::uint16_t> ids;
  PointChunk chunk;
  chunk.x = {-4.0, 4.5};
  chunk.y = {0.0, 0.0};
  chunk.z = {0.0, 0.0};
  ReconstructOptions options;
  SECTION("of the files, in either order") {
    for (const bool swapped : {false, true}) {
      std::vector<std::unique_ptr<PointFile>> files;
      files.push_back(make(swapped ? b : a, {0, 0, 0}));
      files.push_back(make(swapped ? a : b, {9, 9, 9}));
      const PointInputs inputs(std::move(files), options);
      CHECK(inputs.sensors() == std::vector<Double3>{b, a});
      chunk.sensor = {0, 0};
      inputs.sensor_ids(swapped ? 1 : 0, chunk, ids);
      CHECK(ids == std::vector<std::uint16_t>{1, 1});
    }
  }
  SECTION("one viewpoint for all, a file's own sensor first") {
    options.viewpoints = {{7, 7, 7}};
    std::vector<std::unique_ptr<PointFile>> files;
    files.push_back(make({}, {0, 0, 0}));
    files.push_back(make(a, {0, 0, 0}));
    const PointInputs inputs(std::move(files), options);
    inputs.sensor_ids(0, chunk, ids);
    CHECK(ids == std::vector<std::uint16_t>{1, 1});
    chunk.sensor = {0, 0};
    inputs.sensor_ids(1, chunk, ids);
    CHECK(ids == std::vector<std::uint16_t>{0, 0});
  }
  SECTION("one viewpoint per file") {
    options.viewpoints = {a, b};
    std::vector<std::unique_ptr<PointFile>> files;
    files.push_back(make({}, {0, 0, 0}));
    files.push_back(make({}, {0, 0, 0}));
    const PointInputs inputs(std::move(files), options);
    inputs.sensor_ids(0, chunk, ids);
    CHECK(ids == std::vector<std::uint16_t>{1, 1});
    inputs.sensor_ids(1, chunk, ids);
    CHECK(ids == std::vector<std::uint16_t>{0, 0});
  }
  SECTION("the nearest of several") {
    options.viewpoints = {a, b};
    std::vector<std::unique_ptr<PointFile>> files;
    files.push_back(make({}, {0, 0, 0}));
    const PointInputs inputs(std::move(files), options);
    inputs.sensor_ids(0, chunk, ids);
    CHECK(ids == std::vector<std::uint16_t>{0, 1});
  }
  SECTION("none") {
    std::vector<std::unique_ptr<PointFile>> files;
    files.push_back(make({}, {0, 0, 0}));
    const PointInputs inputs(std::move(files), options);
    inputs.sensor_ids(0, chunk, ids);
    CHECK(ids == std::vector<std::uint16_t>{0xffff, 0xffff});
  }
}

TEST_CASE("distribute: given normals are kept aside where normals are estimated, to be compared with",
          "[unit]") {
  ChainSetup setup;
  setup.options.normals = "estimate";
  const ChainResult r = run_chain(sphere_points(3000, 100.0, {0, 0, 0}), setup);
  CHECK(r.plan.normal_fraction == 0.0);
  CHECK(std::none_of(r.points.begin(), r.points.end(), [](const auto& p) { return p.normal == kNoNormal; }));
}

TEST_CASE("direct file: any sizes of writes give the same file", "[unit]") {
  const TempFolder folder;
  Random random(4);
  std::string want;
  DirectFile file(folder.path() / "f", 8192);
  for (int i = 0; i < 200; ++i) {
    const std::string part(random.bits() % 20000, static_cast<char>('a' + i % 26));
    file.write(part.data(), part.size());
    want += part;
    REQUIRE(file.offset() == want.size());
  }
  CHECK(file.finish() == want.size());
  CHECK(file_bytes(folder.path() / "f") == want);
  CHECK_THROWS_AS(DirectFile(folder.path() / "no" / "f"), ResourceError);
}

TEST_CASE("direct file: a full disk is one clear sentence", "[fault]") {
  if (!std::filesystem::exists("/dev/full")) return skip("no /dev/full");
  DirectFile file("/dev/full", 4096);
  const std::string part(10000, 'x');
  CHECK_THROWS_WITH(file.write(part.data(), part.size()), Catch::Contains("disk is full"));
}

}  // namespace distribute_test
