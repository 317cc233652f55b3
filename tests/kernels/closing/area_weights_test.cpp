#include "kernels/closing/area_weights.h"

#include <catch2/catch.hpp>
#include <cmath>

#include "tests/helpers/oriented_samples.h"

namespace area_weights_test {

using namespace tessera;

namespace {
constexpr double kPi = 3.14159265358979323846;

double total(const PointBlock& block) {
  double sum = 0;
  for (const float w : area_weights(block)) sum += static_cast<double>(w);
  return sum;
}
}  // namespace

TEST_CASE("area weights: a plane in a cube", "[unit]") {
  CHECK(plane_area_in_cube({1, 2, 0.5}, {0, 0, 1}, 4.0) == Approx(16.0));
  const double d = 1 / std::sqrt(2.0);
  CHECK(plane_area_in_cube({2, 2, 2}, {d, 0, d}, 4.0) == Approx(16.0 * std::sqrt(2.0)));
  const double t = 1 / std::sqrt(3.0);
  CHECK(plane_area_in_cube({2, 2, 2}, {t, t, t}, 4.0) == Approx(0.75 * std::sqrt(3.0) * 16.0));  // a hexagon
  CHECK(plane_area_in_cube({0.1, 0.1, 0.1}, {t, t, t}, 4.0) == Approx(0.3 * 0.3 * std::sqrt(3.0) / 2));
}

TEST_CASE("area weights: they sum to the area, however often a spot was scanned", "[unit]") {
  test::Random random(5);
  test::Samples samples;
  test::add_sphere({96, 96, 96}, 26.0, 1 / 1.5, random, samples);
  const double truth = 4 * kPi * 26 * 26;
  CHECK(total(test::make_block(samples, {64, 64, 64}, {64, 64, 64}, 0)) == Approx(truth).epsilon(0.02));
  test::Samples more;  // a second scan of one half
  test::add_sphere({96, 96, 96}, 26.0, 0.4, random, more);
  for (const test::Sample& s : more)
    if (s.p[0] > 96) samples.push_back(s);
  CHECK(total(test::make_block(samples, {64, 64, 64}, {64, 64, 64}, 0)) == Approx(truth).epsilon(0.02));
}

TEST_CASE("area weights: two sides of a thin sheet count apart, points without normal count nothing",
          "[unit]") {
  test::Random random(6);
  test::Samples samples;
  test::add_face({70, 70, 98}, {40, 0, 0}, {0, 40, 0}, {0, 0, 1}, 0.6, {}, random, samples);
  test::add_face({70, 70, 97}, {40, 0, 0}, {0, 40, 0}, {0, 0, -1}, 0.6, {}, random, samples);
  PointBlock block = test::make_block(samples, {64, 64, 64}, {64, 64, 64}, 0);
  CHECK(total(block) == Approx(2 * 1600.0).epsilon(0.25));  // voxels at the rim count whole
  for (std::size_t i = 0; i < block.size(); ++i)
    if (block.nz[i] < 0) block.nx[i] = block.ny[i] = block.nz[i] = 0;
  CHECK(total(block) == Approx(1600.0).epsilon(0.25));
}

}  // namespace area_weights_test
