// Vertices on crossed lattice edges, and where cells find them.
#include "kernels/extract/edge_vertices.h"

#include <catch2/catch.hpp>

#include "tests/helpers/analytic_field.h"
#include "tests/helpers/traced_brick.h"

namespace edge_vertices_test {

using namespace tessera;

/// Level, at height 74.25, in the brick from (64, 64, 64) on.
DirectedField level_field() {
  return test::make_field(test::half_space({0, 0, 74.25}, {0, 0, 1}), {64, 64, 64}, {64, 64, 64});
}

TEST_CASE("edge vertices: a level surface has one over every node, named where bricks meet", "[unit]") {
  const DirectedField field = level_field();
  test::TracedBrick brick(field, true);
  const Patch out = brick.patch.finish();
  REQUIRE(out.position.size() == 64 * 64);
  CHECK(out.exported.size() == 2 * 64 - 1);
  for (std::size_t v = 0; v < out.position.size(); ++v) {
    const VertexName name = vertex_name(out.name[v]);
    CHECK(name.type == 2);
    CHECK(name.at[2] == 74);
    const Float3 at = {static_cast<float>(name.at[0] - 64), static_cast<float>(name.at[1] - 64), 10.25f};
    REQUIRE(norm(out.position[v] - at) < 1e-5f);
  }
}

TEST_CASE("edge vertices: cells find theirs, those of the brick beside as foreign ones", "[unit]") {
  const DirectedField field = level_field();
  test::TracedBrick brick(field, true);
  const auto seen = [&](const Int3& cell, int edge) {
    brick.edges.collect(brick.band, *brick.band.at(cell[0] >> 3, cell[1] >> 3, cell[2] >> 3));
    return brick.edges.vertex(cell, edge);
  };
  const std::uint8_t loop_edges[4] = {8, 9, 11, 10};
  const std::uint32_t inner = seen({5, 6, 10}, 8), last = seen({63, 6, 10}, 9);
  CHECK((last & kForeignVertex) != 0);
  CHECK(seen({4, 6, 10}, 9) == inner);
  CHECK_FALSE(brick.edges.moving());
  const TracedLoop loop = brick.edges.loop(field, {4, 6, 10}, 0, loop_edges, 4);
  CHECK(loop.vertex[1] == inner);
  CHECK(loop.after(3) == 0);
  CHECK(norm(mean_point(loop) - Float3{0.5f, 0.5f, 0.25f}) < 1e-5f);
  CHECK(mean_colour(field, loop) == 0);
  const Patch out = brick.patch.finish();
  CHECK(norm(out.position[inner] - Float3{5, 6, 10.25f}) < 1e-5f);
}

}  // namespace edge_vertices_test
