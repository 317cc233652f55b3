#include "kernels/decimate/collapse_legality.h"

#include <catch2/catch.hpp>

#include "octree/portable_math.h"
#include "tests/helpers/collapse_fixture.h"

namespace tessera::collapse_legality_test {
namespace {

using test::CollapseFixture;
using test::sheet;

bool is_ok(CollapseFixture& m, std::uint32_t u, std::uint32_t v) {
  const std::size_t at = m.gather(u, v);
  return is_collapse_ok(m.mesh, m.star, at);
}

/// A pyramid of n sides with its base: apex 0, foot 1.
CollapseFixture double_pyramid(std::uint32_t n) {
  std::vector<Double3> position = {{0, 0, 1}, {0, 0, -1}};
  std::vector<std::array<std::uint32_t, 3>> faces;
  for (std::uint32_t i = 0; i < n; ++i) {
    const SinCos angle = sin_cos(2.0 * kPi * i / n);
    position.push_back({angle.cos, angle.sin, 0.0});
    const std::uint32_t a = 2 + i, b = 2 + (i + 1) % n;
    faces.push_back({0, a, b});
    faces.push_back({1, b, a});
  }
  return {position, faces};
}

}  // namespace

TEST_CASE("collapse legality: a third common neighbour refuses, whatever the size of the ring", "[unit]") {
  CollapseFixture three = double_pyramid(3);
  CHECK_FALSE(is_ok(three, 2, 3));  // 0 and 1 are at the edge, 4 is common too
  for (const std::uint32_t n : {4u, 8u, 9u, 20u, 40u}) {
    CollapseFixture m = double_pyramid(n);
    CHECK(is_ok(m, 0, 2));
    CHECK(is_ok(m, 2, 0));
    CHECK(is_ok(m, 2, 3));
  }
}

TEST_CASE("collapse legality: a tetrahedron stays", "[unit]") {
  CollapseFixture m({{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {0, 0, 1}},
                    {{0, 2, 1}, {0, 1, 3}, {1, 2, 3}, {2, 0, 3}});
  for (std::uint32_t u = 0; u < 4; ++u)
    for (std::uint32_t v = 0; v < 4; ++v)
      if (u != v) CHECK_FALSE(is_ok(m, u, v));
}

TEST_CASE("collapse legality: between borders only along the border, and the last face stays", "[unit]") {
  CollapseFixture m = sheet();
  CHECK(is_ok(m, 6, 7));
  CHECK(is_ok(m, 1, 2));
  const std::size_t inwards = m.gather(1, 6);
  CHECK_FALSE(follows_lines(m.mesh, m.vertex[1], m.star, inwards));
  const std::size_t along = m.gather(1, 2);
  CHECK(follows_lines(m.mesh, m.vertex[1], m.star, along));
  CollapseFixture strip({{0, 0, 0}, {1, 0, 0}, {1, 1, 0}, {0, 1, 0}, {2, 0, 0}},
                        {{0, 1, 3}, {1, 2, 3}, {1, 4, 2}});
  CHECK_FALSE(is_ok(strip, 1, 3));  // from border to border through the inside
  CollapseFixture lone({{0, 0, 0}, {1, 0, 0}, {0, 1, 0}}, {{0, 1, 2}});
  CHECK_FALSE(is_ok(lone, 0, 1));
}

TEST_CASE("collapse legality: creases are followed, pinched vertices entered by none", "[unit]") {
  CollapseFixture m = sheet();
  const std::uint32_t u = m.vertex[11];
  m.gather(11, 12);
  for (const std::uint32_t v : {10u, 12u}) m.mesh.mark_crease(prev_corner(m.star.corner[m.gather(11, v)]));
  CHECK(follows_lines(m.mesh, u, m.star, m.gather(11, 6)));  // not yet a vertex of a crease
  m.mesh.add_state(u, kVertexCrease);
  CHECK(follows_lines(m.mesh, u, m.star, m.gather(11, 12)));
  CHECK_FALSE(follows_lines(m.mesh, u, m.star, m.gather(11, 6)));
  m.mesh.add_state(m.vertex[12], kVertexPinched);
  CHECK_FALSE(follows_lines(m.mesh, u, m.star, m.gather(11, 12)));
}

TEST_CASE("collapse legality: no edge between locked vertices is made", "[unit]") {
  CollapseFixture m = sheet();
  m.mesh.add_state(m.vertex[7], kVertexLocked);
  CHECK(is_ok(m, 6, 7));
  m.mesh.add_state(m.vertex[5], kVertexLocked);  // in the ring of 6, not of 7
  CHECK_FALSE(is_ok(m, 6, 7));
}

TEST_CASE("collapse legality: faces that fold or get thin are refused, unless all were thin", "[unit]") {
  CollapseFixture m = sheet();
  const std::uint32_t u = m.vertex[6];
  std::size_t at = m.gather(6, 7);
  CHECK(check_new_faces(m.mesh, u, m.star, at, 0.0) == CollapseRefusal::kNone);
  CHECK(check_new_faces(m.mesh, u, m.star, at, 0.7) == CollapseRefusal::kShape);
  m.mesh.node(u).at = {1.0, 0.001, 0.0};  // thinner than what comes
  CHECK(check_new_faces(m.mesh, u, m.star, at, 0.7) == CollapseRefusal::kNone);
  m.mesh.node(m.vertex[7]).at = {-1.0, -1.0, 0.0};
  CHECK(check_new_faces(m.mesh, u, m.star, at, 0.0) == CollapseRefusal::kFold);
}

}  // namespace tessera::collapse_legality_test
