#include "kernels/remesh/place_search.h"

#include <catch2/catch.hpp>

#include <limits>

namespace place_search_test {

using namespace tessera;

namespace {

constexpr PlaceSearch kSearch = {0.3, 0.001, 200, 1e-9};
const std::pair<Double3, Double3> kPlane = {{1.0, 0.0, 0.0}, {0.0, 1.0, 0.0}};

double bowl(const Double3& p) {
  return 1.0 + (p[0] - 0.7) * (p[0] - 0.7) + 3.0 * (p[1] + 0.2) * (p[1] + 0.2);
}

}  // namespace

TEST_CASE("place search: the lowest place of a bowl is found in a plane, and on a line the lowest of it",
          "[unit]") {
  const Double3 best = search_place({}, kPlane, kSearch, bowl({}), bowl);
  CHECK(best[0] == Approx(0.7).margin(2e-3));
  CHECK(best[1] == Approx(-0.2).margin(2e-3));
  const Double3 along = search_place({}, {{1.0, 0.0, 0.0}, {}}, kSearch, bowl({}), bowl);
  CHECK(along[0] == Approx(0.7).margin(2e-3));
  CHECK(along[1] == 0.0);
}

TEST_CASE("place search: no step where it costs too much, none for nothing, none from what cannot be better",
          "[unit]") {
  const auto fenced = [](const Double3& p) {
    return p[0] > 0.4 ? std::numeric_limits<double>::infinity() : bowl(p);
  };
  const Double3 best = search_place({}, kPlane, kSearch, bowl({}), fenced);
  CHECK(best[0] <= 0.4);
  CHECK(best[0] > 0.39);
  CHECK(search_place({}, kPlane, {0.3, 0.001, 200, 1.0}, bowl({}), bowl) == Double3{});
  CHECK(search_place({}, kPlane, kSearch, 0.0, [](const Double3&) { return -1.0; }) == Double3{});
}

}  // namespace place_search_test
