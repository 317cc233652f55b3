// Records and copies of LAS and LAZ files, of every format: bytes that must not change.
#include <catch2/catch.hpp>

#include <string>

#include "octree/error.h"
#include "stream/formats/points/las_copy.h"
#include "stream/formats/points/las_records.h"
#include "tests/helpers/aerial_scene.h"
#include "tests/helpers/copc_file.h"
#include "tests/helpers/laz_file.h"
#include "tests/helpers/temp_folder.h"

namespace las_copy_test {

using namespace tessera;
using namespace tessera::test;

namespace {

std::string copy_of(const std::filesystem::path& from, const std::filesystem::path& to, std::size_t slots) {
  const LasRecords records(from);
  LasCopy copy(records, to, 2);
  records.read(
      slots, [](LasBatch&) {}, [&](LasBatch& b) { copy.append(b.records.data(), b.count); });
  copy.finish();
  return file_bytes(to);
}

}  // namespace

TEST_CASE("las copy: LAZ of every format becomes the LAS that it was made of, and back", "[unit]") {
  const TempFolder folder;
  for (int format = 0; format <= 10; ++format)
    for (const std::size_t extra : {std::size_t{0}, std::size_t{3}}) {
      LazSample sample;
      sample.format = format, sample.minor = format >= 6 ? 4 : format >= 4 ? 3 : 2;
      sample.extra = extra, sample.wild = format % 2 == 1;
      CAPTURE(format, extra);
      const std::string records = las_records(sample), twin = las_twin(sample, records);
      const auto laz = folder.write("in.laz", laz_file(sample, records).bytes);
      CHECK(copy_of(laz, folder / "out.las", 3) == twin);
      const auto las = folder.write("in.las", twin);
      CHECK(copy_of(las, folder / "same.las", 1) == twin);
      copy_of(las, folder / "out.laz", 2);
      CHECK(copy_of(folder / "out.laz", folder / "back.las", 2) == twin);
    }
}

TEST_CASE("las copy: chunks of many sizes, one run and first versions are read as well", "[unit]") {
  const TempFolder folder;
  LazSample sample;
  SECTION("many sizes") {
    sample.chunk_points = laz::Schema::kVariable;
  }
  SECTION("one run") {
    sample.chunked = false;
  }
  SECTION("first versions") {
    sample.version = 1;
  }
  const std::string records = las_records(sample);
  const auto laz = folder.write("in.laz", laz_file(sample, records).bytes);
  CHECK(copy_of(laz, folder / "out.las", 2) == las_twin(sample, records));
}

TEST_CASE("las copy: records of others, padding and what follows the points stay through LAZ", "[unit]") {
  const TempFolder folder;
  SceneFile file;
  file.format = GENERATE(1, 6);
  const std::string bytes = las_of(aerial_scene(), file);
  const auto las = folder.write("in.las", bytes);
  CHECK(copy_of(las, folder / "out.laz", 2).size() < bytes.size() / 2);
  CHECK(copy_of(folder / "out.laz", folder / "back.las", 2) == bytes);
}

TEST_CASE("las copy: of COPC the points stay and the octree goes", "[unit]") {
  const TempFolder folder;
  const CopcFile copc = copc_file();
  CHECK(copy_of(folder.write("in.copc.laz", copc.bytes), folder / "out.las", 2) == copc.twin);
}

TEST_CASE("las copy: damage and foreign files are told", "[unit]") {
  const TempFolder folder;
  LazSample sample;
  const std::string bytes = laz_file(sample, las_records(sample)).bytes;
  const auto half = folder.write("a.laz", bytes.substr(0, bytes.size() / 2));
  CHECK_THROWS_AS(copy_of(half, folder / "out.las", 2), InputError);
  CHECK(!std::filesystem::exists(folder / "out.las"));
  CHECK_THROWS_AS(LasRecords(folder.write("a.las", "no scan at all")), InputError);
  CHECK_THROWS_AS(LasCopy::is_compressed("a.ply"), UsageError);
}

}  // namespace las_copy_test
