// COPC: every point is in one node, in its cube, no nearer to others of its level than a cell but in leaves.
#include <catch2/catch.hpp>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <map>
#include <set>
#include <string>
#include <tuple>
#include <vector>

#include "octree/error.h"
#include "stream/formats/copc/copc_nodes.h"
#include "tests/helpers/node_points.h"
#include "tests/helpers/temp_folder.h"

namespace tessera::copc_nodes_test {
namespace {

constexpr std::size_t kBytes = 30;
std::string records_of(const std::vector<test::Steps>& points) {
  std::string all(points.size() * kBytes, '\0');
  for (std::size_t i = 0; i < points.size(); ++i) {
    std::memcpy(all.data() + i * kBytes, points[i].data(), 12);
    all[i * kBytes + 16] = static_cast<char>(points[i][0] & 31);
  }
  return all;
}

std::vector<test::Steps> steps_of(const std::string& records) {
  std::vector<test::Steps> points(records.size() / kBytes);
  for (std::size_t i = 0; i < points.size(); ++i)
    std::memcpy(points[i].data(), records.data() + i * kBytes, 12);
  return points;
}

const Double3 kScale = {0.01, 0.01, 0.01}, kOffset = {7e5, 5e6, 100};

using Name = std::tuple<int, int, int, int>;
Name name_of(const CopcNode& n) {
  return {n.level, n.at[0], n.at[1], n.at[2]};
}

}  // namespace

TEST_CASE("copc nodes: all points once, in their cubes, a cell apart above the leaves", "[property]") {
  const test::TempFolder folder;
  const std::vector<test::Steps> points = test::node_points(400'000);
  CopcNodes nodes(folder.path(), kBytes, std::uint64_t{4} << 20);  // small: sorted on disk
  const std::string records = records_of(points);
  for (std::size_t at = 0; at < records.size(); at += 70'001 * kBytes)
    nodes.add(std::string_view(records).substr(at, 70'001 * kBytes));
  nodes.build(kScale, kOffset, "a.copc.laz");
  std::multiset<test::Steps> left(points.begin(), points.end());
  std::map<Name, const CopcNode*> by_name;
  for (const CopcNode& n : nodes.nodes()) by_name[name_of(n)] = &n;
  CHECK(by_name.size() == nodes.nodes().size());
  std::set<Name> inner;  // those with children
  for (const auto& [name, node] : by_name) {
    if (node->level == 0) continue;
    const Name parent = {node->level - 1, node->at[0] / 2, node->at[1] / 2, node->at[2] / 2};
    CHECK(by_name.count(parent) == 1);
    inner.insert(parent);
  }
  bool inside = true, apart = true, ordered = true;
  std::size_t deepest = 0;
  for (const CopcNode& n : nodes.nodes()) {
    const std::vector<test::Steps> own = steps_of(nodes.records(n));
    REQUIRE(own.size() == n.points);
    REQUIRE(!own.empty());
    deepest = std::max(deepest, static_cast<std::size_t>(n.level));
    const double edge = std::ldexp(nodes.cube().edge, -n.level);
    const bool is_leaf = inner.count(name_of(n)) == 0 && n.points <= CopcNodes::kLeafPoints;
    std::set<test::Steps> cells;
    for (const test::Steps& p : own) {
      const auto at = left.find(p);
      REQUIRE(at != left.end());
      left.erase(at);
      test::Steps cell;
      for (std::size_t a = 0; a < 3; ++a) {
        const double from = p[a] * kScale[a] + kOffset[a] - nodes.cube().min[a] - n.at[a] * edge;
        inside = inside && from > -1e-6 && from < edge + 1e-6;
        cell[a] = static_cast<std::int32_t>(std::floor(from / edge * 128 + 1e-7));
      }
      apart = apart && (is_leaf || cells.insert(cell).second);
    }
  }
  for (std::size_t i = 1; i < nodes.nodes().size(); ++i)
    ordered = ordered && nodes.nodes()[i - 1].level <= nodes.nodes()[i].level;
  CHECK(left.empty());
  CHECK(inside);
  CHECK(apart);
  CHECK(ordered);
  CHECK(deepest >= 5);

  SECTION("in any order of the points the nodes are the same") {
    std::vector<test::Steps> turned(points.rbegin(), points.rend());
    CopcNodes others(folder.path(), kBytes, std::uint64_t{256} << 20);
    others.add(records_of(turned));
    others.build(kScale, kOffset, "a.copc.laz");
    REQUIRE(others.nodes().size() == nodes.nodes().size());
    bool same = true;
    for (std::size_t i = 0; i < nodes.nodes().size(); ++i)
      same = same && name_of(nodes.nodes()[i]) == name_of(others.nodes()[i]) &&
             nodes.records(nodes.nodes()[i]) == others.records(others.nodes()[i]);
    CHECK(same);
  }

  SECTION("pages lead to every node, in one page or many") {
    std::vector<CopcChunkAt> chunks;
    for (std::size_t i = 0; i < nodes.nodes().size(); ++i)
      chunks.push_back({1000 + 10 * i, static_cast<std::int32_t>(i + 1)});
    for (const std::size_t single : {std::size_t{1}, std::size_t{100'000}}) {
      const CopcPages pages = copc_pages(nodes.nodes(), chunks, 5000, single);
      std::map<Name, std::array<std::uint64_t, 3>> found;
      std::vector<std::pair<std::uint64_t, std::uint64_t>> open = {{5000, pages.root_bytes}};
      std::size_t read = 0;
      while (!open.empty()) {
        const auto [at, bytes] = open.back();
        open.pop_back(), ++read;
        REQUIRE(at + bytes - 5000 <= pages.bytes.size());
        for (std::uint64_t e = 0; e < bytes; e += 32) {
          std::int32_t head[4], size = 0, count = 0;
          std::uint64_t offset = 0;
          const char* const p = pages.bytes.data() + (at - 5000) + e;
          std::memcpy(head, p, 16), std::memcpy(&offset, p + 16, 8), std::memcpy(&size, p + 24, 4),
              std::memcpy(&count, p + 28, 4);
          if (count == -1)
            open.push_back({offset, static_cast<std::uint64_t>(size)});
          else
            CHECK(found
                      .emplace(Name{head[0], head[1], head[2], head[3]},
                               std::array<std::uint64_t, 3>{offset, static_cast<std::uint64_t>(size),
                                                            static_cast<std::uint64_t>(count)})
                      .second);
        }
      }
      CHECK((read > 1) == (single == 1));
      REQUIRE(found.size() == nodes.nodes().size());
      bool same = true;
      for (std::size_t i = 0; i < nodes.nodes().size(); ++i)
        same = same &&
               found.at(name_of(nodes.nodes()[i])) ==
                   std::array<std::uint64_t, 3>{chunks[i].offset, static_cast<std::uint64_t>(chunks[i].bytes),
                                                nodes.nodes()[i].points};
      CHECK(same);
    }
  }
}

TEST_CASE("copc nodes: one point, and many at one place", "[unit]") {
  const test::TempFolder folder;
  CopcNodes one(folder.path(), kBytes, 1u << 20);
  one.add(records_of({{5, 6, 7}}));
  one.build(kScale, kOffset, "a");
  REQUIRE(one.nodes().size() == 1);
  CHECK(one.nodes()[0].level == 0);
  CHECK(one.cube().edge == Approx(0.01));
  CopcNodes many(folder.path(), kBytes, 1u << 20);
  std::vector<test::Steps> pile(50'000, {1, 2, 3});
  pile.push_back({1'000'000, 0, 0});
  many.add(records_of(pile));
  many.build(kScale, kOffset, "a");
  std::uint64_t sum = 0;
  for (const CopcNode& n : many.nodes()) sum += n.points;
  CHECK(sum == pile.size());
  CHECK_THROWS_AS(CopcNodes(folder.path(), 257, 1u << 20), UsageError);
}

}  // namespace tessera::copc_nodes_test
