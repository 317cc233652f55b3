// Groups of patches, and those that leave them.
#include <catch2/catch.hpp>

#include "kernels/points/patch_groups.h"

namespace patch_groups_test {

using namespace tessera;

namespace {

const std::vector<std::uint64_t> kWeight = {100, 40, 30, 5};
/// 0 and 1 face alike, 2 the other way; 3 hangs on nothing.
const std::vector<PatchVote> kLinks = {{0, 1, 50, 0}, {1, 2, 0, 50}};
constexpr ContractionLimits kLimits = {10.0, 0.8};
constexpr double kClear = 0.75;

}  // namespace

TEST_CASE("patch groups: clear links join, with their signs", "[unit]") {
  const PatchGroups g = group_patches(kWeight, kLinks, kLimits);
  REQUIRE(g.count() == 2);
  CHECK(g.of[0] == g.of[1]);
  CHECK(g.of[1] == g.of[2]);
  CHECK(g.of[3] != g.of[0]);
  CHECK(g.sign[0] == g.sign[1]);
  CHECK(g.sign[0] == -g.sign[2]);
  CHECK(g.size[g.of[0]] == 170);
  CHECK(g.size[g.of[3]] == 5);
}

TEST_CASE("patch groups: who clearly shows another side than the group leaves it", "[unit]") {
  const PatchGroups before = group_patches(kWeight, kLinks, kLimits);
  PatchGroups g = before;
  tear_groups(std::vector<PatchVote>{{0, 4, 90, 2}, {1, 4, 1, 39}, {2, 4, 10, 20}}, kWeight, kClear, g);
  CHECK(g.count() == 3);
  CHECK(g.of[1] == 2);
  CHECK(g.of[2] == g.of[0]);  // not clear enough
  CHECK(g.sign == before.sign);
  CHECK(g.size[g.of[0]] == 130);
  CHECK(g.size[2] == 40);
  PatchGroups agreed = before;
  tear_groups(std::vector<PatchVote>{{0, 4, 2, 90}, {1, 4, 1, 39}, {2, 4, 3, 20}}, kWeight, kClear, agreed);
  CHECK(agreed.of == before.of);
}

}  // namespace patch_groups_test
