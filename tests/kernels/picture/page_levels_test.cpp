#include <catch2/catch.hpp>

#include <cmath>

#include "kernels/picture/page_levels.h"

namespace tessera::page_levels_test {
namespace {

Image page_of(int width, int height, const std::vector<std::uint8_t>& rgb) {
  return {width, height, rgb};
}

/// Red of column x is 10 x, green that of row y, blue 200.
Image slopes(int width, int height) {
  Image page{width, height, {}};
  for (int y = 0; y < height; ++y)
    for (int x = 0; x < width; ++x)
      page.rgb.insert(page.rgb.end(),
                      {static_cast<std::uint8_t>(10 * x), static_cast<std::uint8_t>(10 * y), 200});
  return page;
}

}  // namespace

TEST_CASE("page levels: four texels become their mean in linear light", "[unit]") {
  Image page = page_of(2, 2, {0, 10, 255, 255, 10, 255, 0, 10, 255, 255, 10, 255});
  halve_page(page);
  CHECK(page.width == 1);
  CHECK(page.height == 1);
  // sqrt(255^2 / 2), what two lamps of four give; the mean of what is stored would be 127.5
  CHECK(page.rgb == std::vector<std::uint8_t>{180, 10, 255});
}

TEST_CASE("page levels: odd sides count every texel by its area, down to one", "[unit]") {
  Image page = page_of(3, 1, {30, 0, 0, 60, 0, 0, 90, 0, 0});
  halve_page(page);
  REQUIRE(page.width == 1);
  CHECK(page.height == 1);
  CHECK(page.rgb[0] == std::lround(std::sqrt((30.0 * 30 + 60 * 60 + 90 * 90) / 3)));

  // Five texels under two: two and a half each.
  page = page_of(5, 1, {10, 0, 0, 20, 0, 0, 30, 0, 0, 40, 0, 0, 50, 0, 0});
  halve_page(page);
  REQUIRE(page.width == 2);
  CHECK(page.rgb[0] == std::lround(std::sqrt((100 + 400 + 0.5 * 900) / 2.5)));
  CHECK(page.rgb[3] == std::lround(std::sqrt((0.5 * 900 + 1600 + 2500) / 2.5)));
}

TEST_CASE("page levels: in place as into another page", "[unit]") {
  for (const auto& [width, height] :
       {std::pair(16, 8), std::pair(25, 13), std::pair(1, 24), std::pair(24, 1)}) {
    const Image before = slopes(width, height);
    Image page = before;
    halve_page(page);
    const int w = std::max(1, width / 2), h = std::max(1, height / 2);
    REQUIRE(page.width == w);
    REQUIRE(page.height == h);
    REQUIRE(page.rgb.size() == static_cast<std::size_t>(3 * w * h));
    for (int y = 0; y < h; ++y)
      for (int x = 0; x < w; ++x) {
        double red = 0.0, weight = 0.0;
        for (int i = 0; i < width; ++i) {
          const double share = std::max(0.0, std::min(i + 1.0, (x + 1.0) * width / w) -
                                                 std::max<double>(i, static_cast<double>(x) * width / w));
          red += share * 100 * i * i, weight += share;
        }
        CHECK(std::abs(page.pixel(x, y)[0] - std::sqrt(red / weight)) <= 0.5001);
        CHECK(page.pixel(x, y)[2] == 200);
      }
  }
}

TEST_CASE("page levels: the last one is the mean of the page", "[unit]") {
  Image page = slopes(16, 16);
  while (page.width > 1 || page.height > 1) halve_page(page);
  double mean = 0.0;
  for (int x = 0; x < 16; ++x) mean += 100.0 * x * x / 16;
  CHECK(std::abs(page.rgb[0] - std::sqrt(mean)) < 1.5);
  CHECK(page.rgb[2] == 200);
}

}  // namespace tessera::page_levels_test
