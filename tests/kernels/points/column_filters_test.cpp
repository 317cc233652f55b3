// Filters over squares of columns against what they say, column by column.
#include <algorithm>
#include <catch2/catch.hpp>
#include <cstdlib>

#include "kernels/points/column_filters.h"
#include "tests/helpers/random.h"

namespace column_filters_test {

using namespace tessera;

namespace {

constexpr ColumnSquare kSquare{17};

/// Calls use for the columns within `radius` of one.
template <class Use>
void around(int u, int v, int radius, const Use& use) {
  for (int y = std::max(0, v - radius); y <= std::min(kSquare.edge - 1, v + radius); ++y)
    for (int x = std::max(0, u - radius); x <= std::min(kSquare.edge - 1, u + radius); ++x)
      use(kSquare.at(x, y));
}

}  // namespace

TEST_CASE("column filters: sums, dilation, erosion and medians are those of the columns around", "[unit]") {
  test::Random random(4);
  const std::size_t n = kSquare.at(0, kSquare.edge);
  std::vector<std::int64_t> values(n);
  std::vector<std::uint8_t> mask(n);
  std::vector<std::int32_t> height(n);
  for (std::size_t i = 0; i < n; ++i) {
    values[i] = static_cast<std::int64_t>(random.in(-100, 100));
    mask[i] = random.unit() < 0.2;
    height[i] = random.unit() < 0.3 ? kNoHeight : static_cast<std::int32_t>(random.in(-100, 100));
  }
  for (const int radius : {1, 3, 20}) {
    const auto sums = box_sums(kSquare, values, radius);
    const auto more = dilate(kSquare, mask, radius), less = erode(kSquare, mask, radius);
    for (int v = 0; v < kSquare.edge; ++v)
      for (int u = 0; u < kSquare.edge; ++u) {
        std::int64_t sum = 0;
        bool any = false, all = true;
        around(u, v, radius, [&](std::size_t i) {
          sum += values[i];
          any = any || mask[i] != 0, all = all && mask[i] != 0;
        });
        CHECK(sums[kSquare.at(u, v)] == sum);
        CHECK((more[kSquare.at(u, v)] != 0) == any);
        CHECK((less[kSquare.at(u, v)] != 0) == all);
      }
  }
  const auto medians = median5(kSquare, height, mask);
  for (int v = 0; v < kSquare.edge; ++v)
    for (int u = 0; u < kSquare.edge; ++u) {
      const std::size_t at = kSquare.at(u, v);
      if (mask[at] == 0 || height[at] == kNoHeight) {
        CHECK(medians[at] == height[at]);
        continue;
      }
      std::vector<std::int32_t> near;
      around(u, v, 2, [&](std::size_t i) {
        if (height[i] != kNoHeight) near.push_back(height[i]);
      });
      std::sort(near.begin(), near.end());
      CHECK(medians[at] == near[(near.size() - 1) / 2]);
    }
}

TEST_CASE(
    "column filters: a round dilation of one column is nearly a disk, and an erosion is that of what is left "
    "out",
    "[unit]") {
  const ColumnSquare square{41};
  const auto count = square.at(0, square.edge);
  std::vector<std::uint8_t> mask(count), inverse(count, 1);
  mask[square.at(20, 20)] = 1, inverse[square.at(20, 20)] = 0;
  for (const int radius : {1, 2, 5, 10, 15}) {
    const auto more = dilate_round(square, mask, radius);
    const auto less = dilate_round(square, inverse, radius, false);
    for (int v = 0; v < square.edge; ++v)
      for (int u = 0; u < square.edge; ++u) {
        const int across = (u - 20) * (u - 20) + (v - 20) * (v - 20);
        const std::size_t i = square.at(u, v);
        CAPTURE(radius, u, v);
        // An octagon lies between disks of 0.92 and 1.09 of its radius; columns are whole.
        if (across * 100 <= (9 * radius - 5) * (9 * radius - 5)) CHECK(more[i] == 1);
        if (across * 100 > (11 * radius + 5) * (11 * radius + 5)) CHECK(more[i] == 0);
        CHECK(less[i] == 1 - more[i]);
      }
    CHECK(more[square.at(20 + radius, 20)] == 1);
    CHECK(more[square.at(20, 20 - radius)] == 1);
  }
  // At the rim the columns that are there.
  std::vector<std::uint8_t> corner(count);
  corner[0] = 1;
  CHECK(dilate_round(square, corner, 10)[square.at(0, 10)] == 1);
  CHECK(dilate_round(square, corner, 10)[square.at(0, 11)] == 0);
}

TEST_CASE("column filters: medians and extremes of few and of many heights, beyond a register's width",
          "[unit]") {
  for (const int edge : {3, 16, 53}) {
    const ColumnSquare square{edge};
    const auto n = square.at(0, edge);
    for (const double missing : {0.0, 0.1, 0.6, 0.97}) {
      test::Random random(static_cast<std::uint64_t>(edge));
      std::vector<std::int32_t> height(n);
      std::vector<std::uint8_t> wanted(n);
      for (std::size_t i = 0; i < n; ++i) {
        height[i] = random.unit() < missing ? kNoHeight : static_cast<std::int32_t>(random.in(-2e9, 2e9));
        wanted[i] = random.unit() < 0.5;
      }
      const auto medians = median5(square, height, wanted);
      for (const int radius : {0, 1, 2, 4, 9, 60}) {
        const auto low = extreme_around(square, height, wanted, radius, false);
        const auto high = extreme_around(square, height, wanted, radius, true);
        for (int v = 0; v < edge; ++v)
          for (int u = 0; u < edge; ++u) {
            std::vector<std::int32_t> near;
            for (int y = std::max(0, v - radius); y <= std::min(edge - 1, v + radius); ++y)
              for (int x = std::max(0, u - radius); x <= std::min(edge - 1, u + radius); ++x)
                if (height[square.at(x, y)] != kNoHeight) near.push_back(height[square.at(x, y)]);
            std::sort(near.begin(), near.end());
            const std::size_t at = square.at(u, v);
            const bool some = wanted[at] != 0 && !near.empty();
            CAPTURE(edge, missing, radius, u, v);
            REQUIRE(low[at] == (some ? near.front() : kNoHeight));
            REQUIRE(high[at] == (some ? near.back() : kNoHeight));
            if (radius != 2) continue;
            const bool median = wanted[at] != 0 && height[at] != kNoHeight;
            REQUIRE(medians[at] == (median ? near[(near.size() - 1) / 2] : height[at]));
          }
      }
    }
  }
}

}  // namespace column_filters_test
