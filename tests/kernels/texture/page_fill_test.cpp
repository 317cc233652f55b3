#include "kernels/texture/page_fill.h"

#include <catch2/catch.hpp>

namespace page_fill_test {

using namespace tessera;

TEST_CASE("page fill: gaps get the colours around them, colours stay", "[unit]") {
  const std::uint32_t red = 0xff0000c8u, blue = 0xffc80000u;
  std::vector<std::uint32_t> page(16 * 8, 0);
  page[0] = red;
  page[15] = blue;
  fill_page(page, 16, 8);
  CHECK(page[0] == red);
  CHECK(page[15] == blue);
  CHECK(page[3 * 16 + 2] == red);
  CHECK(page[5 * 16 + 13] == blue);
  for (const std::uint32_t c : page) CHECK(c >> 24 == 255);
}

TEST_CASE("page fill: without any colour all is grey", "[unit]") {
  std::vector<std::uint32_t> page(4 * 4, 0);
  fill_page(page, 4, 4);
  for (const std::uint32_t c : page) CHECK(c == 0xff808080u);
  std::vector<std::uint32_t> one = {0};
  fill_page(one, 1, 1);
  CHECK(one[0] == 0xff808080u);
}

}  // namespace page_fill_test
