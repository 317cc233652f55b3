// What a block decides of its patches by itself, and that the graph of anchors it leaves is the whole one, contracted.
#include <catch2/catch.hpp>

#include <algorithm>
#include <numeric>

#include "kernels/points/block_signs.h"
#include "tests/helpers/random.h"

namespace block_signs_test {

using namespace tessera;

namespace {

/// Every patch a group of its own.
PatchGroups single(std::size_t patches) {
  PatchGroups g;
  g.of.resize(patches);
  std::iota(g.of.begin(), g.of.end(), 0u);
  g.sign.assign(patches, 1);
  g.size.assign(patches, 10);
  return g;
}

constexpr std::int64_t kLink = 100, kSide = 60;

/// A strip of patches turned at random, each linked to the next two; some know their side, some links and sides lie.
struct Strip {
  std::vector<std::int8_t> truth;
  std::vector<PatchVote> links, sides;

  Strip(std::size_t patches, double lies, std::uint64_t seed) {
    test::Random random(seed);
    for (std::size_t p = 0; p < patches; ++p)
      truth.push_back(static_cast<std::int8_t>(random.in(0.0, 1.0) < 0.5 ? -1 : 1));
    for (std::uint32_t a = 0; a < patches; ++a) {
      for (std::uint32_t b = a + 1; b < std::min<std::size_t>(a + 3, patches); ++b) {
        const bool same = (truth[a] == truth[b]) != (random.in(0.0, 1.0) < lies);
        const auto vote = static_cast<std::int64_t>(random.in(0.5, 1.0) * kLink);
        links.push_back({a, b, same ? vote : 0, same ? 0 : vote});
      }
      if (a % 4 != 0) continue;
      const bool front = (truth[a] > 0) != (random.in(0.0, 1.0) < lies);
      sides.push_back({a, 0, front ? kSide : 0, front ? 0 : kSide});
    }
  }

  /// Votes that these signs break.
  std::int64_t broken(const std::vector<std::int8_t>& sign) const {
    std::int64_t sum = 0;
    for (const PatchVote& v : links) sum += sign[v.a] == sign[v.b] ? v.opposite : v.same;
    for (const PatchVote& v : sides) sum += sign[v.a] > 0 ? v.opposite : v.same;
    return sum;
  }
};

/// The signs of a strip cut into blocks, by their anchors. \returns per patch
std::vector<std::int8_t> solve_in_blocks(const Strip& strip, std::uint32_t width) {
  const auto patches = static_cast<std::uint32_t>(strip.truth.size());
  std::vector<PatchVote> votes;
  std::vector<std::uint64_t> weight;
  std::vector<PatchAnchor> all(patches);  // anchors numbered over all blocks
  for (std::uint32_t first = 0; first < patches; first += width) {
    const std::uint32_t size = std::min(width, patches - first);
    SignBlock block{single(size), {}, {}, std::vector<std::uint8_t>(size, 0)};
    for (const PatchVote& v : strip.links) {
      const bool a = v.a >= first && v.a < first + size, b = v.b >= first && v.b < first + size;
      if (a && b) block.links.push_back({v.a - first, v.b - first, v.same, v.opposite});
      if (a != b) block.border[(a ? v.a : v.b) - first] = 1;
    }
    for (const PatchVote& v : strip.sides)
      if (v.a >= first && v.a < first + size) block.sides.push_back({v.a - first, 0, v.same, v.opposite});
    const BlockSigns signs = solve_block_signs(block);
    const auto zero = static_cast<std::uint32_t>(weight.size());
    const auto node = [&](std::uint32_t anchor) {
      return anchor == PatchAnchor::kOutside ? anchor : zero + anchor;
    };
    weight.insert(weight.end(), signs.weight.begin(), signs.weight.end());
    for (const auto* list : {&signs.links, &signs.sides})
      for (const PatchVote& v : *list) votes.push_back({node(v.a), node(v.b), v.same, v.opposite});
    for (std::uint32_t p = 0; p < size; ++p) {
      all[first + p] = signs.patches[p];
      all[first + p].anchor = node(signs.patches[p].anchor);
    }
  }
  const auto outside = static_cast<std::uint32_t>(weight.size());
  weight.push_back(std::uint64_t{1} << 60);
  for (const PatchVote& v : strip.links) {
    if (v.a / width == v.b / width) continue;
    const PatchAnchor &a = all[v.a], &b = all[v.b];
    const bool keep = a.sign * b.sign > 0;
    votes.push_back({a.anchor, b.anchor, keep ? v.same : v.opposite, keep ? v.opposite : v.same});
  }
  for (PatchVote& v : votes) {
    if (v.b == PatchAnchor::kOutside) v.b = outside;
    if (v.a > v.b) std::swap(v.a, v.b);
  }
  merge_votes(votes);
  const SignSolution solution = solve_signs(weight, votes);
  std::vector<std::int8_t> sign;
  for (const PatchAnchor& a : all)
    sign.push_back(
        static_cast<std::int8_t>(a.sign * (a.anchor == PatchAnchor::kOutside ? 1 : solution.sign[a.anchor])));
  return sign;
}

}  // namespace

TEST_CASE("block signs: patches hang on anchors, on their known side, or on nothing", "[unit]") {
  // 0 is linked to another block, 1 hangs on it the other way round; 2 knows its side, 3 hangs on it; 4 and 5 know nothing.
  SignBlock block{single(6),
                  {{0, 1, 0, kLink}, {2, 3, kLink, 0}, {4, 5, 0, kLink}},
                  {{2, 0, 0, kSide}},
                  {1, 0, 0, 0, 0, 0}};
  const BlockSigns signs = solve_block_signs(block);
  const std::vector<PatchAnchor>& p = signs.patches;
  CHECK(p[0].anchor == 0);
  CHECK(p[0].sign == 1);
  CHECK(p[1].anchor == 0);
  CHECK(p[1].sign == -1);
  CHECK(signs.weight == std::vector<std::uint64_t>{20});
  CHECK(p[2].anchor == PatchAnchor::kOutside);
  CHECK(p[2].sign == -1);
  CHECK(p[2].shown == -1);
  CHECK(p[3].anchor == PatchAnchor::kOutside);
  CHECK(p[3].sign == -1);
  CHECK(p[3].shown == 0);
  CHECK(p[4].anchor == (PatchAnchor::kLoose | 4));
  CHECK(p[5].anchor == (PatchAnchor::kLoose | 4));
  CHECK(p[4].sign == -p[5].sign);
  CHECK(signs.inner_votes == 3 * kLink);
  CHECK(signs.broken_votes == 0);
  CHECK(signs.links.empty());
}

TEST_CASE("block signs: what hangs on an anchor hands its votes on", "[unit]") {
  // 1 and 2 hang on the anchors 0 and 3 and are linked weakly; 1 knows its side, less surely than it hangs on 0.
  SignBlock block{single(4),
                  {{0, 1, 0, 5 * kLink}, {1, 2, kLink, 0}, {2, 3, 5 * kLink, 0}},
                  {{1, 0, kSide, 0}},
                  {1, 0, 0, 1}};
  block.groups.size = {50, 10, 10, 50};
  const BlockSigns signs = solve_block_signs(block);
  REQUIRE(signs.weight.size() == 2);
  REQUIRE(signs.links.size() == 1);
  CHECK(signs.links[0].same == 0);
  CHECK(signs.links[0].opposite == kLink);  // 1 is turned against its anchor
  REQUIRE(signs.sides.size() == 1);
  CHECK(signs.sides[0].a == 0);
  CHECK(signs.sides[0].b == PatchAnchor::kOutside);
  CHECK(signs.sides[0].opposite == kSide);
}

TEST_CASE("block signs: groups that see each other hang together, and hand on what they see", "[unit]") {
  // 0 and 2 are anchors; 1 hangs on 0 by sight alone, and sees 2 less often.
  SignBlock block{single(3), {}, {}, {1, 0, 1}, {{0, 1, 0, 3 * kLink}, {1, 2, kLink, 0}}};
  const BlockSigns signs = solve_block_signs(block);
  CHECK(signs.patches[1].anchor == 0);
  CHECK(signs.patches[1].sign == -1);
  CHECK(signs.links.empty());  // no link of patches: none to be broken
  CHECK(signs.inner_votes == 0);
  REQUIRE(signs.sides.size() == 1);
  CHECK(signs.sides[0].a == 0);
  CHECK(signs.sides[0].b == 1);
  CHECK(signs.sides[0].opposite == kLink);
}

TEST_CASE("block signs: patches of a group take its sign, in their own", "[unit]") {
  SignBlock block{single(2), {{0, 1, 0, kLink}}, {{0, 0, kSide, 0}}, {0, 0}};
  block.groups = {{0, 0}, {1, -1}, {20}};
  const BlockSigns signs = solve_block_signs(block);
  CHECK(signs.patches[0].sign == 1);
  CHECK(signs.patches[0].shown == 1);
  CHECK(signs.patches[1].sign == -1);
  CHECK(signs.patches[1].shown == -1);
}

TEST_CASE("block signs: doubt is settled by what looks and then links speak for, and no sign is turned",
          "[unit]") {
  // Group 0 looks clearly and is linked to group 1 against its sign, to group 2 with it; 3 hangs on 2; 4 looks too little;
  // looks speak against 5.
  PatchGroups groups = single(7);
  groups.of = {0, 0, 1, 2, 3, 4, 5}, groups.sign = {1, -1, 1, 1, 1, 1, 1};
  groups.size = {20, 10, 10, 10, 10, 10};
  const std::vector<PatchVote> links = {{1, 2, kLink, 0}, {1, 3, 0, kLink}, {3, 4, kLink / 2, 0}};
  const std::vector<std::int8_t> sign = {1, -1, 1, 1, 1, 1, 1};
  const std::vector<float> lean = {0.3f, 0.3f, 0.0f, 0.0f, 0.0f, 0.2f, -0.9f};
  std::vector<std::uint8_t> doubtful(7, 1);
  settle_doubt(groups, links, sign, lean, doubtful);
  CHECK(doubtful == std::vector<std::uint8_t>{0, 0, 1, 0, 0, 1, 1});
}

TEST_CASE("block signs: a strip has the same signs in one block and in many", "[unit]") {
  const std::uint64_t seed = GENERATE(range(1, 9));
  CAPTURE(seed);
  const Strip clean(400, 0.0, seed);
  for (const std::uint32_t width : {400u, 100u, 23u, 3u}) CHECK(solve_in_blocks(clean, width) == clean.truth);
  const Strip noisy(400, 0.1, seed);
  // Where votes contradict each other, blocks may settle on other signs: they break hardly more of them.
  const std::int64_t whole = noisy.broken(solve_in_blocks(noisy, 400));
  for (const std::uint32_t width : {100u, 23u})
    CHECK(noisy.broken(solve_in_blocks(noisy, width)) <= whole * 5 / 4);
}

}  // namespace block_signs_test
