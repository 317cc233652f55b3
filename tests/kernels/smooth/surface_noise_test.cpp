#include "kernels/smooth/surface_noise.h"

#include <catch2/catch.hpp>
#include <cmath>
#include <random>

#include "kernels/mesh/face_corners.h"
#include "tests/helpers/block_meshes.h"

namespace surface_noise_test {

namespace {

using namespace tessera;

NoiseCounts all_of(const MeshBlock& block) {
  return count_noise(block, FaceCorners(block), std::vector<std::uint8_t>(block.position.size(), 1));
}

void add_heights(MeshBlock& block, double deviation) {
  std::mt19937 random(11);
  std::normal_distribution<double> normal(0.0, deviation);
  for (Double3& p : block.position) p[2] += normal(random);
}

/// Hills 60 edges long, and a cliff.
MeshBlock hills() {
  return test::grid_block(120, 120, [](double x, double y) {
    return 3.0 * std::sin(x / 10.0) * std::cos(y / 12.0) + (x > 80.0 ? 20.0 : 0.0);
  });
}

}  // namespace

TEST_CASE("surface noise: what was added to hills is found, and nothing where nothing was", "[unit]") {
  const double clean = all_of(hills()).noise();
  CHECK(clean < 0.01);
  for (const double deviation : {0.03, 0.1, 0.3}) {
    MeshBlock block = hills();
    add_heights(block, deviation);
    CAPTURE(deviation);
    const NoiseCounts counts = all_of(block);
    CHECK(counts.vertices > 8000);
    CHECK(counts.noise() == Approx(deviation).epsilon(0.2));
  }
}

TEST_CASE("surface noise: noise that goes on over some edges counts too", "[unit]") {
  std::mt19937 random(3);
  std::normal_distribution<double> normal(0.0, 0.1);
  std::vector<double> coarse(70 * 70);
  for (double& x : coarse) x = normal(random);
  // Of every second vertex, linear in between.
  const auto height = [&](double x, double y) {
    const auto at = [&](double i, double j) {
      return coarse[static_cast<std::size_t>(j) * 70 + static_cast<std::size_t>(i)];
    };
    const double i = std::floor(x / 2), j = std::floor(y / 2), s = x / 2 - i, t = y / 2 - j;
    return (1 - t) * ((1 - s) * at(i, j) + s * at(i + 1, j)) +
           t * ((1 - s) * at(i, j + 1) + s * at(i + 1, j + 1));
  };
  const double noise = all_of(test::grid_block(120, 120, height)).noise();
  CHECK(noise > 0.07);
  CHECK(noise < 0.3);
}

TEST_CASE("surface noise: counts of parts add up to those of the whole", "[unit]") {
  MeshBlock block = hills();
  add_heights(block, 0.1);
  const FaceCorners corners(block);
  std::vector<std::uint8_t> first(block.position.size(), 0), second(block.position.size(), 0);
  for (std::size_t v = 0; v < first.size(); ++v) (v % 3 == 0 ? first : second)[v] = 1;
  NoiseCounts sum = count_noise(block, corners, second);
  sum.add(count_noise(block, corners, first));
  const NoiseCounts whole = all_of(block);
  CHECK(sum.residual == whole.residual);
  CHECK(sum.between == whole.between);
  CHECK(sum.vertices == whole.vertices);
  CHECK(sum.noise() == whole.noise());
}

TEST_CASE("surface noise: it is surely below what three quarters of the squares stay below", "[unit]") {
  MeshBlock block = hills();
  add_heights(block, 0.1);
  const NoiseCounts counts = all_of(block);
  CHECK(counts.surely_below(2.0 * counts.noise()));
  CHECK_FALSE(counts.surely_below(1.05 * counts.noise()));
  CHECK_FALSE(NoiseCounts().surely_below(1.0));
  // A third of the places have more: the median says nothing of them, the quartile does.
  NoiseCounts sum;
  for (int i = 0; i < 30; ++i) sum.add(NoiseSquares{i % 3 == 0 ? 0.16 : 0.01, 0.0});
  CHECK(sum.noise() == Approx(0.1).epsilon(0.06));
  CHECK_FALSE(sum.surely_below(0.3));
  CHECK(sum.surely_below(0.5));
}

TEST_CASE("surface noise: a plane has none, and a mesh too small to tell has none", "[unit]") {
  CHECK(all_of(test::grid_block(30, 30, [](double x, double y) { return 0.5 * x - y; })).noise() < 1e-12);
  CHECK(all_of(test::grid_block(1, 1, [](double, double) { return 0.0; })).vertices == 0);
}

}  // namespace surface_noise_test
