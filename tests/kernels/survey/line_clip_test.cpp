// Lines cut off at the sides of a strip.
#include <catch2/catch.hpp>

#include "kernels/survey/line_clip.h"

namespace line_clip_test {

using namespace tessera;

using Points = std::vector<Double2>;

TEST_CASE("line clip: what lies within stays as it is, what lies outside goes", "[unit]") {
  const Points way = {{0, 0}, {1, 2}, {4, 1}};
  const auto whole = clip_line(way, false, 0.0, 4.0);
  REQUIRE(whole.size() == 1);
  CHECK(whole[0].points == way);
  const auto ring = clip_line(way, true, -1.0, 5.0);
  REQUIRE(ring.size() == 1);
  CHECK(ring[0].closed);
  CHECK(ring[0].points == way);
  CHECK(clip_line(way, false, 5.0, 6.0).empty());
  CHECK(clip_line(way, true, -3.0, -1.0).empty());
  CHECK(clip_line({{1, 1}}, false, 0.0, 2.0).empty());
}

TEST_CASE("line clip: a zigzag falls into pieces that end at the sides, in its order", "[unit]") {
  const auto pieces = clip_line({{-2, 0}, {2, 4}, {-2, 8}, {0, 9}}, false, -1.0, 1.0);
  REQUIRE(pieces.size() == 3);
  CHECK(pieces[0].points == Points{{-1, 1}, {1, 3}});
  CHECK(pieces[1].points == Points{{1, 5}, {-1, 7}});
  CHECK(pieces[2].points == Points{{-1, 8.5}, {0, 9}});
  for (const ClippedLine& p : pieces) CHECK_FALSE(p.closed);
}

TEST_CASE("line clip: a ring that leaves on both sides is open, and no piece is torn at its beginning",
          "[unit]") {
  // Begins within.
  const auto pieces = clip_line({{0, 0}, {3, 0}, {3, 2}, {-3, 2}, {-3, 0}}, true, -1.0, 1.0);
  REQUIRE(pieces.size() == 2);
  CHECK(pieces[0].points == Points{{1, 2}, {-1, 2}});
  CHECK(pieces[1].points == Points{{-1, 0}, {0, 0}, {1, 0}});
  CHECK_FALSE(pieces[0].closed);
}

TEST_CASE("line clip: what only touches a side is left out, what runs along it stays", "[unit]") {
  CHECK(clip_line({{2, 0}, {1, 1}, {2, 2}}, false, 0.0, 1.0).empty());
  const auto side = clip_line({{2, 0}, {1, 1}, {1, 3}, {2, 4}}, false, 0.0, 1.0);
  REQUIRE(side.size() == 1);
  CHECK(side[0].points == Points{{1, 1}, {1, 3}});
  // From a side inwards: no point twice.
  const auto inwards = clip_line({{2, 0}, {1, 1}, {0.5, 3}}, false, 0.0, 1.0);
  REQUIRE(inwards.size() == 1);
  CHECK(inwards[0].points == Points{{1, 1}, {0.5, 3}});
}

TEST_CASE("line clip: a way is cut at the same points from either end", "[unit]") {
  const Double2 a = {-0.3, 0.1}, b = {1.7, 0.7};
  const auto there = clip_line({a, b}, false, 0.1, 1.3), back = clip_line({b, a}, false, 0.1, 1.3);
  REQUIRE(there.size() == 1);
  REQUIRE(back.size() == 1);
  CHECK(there[0].points[0] == back[0].points[1]);
  CHECK(there[0].points[1] == back[0].points[0]);
}

}  // namespace line_clip_test
