#include "kernels/decimate/collapse_bound.h"

#include <catch2/catch.hpp>

#include "tests/helpers/collapse_fixture.h"

namespace tessera::collapse_bound_test {

using test::CollapseFixture;
using test::sheet;

TEST_CASE("collapse bound: what the vertex was off its new faces, and what these were off before", "[unit]") {
  CollapseFixture m = sheet(0.25);
  LinkSides sides;
  const std::size_t at = m.gather(12, 13);
  const auto sum = bound_by_sum(m.mesh, m.vertex[12], m.star, at, sides);
  REQUIRE(sum);
  CHECK(sum->bound == Approx(0.25));
  CHECK(sides.count == 1);
  CHECK(sides.loop[0].size == 6);
  CHECK(sides.flat_edge[0] == kNoFlatEdge);
  m.mesh.face(m.star.corner[0] >> 2).bound = 0.5f;
  CHECK(bound_by_sum(m.mesh, m.vertex[12], m.star, at, sides)->bound == Approx(0.75));
}

TEST_CASE("collapse bound: the foot is where the vertex was, seen from above", "[unit]") {
  CollapseFixture m = sheet(0.25);
  m.at(12) = {2.2, 1.9, 0.25};
  LinkSides sides;
  const auto sum = bound_by_sum(m.mesh, m.vertex[12], m.star, m.gather(12, 13), sides);
  REQUIRE(sum);
  const CollapseFoot& f = sum->foot;
  const Double3 p = m.mesh.at(f.a) * f.wa + m.mesh.at(f.b) * f.wb + m.mesh.at(f.c) * (1.0 - f.wa - f.wb);
  CHECK(p[0] == Approx(2.2));
  CHECK(p[1] == Approx(1.9));
}

TEST_CASE("collapse bound: a collapse that folds has none", "[unit]") {
  CollapseFixture m = sheet();
  m.at(13) = {0.5, 2.0, 0.0};  // behind the ring of 12
  LinkSides sides;
  CHECK_FALSE(bound_by_sum(m.mesh, m.vertex[12], m.star, m.gather(12, 13), sides));
}

TEST_CASE("collapse bound: along a crease both sides are loops, along a border one is", "[unit]") {
  CollapseFixture m = sheet();
  m.at(12)[1] = 2.25;  // the line bends there
  m.mark_creases([](const Double3& p) { return p[1] == 2.0 || p[1] == 2.25; });
  LinkSides sides;
  const auto crease = bound_by_sum(m.mesh, m.vertex[12], m.star, m.gather(12, 13), sides);
  REQUIRE(crease);
  CHECK(crease->bound == Approx(0.25));
  REQUIRE(sides.count == 2);
  for (std::size_t s = 0; s < 2; ++s) CHECK((sides.loop[s].creases >> sides.flat_edge[s] & 1u) == 1);
  CHECK(crease->foot.wa == Approx(0.5));
  CHECK(crease->foot.a == m.vertex[11]);
  for (const std::uint32_t to : {1u, 3u}) {
    const auto border = bound_by_sum(m.mesh, m.vertex[2], m.star, m.gather(2, to), sides);
    REQUIRE(border);
    CHECK(border->bound == 0.0f);
    REQUIRE(sides.count == 1);
    CHECK((sides.loop[0].borders >> sides.flat_edge[0] & 1u) == 1);
  }
}

TEST_CASE("collapse bound: the link of an edge runs around both stars, unless a face turns over or is thin",
          "[unit]") {
  CollapseFixture m = sheet();
  Star other;
  REQUIRE(m.mesh.gather(m.vertex[13], other));
  const std::size_t at = m.gather(12, 13);
  LinkLoop loop;
  REQUIRE(lay_edge_link(m.mesh, m.star, at, other, {2.5, 2.0, 0.0}, 0.1, loop));
  CHECK(loop.size == 9);
  Double3 area{};
  for (std::size_t i = 1; i < 9; ++i) area = area + cross(loop.at[i], loop.at[i < 8 ? i + 1 : 1]);
  CHECK(0.5 * area[2] == Approx(5.0));  // ten faces of one half
  CHECK_FALSE(lay_edge_link(m.mesh, m.star, at, other, {2.5, 2.0, 0.0}, 0.9, loop));
  CHECK_FALSE(lay_edge_link(m.mesh, m.star, at, other, {4.5, 2.0, 0.0}, 0.0, loop));
}

}  // namespace tessera::collapse_bound_test
