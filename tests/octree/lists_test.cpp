#include "octree/lists.h"

#include <catch2/catch.hpp>

#include <array>

namespace tessera::lists_test {

TEST_CASE("lists: each keeps the order of its items, empty ones at both ends stay empty", "[unit]") {
  const std::vector<std::pair<std::size_t, int>> put_in = {{3, 7}, {1, 5}, {3, 1}, {1, 9}, {3, 7}};
  const auto lists = make_lists<int>(5, [&](const auto& put) {
    for (const auto& [list, item] : put_in) put(list, item);
  });
  REQUIRE(lists.size() == 5);
  CHECK(lists.first == std::vector<std::uint32_t>{0, 0, 2, 2, 5, 5});
  CHECK(lists.item == std::vector<int>{5, 9, 7, 1, 7});
  CHECK(lists[0].empty());
  CHECK(std::vector<int>(lists[3].begin(), lists[3].end()) == std::vector<int>{7, 1, 7});
  CHECK(make_lists<int>(0, [](const auto&) {}).size() == 0);
}

TEST_CASE("lists: a counting sort is stable", "[unit]") {
  const std::vector<std::array<int, 2>> from = {{2, 0}, {0, 1}, {2, 2}, {1, 3}, {0, 4}};
  std::vector<std::array<int, 2>> to(from.size());
  std::vector<std::uint32_t> begin(4);
  counting_sort<std::array<int, 2>>(from, to, begin,
                                    [](const auto& i) { return static_cast<std::size_t>(i[0]); });
  CHECK(to == std::vector<std::array<int, 2>>{{0, 1}, {0, 4}, {1, 3}, {2, 0}, {2, 2}});
}

}  // namespace tessera::lists_test
