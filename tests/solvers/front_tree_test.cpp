// Orders, elimination trees and supernodes against CHOLMOD's analysis, entry by entry.
#include "solvers/front_tree.h"

#include <catch2/catch.hpp>

#include <algorithm>
#include <cstdint>
#include <span>
#include <vector>

#include "tests/helpers/cholmod_view.h"
#include "tests/helpers/random.h"

namespace front_tree_test {

namespace {

using namespace tessera;

using Row = std::vector<std::int32_t>;

/// The pattern of a sheet of squares cut into triangles, numbered at random; some edges are left out, which leaves pieces.
SparseMatrix sheet(std::int32_t width, std::int32_t height, bool second_ring,
                   std::uint64_t dropped_of_eight) {
  test::Random random(static_cast<std::uint64_t>(width * 31 + height));
  const auto n = static_cast<std::size_t>(width * height);
  Row number(n);
  for (std::size_t i = 0; i < n; ++i) number[i] = static_cast<std::int32_t>(i);
  for (std::size_t i = n; i > 1; --i) std::swap(number[i - 1], number[random.below(i)]);
  std::vector<Row> rows(n);
  for (std::size_t i = 0; i < n; ++i) rows[i].push_back(static_cast<std::int32_t>(i));
  const auto link = [&](std::int32_t x, std::int32_t y, std::int32_t to_x, std::int32_t to_y) {
    if (to_x >= width || to_y >= height || random.below(8) < dropped_of_eight) return;
    const std::int32_t a = number[static_cast<std::size_t>(y * width + x)];
    const std::int32_t b = number[static_cast<std::size_t>(to_y * width + to_x)];
    rows[static_cast<std::size_t>(a)].push_back(b);
    rows[static_cast<std::size_t>(b)].push_back(a);
  };
  for (std::int32_t y = 0; y < height; ++y)
    for (std::int32_t x = 0; x < width; ++x) {
      for (const auto& [dx, dy] : {std::pair{1, 0}, {0, 1}, {1, 1}}) link(x, y, x + dx, y + dy);
      if (second_ring)
        for (const auto& [dx, dy] : {std::pair{2, 0}, {0, 2}, {2, 1}, {1, 2}}) link(x, y, x + dx, y + dy);
    }
  SparseMatrix a;
  a.rows = a.columns = static_cast<std::int32_t>(n);
  a.start.push_back(0);
  for (Row& row : rows) {
    std::sort(row.begin(), row.end());
    a.column.insert(a.column.end(), row.begin(), row.end());
    a.start.push_back(static_cast<std::int32_t>(a.column.size()));
  }
  a.value.assign(a.column.size(), 1.0);
  return a;
}

}  // namespace

TEST_CASE("fronts: order, supernodes and rows are those of CHOLMOD", "[unit]") {
  const SparseMatrix a =
      GENERATE(sheet(1, 1, false, 0), sheet(3, 3, false, 0), sheet(5, 4, false, 8), sheet(40, 30, true, 1),
               sheet(30, 40, false, 4), sheet(90, 80, false, 5), sheet(120, 100, true, 0));
  const Ordering ordering = GENERATE(Ordering::kMinimumDegree, Ordering::kNestedDissection);
  CAPTURE(a.rows, a.entries(), name(ordering));
  const FrontTree tree(a, ordering);
  cholmod_common common;
  cholmod_start(&common);
  common.print = 0;
  common.supernodal = CHOLMOD_SUPERNODAL;
  common.nmethods = 1;
  common.postorder = 1;
  common.method[0].ordering = ordering == Ordering::kNestedDissection ? CHOLMOD_METIS : CHOLMOD_AMD;
  cholmod_sparse view = test::cholmod_view(a);
  cholmod_factor* factor = cholmod_analyze(&view, &common);
  REQUIRE(factor != nullptr);
  REQUIRE(factor->nsuper == tree.count());
  const auto* order = static_cast<const std::int32_t*>(factor->Perm);
  const auto* super = static_cast<const std::int32_t*>(factor->super);
  const auto* start = static_cast<const std::int32_t*>(factor->pi);
  const auto* rows = static_cast<const std::int32_t*>(factor->s);
  std::size_t other_unknowns = 0, other_fronts = 0;
  for (std::int32_t i = 0; i < a.rows; ++i) other_unknowns += order[i] != tree.unknown(i);
  for (std::size_t k = 0; k < tree.count(); ++k) {
    const std::span<const std::int32_t> ours = tree.rows(k);
    other_fronts += static_cast<std::size_t>(super[k + 1] - super[k]) != tree.eliminated(k) ||
                    !std::equal(ours.begin(), ours.end(), rows + start[k], rows + start[k + 1]);
  }
  CHECK(other_unknowns == 0);
  CHECK(other_fronts == 0);
  CHECK(tree.flops() == common.fl);
  cholmod_free_factor(&factor, &common);
  cholmod_finish(&common);
}

}  // namespace front_tree_test
