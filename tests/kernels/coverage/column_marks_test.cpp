// Columns that points fill and faces cover.
#include <catch2/catch.hpp>
#include <map>
#include <set>
#include <utility>
#include <vector>

#include "kernels/coverage/column_marks.h"
#include "tests/helpers/random.h"

namespace column_marks_test {

using namespace tessera;

namespace {

using Column = std::pair<std::uint32_t, std::uint32_t>;

std::set<Column> columns_of(const std::vector<ColumnMask>& blocks) {
  std::set<Column> out;
  for (const ColumnMask& b : blocks)
    for (std::uint32_t c = 0; c < 64; ++c)
      if ((b.columns >> c & 1u) != 0) out.insert({block_u(b.key) + c % 8, block_v(b.key) + c / 8});
  return out;
}

std::set<Column> covered_by(const std::array<double, 6>& uv) {
  ColumnCover cover;
  std::vector<ColumnMask> blocks;
  const std::array<ColumnCover::Corner, 3> corners = {ColumnCover::corner(uv[0], uv[1]),
                                                      ColumnCover::corner(uv[2], uv[3]),
                                                      ColumnCover::corner(uv[4], uv[5])};
  const std::array<std::array<std::uint32_t, 3>, 1> faces = {{{0, 1, 2}}};
  cover.add(corners, faces, blocks);
  cover.flush(blocks);
  combine_columns(blocks);
  return columns_of(blocks);
}

}  // namespace

TEST_CASE("column marks: counts stop at four and add up over any parts", "[unit]") {
  test::Random random(5);
  std::map<Column, std::uint32_t> truth;
  ColumnCounter whole;
  std::vector<ColumnCounter> parts(3);
  std::vector<ColumnCounts> at_once, joined;
  for (int i = 0; i < 4000; ++i) {
    const auto u = static_cast<std::uint32_t>(random.in(0.0, 150.0));
    const auto v = static_cast<std::uint32_t>(random.in(40.0, 60.0));
    ++truth[{u, v}];
    whole.add(u, v, at_once);
    parts[static_cast<std::size_t>(i * 7 % 3)].add(u, v, joined);
  }
  whole.flush(at_once);
  for (ColumnCounter& part : parts) part.flush(joined);
  CHECK(joined.size() > at_once.size() / 2);
  combine_columns(at_once);
  combine_columns(joined);
  CHECK(at_once == joined);
  std::uint64_t enough = 0, wanted = 0;
  for (const auto& [column, points] : truth) wanted += points >= kEnoughInColumn;
  for (const ColumnCounts& b : at_once) {
    enough += static_cast<std::uint64_t>(__builtin_popcountll(b.enough()));
    for (std::uint32_t c = 0; c < 64; ++c) {
      const std::uint32_t held = static_cast<std::uint32_t>(
          (b.plane[0] >> c & 1u) | (b.plane[1] >> c & 1u) << 1 | (b.plane[2] >> c & 1u) << 2);
      const auto found = truth.find({block_u(b.key) + c % 8, block_v(b.key) + c / 8});
      REQUIRE(held == (found == truth.end() ? 0u : std::min(found->second, kEnoughInColumn)));
    }
  }
  CHECK(enough == wanted);
  CHECK(wanted > 0);
  CHECK(wanted < truth.size());
}

TEST_CASE("column marks: a face covers its corners and the middles of columns in it", "[unit]") {
  CHECK(covered_by({3.1, 4.2, 3.9, 4.3, 3.5, 4.9}) == std::set<Column>{{3, 4}});
  // Corners in three columns; the middle of (1, 1) lies in it, that of (2, 2) does not.
  CHECK(covered_by({0.9, 0.9, 3.1, 0.9, 0.9, 3.1}) ==
        std::set<Column>{{0, 0}, {3, 0}, {0, 3}, {1, 1}, {2, 1}, {1, 2}});
  // A wall seen from above has no middles, turned around a face covers the same.
  CHECK(covered_by({0.5, 0.5, 6.5, 0.5, 3.5, 0.5}) == std::set<Column>{{0, 0}, {3, 0}, {6, 0}});
  CHECK(covered_by({0.9, 3.1, 3.1, 0.9, 0.9, 0.9}) == covered_by({0.9, 0.9, 3.1, 0.9, 0.9, 3.1}));
  CHECK(covered_by({-2.5, -2.5, -1.5, -2.5, -2.5, -1.5}).empty());
}

TEST_CASE("column marks: a square of two faces covers every column, blocks far apart too", "[unit]") {
  const auto lower = covered_by({0.5, 0.5, 99.5, 0.5, 99.5, 99.5});
  auto both = covered_by({0.5, 0.5, 99.5, 99.5, 0.5, 99.5});
  CHECK(both.size() < 6000);
  both.insert(lower.begin(), lower.end());
  CHECK(both.size() == 100u * 100u);
}

}  // namespace column_marks_test
