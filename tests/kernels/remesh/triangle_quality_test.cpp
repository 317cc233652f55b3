#include "kernels/remesh/triangle_quality.h"

#include <catch2/catch.hpp>

#include <cmath>

#include "tests/helpers/block_meshes.h"

namespace triangle_quality_test {

using namespace tessera;
using namespace tessera::test;

TEST_CASE("triangle quality: equilateral triangles are regular to the last digit that is kept", "[unit]") {
  MeshBlock block = grid_block(12, 10, [](double, double) { return 0.0; });
  for (Double3& p : block.position) p = {p[0] - 0.5 * p[1], p[1] * std::sqrt(0.75), 0.0};
  TriangleQuality q;
  q.add(block, 1.0);
  CHECK(q.faces == 240);
  CHECK(q.smallest >= 59999);
  CHECK(q.angle_off <= 240 * 3);
  CHECK(q.length_off <= 240 * 3);
  CHECK(q.area_off <= 240);
  CHECK(q.angles[59] + q.angles[60] == 720);
  CHECK(q.valences[6] == 11 * 9);
  CHECK(q.cells[99] + q.cells[100] == 11 * 9);
  CHECK(q.mean_cell_deviation() < 1e-5);
  TriangleQuality twice = q;
  twice.merge(q);
  CHECK(twice.faces == 480);
  CHECK(twice.valences[6] == 2 * 11 * 9);

  CHECK(twice.cells[99] + twice.cells[100] == 2 * 11 * 9);

  TriangleQuality right;
  right.add(grid_block(4, 4, [](double, double) { return 0.0; }), 1.0);
  CHECK(right.smallest == 45000);
  CHECK(right.angle_off == 32u * (15000 + 15000 + 30000));
}

TEST_CASE("triangle quality: Voronoi cells of uneven rows are off their mean by what they are", "[unit]") {
  // Right triangles over columns of the widths 1 and 3: the cell of an inner vertex is half of both columns beside it.
  MeshBlock block = grid_block(3, 4, [](double, double) { return 0.0; });
  for (Double3& p : block.position) p[0] = p[0] < 0.5 ? 0.0 : p[0] < 1.5 ? 1.0 : p[0] < 2.5 ? 2.0 : 5.0;
  TriangleQuality q;
  q.add(block, 1.5);
  // Inner columns at x = 1 and 2: cells of 1 and 2, a third off their mean of 1.5.
  CHECK(q.mean_cell_deviation() == Approx(1.0 / 3.0).epsilon(1e-5));
}

}  // namespace triangle_quality_test
