#include <catch2/catch.hpp>

#include <algorithm>
#include <vector>

#include "stream/files/external_sort.h"
#include "tests/helpers/memory_mesh.h"

namespace tessera::external_sort_test {
namespace {

struct Record {
  std::uint64_t key;
  std::uint32_t payload;
  bool operator<(const Record& o) const { return key != o.key ? key < o.key : payload < o.payload; }
  bool operator==(const Record&) const = default;
};

TEST_CASE("external sort: agrees with std::sort under any budget", "[property]") {
  const std::size_t count = GENERATE(0u, 1u, 1000u, 200000u);
  const std::uint64_t budget = GENERATE(1024u, 4096u, 65536u, 64u << 20);
  test::Random random;
  std::vector<Record> want;
  ExternalSort<Record> sort({}, budget);
  for (std::size_t i = 0; i < count; ++i) {
    want.push_back({random.below(count / 2 + 1), static_cast<std::uint32_t>(i)});
    sort.add(want.back());
  }
  std::sort(want.begin(), want.end());
  CHECK((count * sizeof(Record) <= budget) == (sort.runs() == 0));  // else the merge was not tried
  std::vector<Record> got;
  const auto collect = [&](std::span<const Record> batch) {
    got.insert(got.end(), batch.begin(), batch.end());
  };
  sort.drain(collect);
  CHECK(got == want);
  got.clear();
  sort.drain(collect);
  CHECK(got.empty());
}

}  // namespace
}  // namespace tessera::external_sort_test
