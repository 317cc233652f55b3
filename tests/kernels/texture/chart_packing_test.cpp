#include "kernels/texture/chart_packing.h"

#include <algorithm>
#include <catch2/catch.hpp>
#include <cmath>

#include "octree/portable_math.h"
#include "tests/helpers/block_meshes.h"

namespace chart_packing_test {

using namespace tessera;

namespace {

/// An L, or a disk, of random size.
ChartMask random_mask(std::uint64_t index) {
  ChartMask mask;
  const auto side = [&](std::uint64_t axis) {
    return 3 + static_cast<std::uint32_t>(40 * to_unit(random_bits(7, axis, index)) *
                                          to_unit(random_bits(7, axis + 2, index)));
  };
  mask.width = side(0), mask.height = side(1);
  const std::size_t words = (mask.width + 63) / 64;
  mask.bits.assign(words * mask.height, 0);
  for (std::uint32_t y = 0; y < mask.height; ++y)
    for (std::uint32_t x = 0; x < mask.width; ++x) {
      const double u = 2.0 * (x + 0.5) / mask.width - 1, v = 2.0 * (y + 0.5) / mask.height - 1;
      if (index % 2 == 0 ? u * u + v * v > 1.0 : (u > 0 && v > 0)) continue;
      mask.bits[y * words + x / 64] |= std::uint64_t{1} << (x % 64);
      ++mask.cells;
    }
  return mask;
}

}  // namespace

TEST_CASE("chart packing: nothing overlaps, everything lies on its page, pages are well filled",
          "[property]") {
  std::vector<ChartMask> masks;
  for (std::uint64_t i = 0; i < 1500; ++i) masks.push_back(random_mask(i));
  const ChartPacking packing = pack_charts(masks, 256);
  REQUIRE(packing.spots.size() == masks.size());
  std::vector<std::vector<std::uint8_t>> page;
  std::uint64_t area = 0, used = 0;
  for (const PageSize& p : packing.pages) {
    page.emplace_back(p.width * p.height, std::uint8_t{0});
    area += page.back().size();
    CHECK((p.width & (p.width - 1)) == 0);
    CHECK((p.height & (p.height - 1)) == 0);
    CHECK(p.width <= 256);
  }
  std::size_t overlaps = 0, outside = 0;
  for (std::size_t i = 0; i < masks.size(); ++i) {
    const ChartSpot& s = packing.spots[i];
    ChartMask mask = masks[i];
    for (std::uint32_t t = 0; t < s.turns; ++t) mask = turned(mask);
    for (std::uint32_t y = 0; y < mask.height; ++y)
      for (std::uint32_t x = 0; x < mask.width; ++x) {
        if (!mask.taken(x, y)) continue;
        const PageSize& size = packing.pages[s.page];
        if (s.x + x >= size.width || s.y + y >= size.height) {
          ++outside;
          continue;
        }
        overlaps += page[s.page][(s.y + y) * size.width + s.x + x]++;
        ++used;
      }
  }
  CHECK(overlaps == 0);
  CHECK(outside == 0);
  CHECK(packing.pages.size() > 1);
  CHECK(static_cast<double>(used) > 0.7 * static_cast<double>(area));
}

TEST_CASE("chart packing: a chart turned four times is itself", "[unit]") {
  const ChartMask mask = random_mask(3);
  const ChartMask four = turned(turned(turned(turned(mask))));
  CHECK(four.bits == mask.bits);
  CHECK(turned(mask).width == mask.height);
  CHECK(turned(mask).taken(mask.height - 1, 0) == mask.taken(0, 0));
}

TEST_CASE("chart packing: on one page of a size that is given, or not at all", "[unit]") {
  std::vector<ChartMask> masks;
  std::uint64_t cells = 0;
  for (std::uint64_t i = 0; i < 200; ++i) masks.push_back(random_mask(i)), cells += masks.back().cells;
  REQUIRE(cells > 128u * 128u);
  CHECK_FALSE(pack_on_page(masks, {128, 128}));
  const auto spots = pack_on_page(masks, {512, 256});
  REQUIRE(spots);
  std::vector<std::uint8_t> taken(512 * 256, 0);
  std::size_t twice = 0, beyond = 0;
  for (std::size_t c = 0; c < masks.size(); ++c) {
    ChartMask mask = masks[c];
    for (std::uint32_t t = 0; t < (*spots)[c].turns; ++t) mask = turned(mask);
    for (std::uint32_t y = 0; y < mask.height; ++y)
      for (std::uint32_t x = 0; x < mask.width; ++x) {
        if (!mask.taken(x, y)) continue;
        const std::uint32_t px = (*spots)[c].x + x, py = (*spots)[c].y + y;
        if (px >= 512 || py >= 256) {
          ++beyond;
        } else {
          twice += taken[py * 512 + px]++ != 0;
        }
      }
  }
  CHECK(twice == 0);
  CHECK(beyond == 0);
}

TEST_CASE("chart packing: tells of every page and ends where it is told to", "[unit]") {
  std::vector<ChartMask> masks;
  for (std::uint64_t i = 0; i < 600; ++i) masks.push_back(random_mask(i));
  std::vector<std::size_t> told;
  std::size_t trials = 0;
  const ChartPacking packing = pack_charts(
      masks, 128, [&] { ++trials; }, [&](std::size_t charts) { told.push_back(charts); });
  REQUIRE(packing.pages.size() > 2);
  CHECK(told.size() == packing.pages.size());
  CHECK(std::is_sorted(told.begin(), told.end()));
  CHECK(told.back() == masks.size());
  CHECK(trials >= masks.size());
  struct Stopped {};
  const auto stop = [&] {
    if (--trials == 0) throw Stopped();
  };
  trials = 50;
  CHECK_THROWS_AS(pack_charts(masks, 128, stop), Stopped);
  trials = 50;
  CHECK_THROWS_AS(pack_on_page(masks, {512, 512}, stop), Stopped);
}

}  // namespace chart_packing_test
