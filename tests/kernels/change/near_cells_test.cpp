// All cells that hold points of a capsule are found, in the order of the cells.
#include <catch2/catch.hpp>

#include <algorithm>
#include <vector>

#include "kernels/change/near_cells.h"
#include "tests/helpers/random.h"

namespace near_cells_test {

using namespace tessera;
using namespace tessera::test;

namespace {

double distance_to_segment(const Double3& p, const Capsule& c) {
  const double along = std::clamp(dot(p - c.middle, c.axis), -c.depth, c.depth);
  return norm(p - c.middle - c.axis * along);
}

}  // namespace

TEST_CASE("near cells: every point of a capsule lies in one of them", "[property]") {
  Random random(1);
  std::vector<Double3> points;
  for (int i = 0; i < 20000; ++i)
    points.push_back({random.in(-5.0, 5.0), random.in(-5.0, 5.0), random.in(-5.0, 5.0)});
  const PointCells cells(points, 0.45, false);
  NearCells near;
  for (int trial = 0; trial < 60; ++trial) {
    Capsule c;
    for (double& x : c.middle) x = random.in(-5.5, 5.5);
    const Double3 axes[] = {{0, 0, 1}, {1, 0, 0}, {0, -1, 0}, unit(Double3{1.0, random.in(-1.0, 1.0), 0.3})};
    c.axis = axes[trial % 4];
    c.radius = random.in(0.05, 1.5);
    c.depth = trial % 3 == 0 ? 0.0 : random.in(0.1, 6.0);
    near.collect(cells, c);
    std::vector<std::uint32_t> found;
    near.for_meeting([](__m256d x, __m256d, __m256d, __m256d) { return _mm256_cmp_pd(x, x, _CMP_EQ_OQ); },
                     [&](std::uint32_t k) { found.push_back(k); });
    CHECK(std::is_sorted(found.begin(), found.end()));
    std::size_t missed = 0, held = 0;
    for (std::uint32_t k = 0; k < cells.cells().size(); ++k)
      for (std::uint32_t i = cells.cells()[k].begin; i < cells.cells()[k].end; ++i) {
        if (distance_to_segment(cells.position(i), c) > c.radius) continue;
        ++held;
        missed += std::binary_search(found.begin(), found.end(), k) ? 0 : 1;
      }
    CHECK(missed == 0);
    if (held == 0) continue;
    CHECK(found.size() < cells.cells().size());
  }
}

}  // namespace near_cells_test
