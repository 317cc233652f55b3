// Vertices that were moved and made faces cross go back, and nothing else.
#include "kernels/mesh/uncross_block.h"

#include <catch2/catch.hpp>

#include <cmath>

#include "kernels/mesh/mesh_block_ops.h"
#include "tests/helpers/block_meshes.h"

namespace uncross_block_test {

using namespace tessera;
using namespace tessera::test;

namespace {

constexpr std::uint32_t kRow = 13;

/// Two level sheets, half a cell apart; vertices of the lower one that were pulled through the upper one, or sideways.
struct Sheets {
  MeshBlock block;
  std::vector<SafePlace> safe;
};
std::uint32_t vertex(int i, int j) {
  return static_cast<std::uint32_t>(j) * kRow + static_cast<std::uint32_t>(i);
}
Sheets pulled(const std::vector<std::pair<std::uint32_t, Double3>>& moves) {
  std::vector<Double3> position;
  std::vector<std::array<std::uint32_t, 3>> faces;
  for (int s = 0; s < 2; ++s)
    for (int j = 0; j < int{kRow}; ++j)
      for (int i = 0; i < int{kRow}; ++i) position.push_back({i + 0.25 * s, j + 0.125 * s, 0.5 * s});
  for (std::uint32_t s = 0; s < 2; ++s)
    for (int j = 0; j + 1 < int{kRow}; ++j)
      for (int i = 0; i + 1 < int{kRow}; ++i) {
        const std::uint32_t first = s * kRow * kRow;
        faces.push_back({first + vertex(i, j), first + vertex(i + 1, j), first + vertex(i + 1, j + 1)});
        faces.push_back({first + vertex(i, j), first + vertex(i + 1, j + 1), first + vertex(i, j + 1)});
      }
  Sheets sheets;
  sheets.block = make_block(position, faces);
  for (const auto& [v, by] : moves) {
    sheets.safe.push_back({sheets.block.key[v], sheets.block.position[v]});
    sheets.block.position[v] = sheets.block.position[v] + by;
  }
  return sheets;
}

}  // namespace

TEST_CASE("uncross block: what crosses goes back, other moved vertices stay", "[unit]") {
  Sheets sheets = pulled({{vertex(3, 3), {0, 0, 0.9}}, {vertex(8, 8), {0.3, 0.2, 0.1}}});
  const MeshBlock before = sheets.block;
  const Uncrossed result = uncross_block(sheets.block, sheets.safe, complete_stars(sheets.block), 1.0);
  CHECK(result.pairs > 0);
  REQUIRE(result.returned.size() == 1);
  CHECK(result.returned[0].key == before.key[vertex(3, 3)]);
  for (std::uint32_t v = 0; v < before.key.size(); ++v)
    CHECK(sheets.block.position[v] == (v == vertex(3, 3) ? Double3{3, 3, 0} : before.position[v]));
  CHECK(sheets.block.faces == before.faces);
  // Now there is nothing to mend.
  CHECK(uncross_block(sheets.block, sheets.safe, complete_stars(sheets.block), 1.0).pairs == 0);
}

TEST_CASE("uncross block: one that goes back may make another cross, which follows", "[unit]") {
  // Both fold over: once the first is back, the second lies beyond it.
  Sheets sheets = pulled({{vertex(5, 5), {1.6, 0, 0}}, {vertex(6, 5), {1.6, 0, 0}}});
  const Uncrossed result = uncross_block(sheets.block, sheets.safe, complete_stars(sheets.block), 1.0);
  CHECK(result.pairs > 0);
  CHECK(result.returned.size() == 2);
  CHECK(sheets.block.position[vertex(6, 5)] == Double3{6, 5, 0});
}

TEST_CASE("uncross block: a vertex whose faces lie in another block too stays", "[unit]") {
  Sheets sheets = pulled({{vertex(0, 4), {0, 0, 0.9}}, {vertex(4, 4), {0, 0, 0.9}}});
  std::vector<std::uint8_t> complete = complete_stars(sheets.block);
  complete[vertex(0, 4)] = 0;
  const Uncrossed result = uncross_block(sheets.block, sheets.safe, complete, 1.0);
  REQUIRE(result.returned.size() == 1);
  CHECK(result.returned[0].key == sheets.block.key[vertex(4, 4)]);
  CHECK(sheets.block.position[vertex(0, 4)] == Double3{0, 4, 0.9});
}

TEST_CASE("uncross block: in metres at survey coordinates as in cells", "[unit]") {
  Sheets sheets = pulled({{vertex(3, 3), {0, 0, 0.9}}});
  for (Double3& p : sheets.block.position) p = p * 0.25 + Double3{500000, 5400000, 300};
  for (SafePlace& s : sheets.safe) s.at = s.at * 0.25 + Double3{500000, 5400000, 300};
  const Uncrossed result = uncross_block(sheets.block, sheets.safe, complete_stars(sheets.block), 0.25);
  CHECK(result.returned.size() == 1);
  CHECK(sheets.block.position[vertex(3, 3)] == sheets.safe[0].at);
}

TEST_CASE("uncross block: vertices are taken back by their keys, those of other blocks count for nothing",
          "[unit]") {
  Sheets sheets = pulled({{vertex(3, 3), {0, 0, 0.9}}, {vertex(8, 8), {0.3, 0.2, 0.1}}});
  const MeshBlock before = sheets.block;
  const std::uint64_t last = before.key.back();
  take_back(sheets.block, std::vector<SafePlace>{sheets.safe[1], {last + 1, {7, 7, 7}}});
  for (std::uint32_t v = 0; v < before.key.size(); ++v)
    CHECK(sheets.block.position[v] == (v == vertex(8, 8) ? Double3{8, 8, 0} : before.position[v]));
}

}  // namespace uncross_block_test
