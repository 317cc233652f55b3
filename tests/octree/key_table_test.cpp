#include "octree/key_table.h"

#include <catch2/catch.hpp>
#include <map>

#include "tests/helpers/random.h"

namespace key_table_test {

using namespace tessera;

TEST_CASE("key table: numbers keys as they come, as a map would", "[property]") {
  test::Random random(11);
  KeyTable table;
  std::map<std::uint64_t, std::uint32_t> want;
  const std::uint64_t scale = GENERATE(std::uint64_t{1}, std::uint64_t{1} << 21, std::uint64_t{1} << 58);
  for (int i = 0; i < 60'000; ++i) {
    const std::uint64_t key = random.below(20'000) * scale - 3;  // zero and all ones are keys like others
    const auto [at, is_new] = want.try_emplace(key, static_cast<std::uint32_t>(want.size()));
    const std::pair<std::uint32_t, bool> got = table.add(key);
    REQUIRE((got.first == at->second && got.second == is_new));
  }
  REQUIRE(table.size() == want.size());
  for (const auto& [key, number] : want) {
    REQUIRE(table.keys()[number] == key);
    REQUIRE(table.find(key) == number);
  }
  for (int i = 0; i < 1000; ++i)
    if (const std::uint64_t key = random.below(1u << 30) * scale + 1; want.count(key) == 0)
      REQUIRE(table.find(key) == table.size());
  CHECK(KeyTable().find(7) == 0);
}

}  // namespace key_table_test
