#include "octree/level_tree.h"

#include <catch2/catch.hpp>
#include <cstdlib>

#include "tests/helpers/random.h"

namespace level_tree_test {

using namespace tessera;

namespace {

std::uint64_t key(int x, int y, int z) {
  return brick_key({x, y, z});
}

}  // namespace

TEST_CASE("level tree: without splits all bricks are of the coarsest level", "[unit]") {
  const LevelTree tree(4, {});
  CHECK(tree.level_of({0, 0, 0}) == 3);
  CHECK(tree.level_of({511, 3, 77}) == 3);
  for (const int step : tree.steps_around({2, 2, 2}, 3)) CHECK(step == 0);
}

TEST_CASE("level tree: one fine node makes a ramp of levels around it", "[unit]") {
  const LevelTree tree(4, {{}, {key(8, 8, 8)}});  // its children are the bricks (16..17)^3
  CHECK(tree.level_of({16, 16, 16}) == 0);
  CHECK(tree.level_of({17, 17, 17}) == 0);
  CHECK(tree.level_of({18, 17, 17}) == 1);
  CHECK(tree.level_of({15, 15, 15}) == 1);
  CHECK(tree.level_of({20, 16, 16}) == 2);  // the ramp ends with the children of (4, 4, 4)
  CHECK(tree.level_of({40, 40, 40}) == 3);
}

TEST_CASE("level tree: leaves that touch differ by one level at most, and say so both ways", "[property]") {
  test::Random random(5);
  for (int trial = 0; trial < 20; ++trial) {
    std::vector<std::vector<std::uint64_t>> split(5);
    for (int i = 0; i < 6; ++i) {
      const int level = 1 + static_cast<int>(random.below(4));
      const int edge = 32 >> level;
      const auto at = [&] { return static_cast<int>(random.below(static_cast<std::uint32_t>(edge))); };
      const int x = at(), y = at(), z = at();
      split[static_cast<std::size_t>(level)].push_back(key(x, y, z));
    }
    const LevelTree tree(5, split);
    for (int i = 0; i < 300; ++i) {
      const auto at = [&] { return static_cast<int>(random.below(32)); };
      const Int3 brick = {at(), at(), at()};
      const int level = tree.level_of(brick);
      const Int3 leaf = {brick[0] >> level, brick[1] >> level, brick[2] >> level};
      const auto steps = tree.steps_around(leaf, level);
      for (int d = 0; d < 27; ++d) {
        const Int3 n = {leaf[0] + d % 3 - 1, leaf[1] + d / 3 % 3 - 1, leaf[2] + d / 9 - 1};
        if (d == 13 || n[0] < 0 || n[1] < 0 || n[2] < 0) continue;
        // The brick of the finest level beside the one at the middle of this side.
        Int3 across;
        for (std::size_t a = 0; a < 3; ++a) {
          const int step = n[a] - leaf[a];
          across[a] = step < 0 ? (leaf[a] << level) - 1 : step > 0 ? (leaf[a] + 1) << level : brick[a];
        }
        const int other = tree.level_of(across);
        CHECK(std::abs(other - level) <= 1);
        CHECK(other - level == steps[static_cast<std::size_t>(d)]);
      }
    }
  }
}

}  // namespace level_tree_test
