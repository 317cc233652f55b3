#include "octree/rounding.h"

#include <catch2/catch.hpp>

#include <array>
#include <vector>

#include "octree/vector.h"

namespace tessera::rounding_test {
namespace {

// Noinline, so that the compiler sees the arithmetic and not the numbers. Built with -O2 or -O3 and block
// vectorisation, GCC 12.2 returns its argument.
[[gnu::noinline]] Double3 through_float(const Double3& p) {
  const Float3 f = {static_cast<float>(p[0]), static_cast<float>(p[1]), static_cast<float>(p[2])};
  return {f[0], f[1], f[2]};
}

[[gnu::noinline]] void round_if(std::vector<Double3>& points, bool doubles) {
  for (Double3& p : points) {
    for (double& value : p) value = doubles ? value : static_cast<float>(value);
  }
}

bool is_float(double value) {
  const volatile float f = static_cast<float>(value);
  return static_cast<double>(f) == value;
}

TEST_CASE("rounding: up is the smallest float that is not below", "[unit]") {
  for (const double v : {0.0, 1.0, 1.0 + 1e-12, 0.1, -0.1, 1e30, 3e-40, -1.0 - 1e-12}) {
    const float up = rounded_up(v);
    CHECK(static_cast<double>(up) >= v);
    CHECK(static_cast<double>(std::nextafter(up, -1e38f)) < v);
  }
}

TEST_CASE("rounding: the largest bound within a limit stays there when it is rounded up", "[unit]") {
  // 0.35 lies between two floats, nearer to the upper one in single precision.
  CHECK(static_cast<double>(static_cast<float>(0.35)) != 0.35);
  for (const double limit : {0.35, 0.1, 1.1, 0.3, 1.0, 1e-5, 7e3})
    for (const double added : {0.0, 1e-12, 1e-7}) {
      const double bound = bound_within(limit, added);
      CHECK(static_cast<double>(rounded_up(bound + added)) <= limit);
      // No float step is given away beyond what rounding takes.
      const double next = static_cast<double>(std::nextafter(static_cast<float>(bound), 1e38f));
      CHECK(static_cast<double>(rounded_up(next + added)) > limit);
    }
  CHECK(bound_within(1e-9, 1e-3) == 0.0);
}

TEST_CASE("compiler: a value that went through float is rounded", "[unit]") {
  std::vector<Double3> points;
  for (int i = 1; i < 100; ++i) points.push_back({1.0 / (3 * i), 2.0 / (7 * i), 1.0 / (9 * i)});
  for (const Double3& p : points) {
    const Double3 q = through_float(p);
    CHECK((is_float(q[0]) && is_float(q[1]) && is_float(q[2])));
  }
  round_if(points, false);
  for (const Double3& p : points) CHECK((is_float(p[0]) && is_float(p[1]) && is_float(p[2])));
}

}  // namespace
}  // namespace tessera::rounding_test
