#include "kernels/texture/chart_overlap.h"

#include <catch2/catch.hpp>

namespace chart_overlap_test {

using namespace tessera;

TEST_CASE("chart overlap: neighbours do not, crossing and containing ones do", "[unit]") {
  const std::array<Double2, 3> a = {{{0, 0}, {4, 0}, {0, 4}}};
  CHECK_FALSE(triangles_overlap(a, {{{4, 0}, {4, 4}, {0, 4}}}, 1e-9));    // beside the long edge
  CHECK_FALSE(triangles_overlap(a, {{{0, 0}, {-4, 0}, {0, -4}}}, 1e-9));  // a corner
  CHECK(triangles_overlap(a, {{{1, 1}, {5, 1}, {1, 5}}}, 1e-9));
  CHECK(triangles_overlap(a, {{{0.5, 0.5}, {1, 0.5}, {0.5, 1}}}, 1e-9));
  CHECK(triangles_overlap(a, a, 1e-9));
  CHECK_FALSE(triangles_overlap(a, {{{1, 1}, {2, 2}, {3, 3}}}, 1e-9));  // has no area
}

TEST_CASE("chart overlap: a fan that goes around twice loses its second turn", "[unit]") {
  // Eight sectors of a right angle around the origin.
  std::vector<Double2> uv = {{0, 0}};
  std::vector<std::array<std::uint32_t, 3>> faces;
  const std::array<Double2, 4> corner = {{{1, 0}, {0, 1}, {-1, 0}, {0, -1}}};
  for (std::uint32_t i = 0; i <= 8; ++i) uv.push_back(corner[i % 4]);
  for (std::uint32_t i = 0; i < 8; ++i) faces.push_back({0, i + 1, i + 2});
  CHECK(overlapping_faces(uv, faces) == std::vector<std::uint32_t>{4, 5, 6, 7});
  faces.resize(4);
  CHECK(overlapping_faces(uv, faces).empty());
}

}  // namespace chart_overlap_test
