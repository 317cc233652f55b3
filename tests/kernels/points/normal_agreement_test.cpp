// Neighbours that contradict each other: on one surface they do, the faces of walls and gaps do not.
#include "kernels/points/normal_agreement.h"

#include <catch2/catch.hpp>

#include <functional>

#include "tests/helpers/random.h"

namespace normal_agreement_test {

using namespace tessera;
using test::Random;

namespace {

/// A patch of a rough plane of 7 x 7 samples, one apart; its normal is up or down.
std::vector<NormalSample> patch(const std::function<bool(double x, Random&)>& up, double z = 0.0,
                                float side = 1.0f) {
  Random random(8);
  std::vector<NormalSample> cell;
  for (int i = 0; i < 7; ++i)
    for (int j = 0; j < 7; ++j) {
      const double x = i + random.in(-0.3, 0.3);
      cell.push_back(
          {{x, j + random.in(-0.3, 0.3), z + random.in(-0.05, 0.05)}, {0, 0, up(x, random) ? side : -side}});
    }
  return cell;
}

bool always(double, Random&) {
  return true;
}

}  // namespace

TEST_CASE("normal agreement: one side is none against, whichever it is", "[unit]") {
  const NormalAgreement up = compare_neighbours(patch(always));
  CHECK(up.pairs == 4 * 49);
  CHECK(up.against == 0);
  CHECK(up.split == 0);
  CHECK(compare_neighbours(patch(always, 0.0, -1.0f)).against == 0);
}

TEST_CASE("normal agreement: signs by chance, and few of them turned", "[unit]") {
  CHECK(compare_neighbours(patch([](double, Random& r) { return r.unit() < 0.5; })).share() > 0.25);
  const NormalAgreement few = compare_neighbours(patch([](double, Random& r) { return r.unit() < 0.92; }));
  CHECK(few.share() > 0.02);
  CHECK(few.split == 0);
}

TEST_CASE("normal agreement: the border of a region that is turned over is a split", "[unit]") {
  const NormalAgreement half = compare_neighbours(patch([](double x, Random&) { return x < 3.4; }));
  CHECK(half.split == 1);
  CHECK(half.share() > 0.01);
}

TEST_CASE("normal agreement: faces of a wall and of a gap, however thin, are not against each other",
          "[unit]") {
  const double thick = GENERATE(0.3, 1.0, 2.0);
  for (const float side : {1.0f, -1.0f}) {
    std::vector<NormalSample> wall = patch(always, 0.0, -side);
    const std::vector<NormalSample> top = patch(always, thick, side);
    wall.insert(wall.end(), top.begin(), top.end());
    const NormalAgreement found = compare_neighbours(wall);
    CAPTURE(thick, side);
    CHECK(found.against == 0);
    CHECK(found.split == 0);
  }
}

}  // namespace normal_agreement_test
