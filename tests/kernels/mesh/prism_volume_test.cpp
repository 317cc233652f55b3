// Volumes over prisms against what is known of them.
#include <catch2/catch.hpp>

#include <cmath>

#include "kernels/mesh/prism_volume.h"
#include "tests/helpers/random.h"

namespace prism_volume_test {

using namespace tessera;

namespace {

const PlanTriangle kFlat({0, 0, 2}, {4, 0, 2}, {0, 4, 2});

CutFill over(const PlanTriangle& first, const PlanTriangle& second) {
  PlanPiece piece(first.shadow());
  piece.clip(second.shadow());
  return piece.between(first, second);
}

}  // namespace

TEST_CASE("prism volume: a flat triangle over a level, above, below and across", "[unit]") {
  const PlanPiece piece(kFlat.shadow());
  CHECK(piece.area() == 8.0);
  const CutFill above = piece.above(kFlat, 0.5);
  CHECK(above.fill == Approx(12.0));
  CHECK(above.cut == 0.0);
  CHECK(piece.above(kFlat, 3.0).cut == Approx(8.0));
  // z = x - 1 over x in [0, 4]: a tetrahedron less what lies below.
  const PlanTriangle slope({0, 0, -1}, {4, 0, 3}, {0, 4, -1});
  const CutFill across = PlanPiece(slope.shadow()).above(slope, 0.0);
  CHECK(across.fill == Approx(4.5));                           // 3 * 3 / 2 * 3 / 3
  CHECK(across.fill - across.cut == Approx(8.0 * (1.0 / 3)));  // area times mean height
}

TEST_CASE("prism volume: a face that shows down has the same shadow, one that stands has none", "[unit]") {
  const PlanTriangle down({0, 0, 2}, {0, 4, 2}, {4, 0, 2});
  CHECK(kFlat.facing() == 1);
  CHECK(down.facing() == -1);
  CHECK(PlanPiece(down.shadow()).area() == 8.0);
  CHECK(PlanTriangle({0, 0, 0}, {1, 1, 0}, {2, 2, 5}).facing() == 0);
}

TEST_CASE("prism volume: two triangles over what their shadows share", "[unit]") {
  const PlanTriangle other({4, 4, 0}, {0, 4, 0},
                           {4, 0, 0});  // the other half of the square: they share a line
  CHECK(over(kFlat, other).area == Approx(0.0).margin(1e-12));
  const PlanTriangle wide({-9, -9, 1}, {9, -9, 1}, {0, 18, 1});
  CHECK(over(kFlat, wide).fill == Approx(8.0));
  CHECK(over(wide, kFlat).cut == Approx(8.0));
  const PlanTriangle far({10, 10, 0}, {11, 10, 0}, {10, 11, 0});
  CHECK(over(kFlat, far).area == 0.0);
}

TEST_CASE("prism volume: random pairs against sums over a grid", "[property]") {
  test::Random random(7);
  for (int n = 0; n < 50; ++n) {
    const auto corner = [&] { return Double3{random.in(0, 1), random.in(0, 1), random.in(-1, 1)}; };
    const PlanTriangle a(corner(), corner(), corner()), b(corner(), corner(), corner());
    const CutFill exact = over(a, b);
    CutFill sum;
    constexpr int kGrid = 500;
    const auto inside = [](const std::array<Double2, 3>& t, const Double2& p) {
      for (std::size_t k = 0; k < 3; ++k) {
        const Double2 &u = t[k], &v = t[(k + 1) % 3];
        if ((v[0] - u[0]) * (p[1] - u[1]) - (v[1] - u[1]) * (p[0] - u[0]) < 0.0) return false;
      }
      return true;
    };
    for (int i = 0; i < kGrid; ++i)
      for (int j = 0; j < kGrid; ++j) {
        const Double2 p = {(i + 0.5) / kGrid, (j + 0.5) / kGrid};
        if (!inside(a.shadow(), p) || !inside(b.shadow(), p)) continue;
        const double d = a.height(p) - b.height(p), cell = 1.0 / (kGrid * kGrid);
        sum.add({cell, d > 0 ? d * cell : 0.0, d < 0 ? -d * cell : 0.0}, 1.0);
      }
    CHECK(exact.area == Approx(sum.area).margin(0.004));
    CHECK(exact.fill == Approx(sum.fill).margin(0.004));
    CHECK(exact.cut == Approx(sum.cut).margin(0.004));
  }
}

TEST_CASE("prism volume: a polygon with a hole is a sum of signed triangles", "[unit]") {
  // An L with a square hole, the outline clockwise.
  const std::vector<std::vector<Double2>> rings = {{{0, 0}, {0, 4}, {2, 4}, {2, 2}, {4, 2}, {4, 0}, {0, 0}},
                                                   {{0.5, 0.5}, {1.5, 0.5}, {1.5, 1.5}, {0.5, 1.5}}};
  const PlanTriangle wide({-20, -20, 1}, {40, -20, 1}, {-20, 40, 1});
  CutFill sum;
  for (const SignedTriangle& t : triangles_of_rings(rings)) {
    PlanPiece piece(wide.shadow());
    piece.clip(t.corner);
    sum.add(piece.above(wide, 0.0), t.sign);
  }
  CHECK(sum.area == Approx(11.0));
  CHECK(sum.fill == Approx(11.0));
}

}  // namespace prism_volume_test
