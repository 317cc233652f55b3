#include "kernels/remesh/triangle_quality.h"

#include <catch2/catch.hpp>

#include <cmath>

#include "tests/helpers/block_meshes.h"

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
  TriangleQuality twice = q;
  twice.merge(q);
  CHECK(twice.faces == 480);
  CHECK(twice.valences[6] == 2 * 11 * 9);

  TriangleQuality right;
  right.add(grid_block(4, 4, [](double, double) { return 0.0; }), 1.0);
  CHECK(right.smallest == 45000);
  CHECK(right.angle_off == 32u * (15000 + 15000 + 30000));
}
