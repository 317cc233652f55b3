// Frames of sections: there and back, and which side is which.
#include <catch2/catch.hpp>

#include <array>

#include "kernels/survey/section_frame.h"
#include "tests/helpers/random.h"

namespace section_frame_test {

using namespace tessera;

TEST_CASE("section frame: an axis is cut into pieces with running stations, repeated corners left out",
          "[unit]") {
  const std::array<Double2, 5> corners = {{{10, 20}, {10, 20}, {13, 24}, {13, 24}, {13, 34}}};
  const auto pieces = axis_pieces(corners);
  REQUIRE(pieces.size() == 2);
  CHECK(pieces[0].station == 0.0);
  CHECK(pieces[0].length == 5.0);
  CHECK(pieces[1].station == 5.0);
  CHECK(pieces[1].length == 10.0);
  CHECK(axis_pieces(std::array<Double2, 2>{{{1, 1}, {1, 1}}}).empty());
  CHECK(axis_pieces({}).empty());
}

TEST_CASE("section frame: right of the axis, up and ahead, and along it to the left", "[unit]") {
  const AxisPiece north{{500000, 5400000}, {500000, 5400100}, 40.0, 100.0};
  const Double3 place = {500003, 5400007, 250};
  CHECK(SectionFrame(SectionKind::kAcross, north).turned(place) == Double3{3, 250, 47});
  CHECK(SectionFrame(SectionKind::kAlong, north).turned(place) == Double3{47, 250, -3});
  CHECK(SectionFrame().turned(place) == place);
}

TEST_CASE("section frame: places come back", "[property]") {
  test::Random random(3);
  for (int k = 0; k < 100; ++k) {
    const Double2 from = {500000 + random.in(-100, 100), 5400000 + random.in(-100, 100)};
    const Double2 to = {from[0] + random.in(1, 50), from[1] + random.in(-50, 50)};
    const AxisPiece piece = axis_pieces(std::array<Double2, 2>{from, to}).at(0);
    const Double3 p = {500000 + random.in(-100, 100), 5400000 + random.in(-100, 100), random.in(200, 300)};
    for (const SectionKind kind : {SectionKind::kAcross, SectionKind::kAlong}) {
      const SectionFrame frame(kind, piece);
      const Double3 back = frame.place(frame.turned(p));
      CHECK(squared_distance(back, p) < 1e-17);
      CHECK(back[2] == p[2]);
    }
  }
}

}  // namespace section_frame_test
