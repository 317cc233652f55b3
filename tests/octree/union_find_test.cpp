#include "octree/union_find.h"

#include <catch2/catch.hpp>

namespace tessera::union_find_test {

TEST_CASE("union find: the smallest member is the root, whatever the order of the calls", "[unit]") {
  const std::vector<std::pair<std::uint32_t, std::uint32_t>> pairs = {{5, 3}, {6, 1}, {3, 6}, {0, 4}};
  for (const bool backwards : {false, true}) {
    UnionFind sets(8);
    for (std::size_t i = 0; i < pairs.size(); ++i) {
      const auto& [a, b] = pairs[backwards ? pairs.size() - 1 - i : i];
      sets.unite(backwards ? b : a, backwards ? a : b);
    }
    CHECK(sets.find(5) == 1);
    CHECK(sets.roots() == std::vector<std::uint32_t>{0, 1, 2, 1, 0, 1, 1, 7});
    CHECK(sets.add() == 8);
    sets.unite(8, 2);
    CHECK(sets.find(8) == 2);
    CHECK(sets.size() == 9);
  }
}

TEST_CASE("union find: signs multiply along the way to the root, also after the way is halved", "[unit]") {
  SignedUnionFind sets(5);
  sets.hang(1, 0, -1);
  sets.hang(2, 1, -1);
  sets.hang(3, 2, -1);
  for (int again = 0; again < 2; ++again) {
    CHECK(sets.find(3).root == 0);
    CHECK(sets.find(3).sign == -1);
    CHECK(sets.find(2).sign == 1);
    CHECK(sets.find(1).sign == -1);
    CHECK(sets.find(0).sign == 1);
  }
  CHECK(sets.find(4).root == 4);
  sets.hang(4, 3, -1);
  CHECK(sets.find(4).root == 0);
  CHECK(sets.find(4).sign == 1);
}

}  // namespace tessera::union_find_test
