#include "stream/files/bucket_file.h"

#include <array>
#include <cstdint>
#include <vector>

#include <catch2/catch.hpp>

#include "tests/helpers/serial_job.h"
#include "tests/helpers/temp_folder.h"

namespace bucket_file_test {

using namespace tessera;
using namespace tessera::test;

using Record = std::array<std::uint32_t, 3>;

TEST_CASE("bucket file: runs of records make the file that single records make", "[unit]") {
  const TempFolder folder;
  constexpr std::size_t kBuckets = 7;
  constexpr std::uint64_t kMemory = kBuckets * 1024;  // chunks of 85 records
  BucketFileWriter single(folder.path() / "single", sizeof(Record), kBuckets, kMemory);
  BucketFileWriter runs(folder.path() / "runs", sizeof(Record), kBuckets, kMemory);
  std::vector<Record> records;
  std::vector<BucketRun> found;
  std::array<std::uint64_t, kBuckets> count{};
  for (std::uint32_t i = 0; i < 5000; ++i) {
    const std::size_t bucket = i < 1000 ? 3 : i / 40 % kBuckets;  // a long run, then short ones
    const Record record = {i, 2 * i, ~i};
    single.add(bucket, &record);
    records.push_back(record);
    add_to_runs(found, bucket);
    ++count[bucket];
  }
  std::size_t at = 0;
  for (const BucketRun& run : found) {
    runs.add_run(run.bucket, records.data() + at, run.count);
    at += run.count;
  }
  CHECK(at == records.size());
  CHECK(single.finish() == runs.finish());
  CHECK(file_bytes(folder.path() / "single") == file_bytes(folder.path() / "runs"));
  const BucketFile file(folder.path() / "runs", sizeof(Record));
  for (std::size_t b = 0; b < kBuckets; ++b) CHECK(file.load<Record>(b).size() == count[b]);
}

}  // namespace bucket_file_test
