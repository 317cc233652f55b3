// Loops of cells: faces where the surface is smooth, feature vertices where it is sharp.
#include "kernels/extract/cell_tracing.h"

#include <catch2/catch.hpp>

#include "tests/helpers/analytic_field.h"
#include "tests/helpers/traced_brick.h"

namespace cell_tracing_test {

using namespace tessera;

TEST_CASE("cell tracing: a level surface is two triangles a cell, and has no feature", "[unit]") {
  const DirectedField field =
      test::make_field(test::half_space({0, 0, 74.25}, {0, 0, 1}), {64, 64, 64}, {64, 64, 64});
  test::TracedBrick brick(field);
  brick.trace();
  CHECK(brick.report.loops == 64 * 64);
  CHECK(brick.patch.faces() == 2 * 64 * 64);
  CHECK(brick.features.all().empty());
  const Patch out = brick.patch.finish();
  CHECK(out.foreign.size() == 2 * 64 + 1);
  for (const PatchFace& f : out.faces) {
    if (f[0] >= out.position.size() || f[1] >= out.position.size() || f[2] >= out.position.size()) continue;
    CHECK(triangle_normal(out.position[f[0]], out.position[f[1]], out.position[f[2]])[2] > 0.9f);
  }
}

TEST_CASE("cell tracing: loops on an edge of a box become vertices on it, their faces are left for later",
          "[unit]") {
  // One edge along x at (y, z) = (90.4, 100.6), through the whole brick.
  const DirectedField field = test::make_field(
      test::intersect(test::half_space({0, 90.4, 0}, {0, 1, 0}), test::half_space({0, 0, 100.6}, {0, 0, 1})),
      {64, 64, 64}, {64, 64, 64});
  test::TracedBrick brick(field);
  brick.trace();
  CHECK(brick.report.crease_samples == 64);
  CHECK(brick.report.corner_samples == 0);
  CHECK(brick.patch.faces() == 2 * (brick.report.loops - 64));
  std::size_t own = 0;
  for (const FeatureLoop& loop : brick.features.all()) {
    own += inside_brick(loop.cell);
    CHECK(loop.position[1] == Approx(0.4f).margin(1e-4));
    CHECK(loop.position[2] == Approx(0.6f).margin(1e-4));
  }
  CHECK(own == 64);
  CHECK(brick.features.all().size() == 65);  // and one of the halo before them
}

}  // namespace cell_tracing_test
