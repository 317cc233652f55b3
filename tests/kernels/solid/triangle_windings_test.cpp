#include "kernels/solid/triangle_windings.h"

#include <catch2/catch.hpp>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <utility>
#include <vector>

#include "tests/helpers/random.h"

namespace triangle_windings_test {

namespace {

using namespace tessera;
using Faces = std::vector<std::array<std::uint32_t, 3>>;

/// A cube of side 2 around the origin, each side of n x n x 2 triangles.
void cube(std::uint32_t n, std::vector<Double3>& position, Faces& faces) {
  for (std::size_t axis = 0; axis < 3; ++axis)
    for (const double side : {-1.0, 1.0}) {
      const auto base = static_cast<std::uint32_t>(position.size());
      for (std::uint32_t j = 0; j <= n; ++j)
        for (std::uint32_t i = 0; i <= n; ++i) {
          Double3 p{};
          p[axis] = side;
          p[(axis + 1) % 3] = side * (2.0 * i / n - 1.0);
          p[(axis + 2) % 3] = 2.0 * j / n - 1.0;
          position.push_back(p);
        }
      for (std::uint32_t j = 0; j < n; ++j)
        for (std::uint32_t i = 0; i < n; ++i) {
          const std::uint32_t v = base + j * (n + 1) + i;
          faces.push_back({v, v + 1, v + n + 2});
          faces.push_back({v, v + n + 2, v + n + 1});
        }
    }
}

}  // namespace

TEST_CASE("winding: one inside of a closed mesh, none outside, near and far", "[unit]") {
  std::vector<Double3> position;
  Faces faces;
  cube(20, position, faces);
  const TriangleWindings windings(position, faces);
  test::Random random(5);
  double worst = 0.0;
  for (int i = 0; i < 2000; ++i) {
    const Double3 p = {random.in(-2, 2), random.in(-2, 2), random.in(-2, 2)};
    const double side = std::max({std::fabs(p[0]), std::fabs(p[1]), std::fabs(p[2])});
    if (std::fabs(side - 1.0) < 1e-6) continue;
    worst = std::max(worst, std::fabs(windings.at(p) - (side < 1.0 ? 1.0 : 0.0)));
  }
  CHECK(worst < 5e-3);
  CHECK(windings.at({1e6, 0, 0}) == Approx(0.0).margin(1e-9));
}

TEST_CASE("winding: a hole lets out the part of the directions that it spans", "[unit]") {
  std::vector<Double3> position;
  Faces faces;
  cube(10, position, faces);
  faces.resize(faces.size() - 200);  // one side of six
  const TriangleWindings open(position, faces);
  CHECK(open.at({0, 0, 0}) == Approx(5.0 / 6.0).margin(5e-3));
  for (auto& f : faces) std::swap(f[0], f[1]);
  CHECK(TriangleWindings(position, faces).at({0, 0, 0}) == Approx(-5.0 / 6.0).margin(5e-3));
  CHECK(TriangleWindings(position, Faces{}).at({0, 0, 0}) == 0.0);
}

}  // namespace triangle_windings_test
