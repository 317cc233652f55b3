// Bricks of meshes wherever they lie: coordinates at powers of two and beside them, denormal, huge, of either zero.
#include "stream/import/import_plan.h"

#include <catch2/catch.hpp>

#include <algorithm>
#include <cmath>
#include <limits>

#include "octree/error.h"
#include "tests/helpers/random.h"

namespace import_plan_test {

using namespace tessera;

namespace {

/// A coordinate that arithmetic likes to round.
double nasty(test::Random& random, int exponent) {
  double value = 0.0;
  switch (random.below(8)) {
    case 0:
      break;
    case 1:
      value = std::ldexp(1.0, exponent);
      break;
    case 2:
      value = std::nextafter(std::ldexp(1.0, exponent), random.below(2) ? 0.0 : 1e308);
      break;
    case 3:
      value = std::numeric_limits<double>::denorm_min() * static_cast<double>(1 + random.below(3));
      break;
    case 4:
      value = std::ldexp(1.0, exponent - 53);
      break;
    case 5:
      value = std::ldexp(static_cast<double>(random.below(128)), exponent - 6);
      break;
    default:
      value = random.in(0.0, std::ldexp(1.0, exponent));
  }
  return random.below(2) ? -value : value;
}

ImportPlan measured(const std::vector<Double3>& vertices) {
  return ImportPlan::measure(
      {}, [&](const auto& sink) { sink(vertices, std::span<const std::uint32_t>()); }, [] {});
}

}  // namespace

TEST_CASE("import plan: every vertex has a brick and a bucket, wherever it lies", "[property]") {
  test::Random random(7);
  std::size_t done = 0, refused = 0;
  for (int trial = 0; trial < 400; ++trial) {
    const int exponent =
        trial < 300 ? static_cast<int>(random.below(80)) - 40 : static_cast<int>(random.below(2100)) - 1060;
    std::vector<Double3> vertices(3 + random.below(12));
    for (Double3& v : vertices)
      for (double& c : v) c = std::clamp(nasty(random, exponent), -1e308, 1e308);
    try {
      const ImportPlan plan = measured(vertices);
      for (const Double3& v : vertices) REQUIRE(plan.bucket_of_brick(plan.brick_of(v)) < plan.buckets());
      ++done;
    } catch (const InputError&) {
      ++refused;  // beyond what can be computed with
    }
  }
  CHECK(done > 300);
  CHECK(refused > 0);
}

TEST_CASE("import plan: half an ulp below zero does not make the mesh three root cubes wide", "[unit]") {
  for (const double low : {-6e-17, -5e-324, -1e-300, -0.0}) {
    const std::vector<Double3> cube = {{low, 0, 0}, {1, 0, 0}, {0, 1, 0}, {0, 0, 1}, {1, 1, 1}};
    const ImportPlan plan = measured(cube);
    for (const Double3& v : cube) CHECK(plan.bucket_of_brick(plan.brick_of(v)) == 0);
  }
}

TEST_CASE("import plan: an index beyond its end is an error in every build", "[unit]") {
  const ImportPlan plan = measured({{0, 0, 0}, {1, 0, 0}, {0, 1, 1}});
  CHECK_THROWS_AS(plan.brick_of({1e6, 0, 0}), std::logic_error);
  CHECK_THROWS_AS(plan.brick_of({-1e6, 0, 0}), std::logic_error);
  CHECK_THROWS_AS(plan.brick_of({std::nan(""), 0, 0}), std::logic_error);
}

}  // namespace import_plan_test
