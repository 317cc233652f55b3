#include "kernels/solid/distance_octree.h"

#include <catch2/catch.hpp>
#include <cmath>

#include "octree/error.h"
#include "octree/vector.h"
#include "tests/helpers/random.h"

namespace distance_octree_test {

using namespace tessera;
using test::Random;

namespace {

/// Two balls: a surface that is curved, and a medial axis between them.
double two_balls(const Double3& p) {
  return std::min(norm(p - Double3{20.3, 31.1, 30.2}) - 11.0, norm(p - Double3{44.8, 30.4, 32.9}) - 9.5);
}
double box(const Double3& p) {
  Double3 beyond{};
  double deepest = -1e9;
  for (std::size_t k = 0; k < 3; ++k) {
    const double excess = std::fabs(p[k] - 31.3) - 17.2;
    beyond[k] = std::max(0.0, excess);
    deepest = std::max(deepest, excess);
  }
  return deepest > 0.0 ? norm(beyond) : deepest;
}

DistanceOctree octree_of(double (*distance)(const Double3&), double tolerance, std::size_t& requested) {
  requested = 0;
  return build_distance_octree({64, 0, 128}, 64, tolerance, [&](const Int3& n) {
    ++requested;
    return distance({n[0] - 64.0, n[1] - 0.0, n[2] - 128.0});
  });
}

}  // namespace

TEST_CASE("distance octree: the field is within the tolerance everywhere", "[property]") {
  for (const auto distance : {two_balls, box})
    for (const double tolerance : {1.0, 1.5, 4.0}) {
      CAPTURE(tolerance);
      std::size_t requested = 0;
      const DistanceOctree tree = octree_of(distance, tolerance, requested);
      Random random(3);
      double worst = 0.0;
      for (int i = 0; i < 20'000; ++i) {
        const Double3 p = {random.in(0, 64), random.in(0, 64), random.in(0, 64)};
        worst = std::max(worst, std::fabs(tree.at(p + Double3{64, 0, 128}) - distance(p)));
      }
      CHECK(worst <= tolerance);
      CHECK(worst > 0.1 * tolerance);
      CHECK(requested <= 65 * 65 * 65);  // each node once
      CHECK(tree.cells().size() < 64 * 64 * 64 / 8);
      std::uint64_t cells = 0, volume = 0;
      const std::vector<std::uint64_t> sizes = tree.sizes();
      for (std::size_t k = 0; k < sizes.size(); ++k) cells += sizes[k], volume += sizes[k] << (3 * k);
      CHECK(cells == tree.cells().size());
      CHECK(volume == 64 * 64 * 64);
    }
}

TEST_CASE("distance octree: cells are small where sheets of the medial axis pass, and nowhere else",
          "[property]") {
  // Between two planes the field is linear but in the middle.
  const auto wall = [](const Int3& n) { return std::fabs(n[0] - 30.0) - 8.0; };
  const DistanceOctree tree = build_distance_octree({0, 0, 0}, 64, 1.0, wall);
  // Cells whose corners are on a side each are exact.
  for (const Double3& p : {Double3{3, 40, 7}, Double3{29.5, 8, 8}, Double3{50, 60, 60}})
    CHECK(tree.at(p) == Approx(std::fabs(p[0] - 30.0) - 8.0));
  CHECK(tree.sizes()[0] == 0);
  CHECK(tree.sizes()[1] == 2 * 32 * 32);
  CHECK(tree.sizes()[2] > 0);
}

TEST_CASE("distance octree: what was stored comes back, what is none is refused", "[unit]") {
  std::size_t requested = 0;
  const DistanceOctree tree = octree_of(box, 2.0, requested);
  const DistanceOctree again(tree.corner(), tree.edge(), tree.halved(), tree.nodes(), tree.cells());
  Random random(5);
  for (int i = 0; i < 200; ++i) {
    const Double3 p = {random.in(64, 128), random.in(0, 64), random.in(128, 192)};
    CHECK(again.at(p) == tree.at(p));
  }
  CHECK_THROWS_AS(DistanceOctree(tree.corner(), 48, tree.halved(), tree.nodes(), tree.cells()), InputError);
  CHECK_THROWS_AS(DistanceOctree(tree.corner(), 64, tree.halved(), tree.nodes() - 1, tree.cells()),
                  InputError);
  CHECK_THROWS_AS(DistanceOctree(tree.corner(), 64, {}, 0, {}), InputError);
  std::vector<std::uint64_t> bits = tree.halved();
  bits[0] ^= 2;
  CHECK_THROWS_AS(DistanceOctree(tree.corner(), 64, bits, tree.nodes(), tree.cells()), InputError);
  // All halved for ever.
  CHECK_THROWS_AS(DistanceOctree({0, 0, 0}, 1, {1}, 9, std::vector<std::array<float, 8>>(8)), InputError);
}

}  // namespace distance_octree_test
