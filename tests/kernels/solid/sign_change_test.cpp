#include "kernels/solid/sign_change.h"

#include <catch2/catch.hpp>

namespace sign_change_test {

using namespace tessera;

TEST_CASE("sign change: found from both ends, also where values run flat or jump", "[unit]") {
  const auto root_of = [](auto value, bool starts_inside) {
    return find_sign_change(starts_inside, 1e-12, 0.0, value);
  };
  CHECK(root_of([](double t) { return t - 0.3; }, true) == Approx(0.3).margin(1e-11));
  CHECK(root_of([](double t) { return 0.3 - t; }, false) == Approx(0.3).margin(1e-11));
  const auto flat = [](double t) { return (t - 0.7) * (t - 0.7) * (t - 0.7); };
  CHECK(root_of(flat, true) == Approx(0.7).margin(1e-9));
  const auto jump = [](double t) { return t < 0.123 ? -1e-9 : 1e3; };
  CHECK(root_of(jump, true) == Approx(0.123).margin(1e-4));
  // The far side: an edge that is cut belongs to where it ends.
  CHECK(root_of(jump, true) >= 0.123);
  CHECK(root_of([](double) { return -1.0; }, true) == 1.0);
}

TEST_CASE("sign change: the first value that is near enough ends the search", "[unit]") {
  int requested = 0;
  const double root = find_sign_change(true, 1e-12, 0.1, [&](double t) {
    ++requested;
    return t - 0.5;
  });
  CHECK(root == Approx(0.5));
  CHECK(requested == 3);
}

}  // namespace sign_change_test
