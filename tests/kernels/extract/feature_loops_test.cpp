// Loops that a feature passes: which they are, how they are found, and their faces.
#include "kernels/extract/feature_loops.h"

#include <catch2/catch.hpp>

#include "tests/helpers/analytic_field.h"
#include "tests/helpers/traced_brick.h"

namespace feature_loops_test {

using namespace tessera;

/// An edge along x at (y, z) = (90.4, 100.6).
DirectedField edge_field() {
  return test::make_field(
      test::intersect(test::half_space({0, 90.4, 0}, {0, 1, 0}), test::half_space({0, 0, 100.6}, {0, 0, 1})),
      {64, 64, 64}, {64, 64, 64});
}

TEST_CASE("feature loops: a loop is found by the edges of its cell, and by no others", "[unit]") {
  const DirectedField field = edge_field();
  test::TracedBrick brick(field);
  brick.trace();
  const Int3 cell = {7, 26, 36};
  FeatureLoop* found = nullptr;
  for (int edge = 0; edge < kCellEdges; ++edge)
    if (FeatureLoop* loop = brick.features.find(brick.band, cell, edge)) {
      found = loop;
      bool has_edge = false;
      for (std::size_t s = 0; s < loop->size; ++s)
        has_edge = has_edge || brick.features.corner(*loop, s).edge == edge;
      CHECK(has_edge);
    }
  REQUIRE(found);
  CHECK(found->cell == cell);
  CHECK(brick.features.corner(*found, found->size).edge == brick.features.corner(*found, 0).edge);
  for (int edge = 0; edge < kCellEdges; ++edge) {
    CHECK(brick.features.find(brick.band, {7, 20, 36}, edge) == nullptr);  // flat
    CHECK(brick.features.find(brick.band, {7, 30, 50}, edge) == nullptr);  // empty
  }
}

TEST_CASE("feature loops: a loop across the edge has a crease, one beside it nothing", "[unit]") {
  const DirectedField field = edge_field();
  test::TracedBrick brick(field);
  brick.edges.collect(brick.band, *brick.band.at(0, 3, 4));
  REQUIRE((brick.band.at(0, 3, 4)->active[4] >> (7 + 8 * 2) & 1) != 0);
  const CellLoops& loops = unambiguous_loops(0b00000011);  // inside: both ends of the edge at min y, min z
  REQUIRE(loops.count == 1);
  REQUIRE(loops.length[0] == 4);
  TracedLoop loop = brick.edges.loop(field, {7, 26, 36}, 0, loops.edge.data(), 4);
  const FeatureSample sharp = feature_of(brick.input, loop);
  CHECK(sharp.kind == FeatureKind::kCrease);
  CHECK(sharp.position[1] == Approx(0.4f).margin(1e-4));
  CHECK(sharp.position[2] == Approx(0.6f).margin(1e-4));
  const CellLoops& top = unambiguous_loops(0b00001111);
  TracedLoop flat = brick.edges.loop(field, {7, 25, 36}, 0, top.edge.data(), 4);
  CHECK(feature_of(brick.input, flat).kind == FeatureKind::kNone);
}

TEST_CASE("feature loops: segments along an edge are flipped onto it", "[unit]") {
  const DirectedField field = edge_field();
  test::TracedBrick brick(field);
  brick.trace();
  const std::size_t before = brick.patch.faces();
  // One flip with each neighbour along the edge; the brick owns its min side, not its max side.
  emit_feature_segments(brick.input, brick.features, false, brick.patch, brick.report);
  CHECK(brick.report.flips == 64);
  // A cell has four segments. Those to its neighbours along the edge give two faces together, the others one each.
  CHECK(brick.patch.faces() == before + 64 * 2 + 64 * 2);
}

}  // namespace feature_loops_test
