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

TEST_CASE("key table: room made before, and used again, changes no number", "[unit]") {
  const std::size_t room = GENERATE(1u, 200u, 5'000u, 70'000u);
  KeyTable grown, roomy;
  roomy.reserve(room);
  for (int round = 0; round < 2; ++round) {
    for (std::uint64_t i = 0; i < 9'000; ++i) {
      const std::uint64_t key = (i * i) % 4'001 * 0x10001;
      REQUIRE(grown.add(key) == roomy.add(key));
    }
    REQUIRE(grown.size() == roomy.size());
    CHECK(grown.size() > 2'000);
    grown = KeyTable();
    roomy.clear();
    CHECK(roomy.size() == 0);
    CHECK(roomy.find(0) == 0);
  }
}

}  // namespace key_table_test
