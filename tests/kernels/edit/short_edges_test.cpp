// Slivers go with the short edges that make them.
#include "kernels/edit/short_edges.h"

#include <catch2/catch.hpp>
#include <map>
#include <utility>

#include "tests/helpers/surfaces.h"

namespace short_edges_test {

using namespace tessera;
using namespace tessera::test;

TEST_CASE("short edges: a split edge is whole again", "[unit]") {
  Surface s = sphere(2, 1.0);
  const Surface whole = s;
  // A vertex hardly beside vertex 6 on one of its edges: two slivers.
  const std::array<std::uint32_t, 3> first = s.faces[0];
  const std::uint32_t a = first[0], b = first[1], extra = static_cast<std::uint32_t>(s.position.size());
  s.position.push_back(s.position[a] + (s.position[b] - s.position[a]) * 0.01);
  std::vector<std::array<std::uint32_t, 3>> faces;
  for (const auto& f : s.faces) {
    std::size_t at = 3;
    for (std::size_t k = 0; k < 3; ++k)
      if ((f[k] == a && f[(k + 1) % 3] == b) || (f[k] == b && f[(k + 1) % 3] == a)) at = k;
    if (at == 3) {
      faces.push_back(f);
      continue;
    }
    faces.push_back({f[at], extra, f[(at + 2) % 3]});
    faces.push_back({extra, f[(at + 1) % 3], f[(at + 2) % 3]});
  }
  REQUIRE(faces.size() == whole.faces.size() + 2);
  s.faces = faces;
  std::vector<Double3> attached = s.position, none;
  CHECK(merge_short_edges(s.position, s.faces, 0.05, attached) == 1);
  CHECK(s.position == whole.position);
  CHECK(attached == whole.position);
  CHECK(s.faces.size() == whole.faces.size());
  std::map<std::pair<std::uint32_t, std::uint32_t>, int> sides;
  for (const auto& f : s.faces)
    for (std::size_t k = 0; k < 3; ++k) ++sides[{f[k], f[(k + 1) % 3]}];
  for (const auto& [side, count] : sides) {
    CHECK(count == 1);
    CHECK(sides.count({side.second, side.first}) == 1);
  }
  CHECK(merge_short_edges(s.position, s.faces, 0.05, none) == 0);
}

TEST_CASE("short edges: what a merge lays back to back goes", "[unit]") {
  // A fin of two faces on a square: three common neighbours at its short edge.
  std::vector<Double3> position = {{0, 0, 0}, {1, 0, 0}, {1, 1, 0}, {0, 1, 0}, {0.5, 0.5, 1}, {0.01, 0, 0}};
  std::vector<std::array<std::uint32_t, 3>> faces = {{0, 1, 2}, {0, 2, 3}, {0, 2, 4}, {5, 4, 2}};
  std::vector<Double3> none;
  CHECK(merge_short_edges(position, faces, 0.001, none) == 0);
  faces.push_back({0, 5, 4});
  CHECK(merge_short_edges(position, faces, 0.05, none) == 1);
  CHECK(faces == std::vector<std::array<std::uint32_t, 3>>{{0, 1, 2}, {0, 2, 3}});
  CHECK(position.size() == 4);
}

}  // namespace short_edges_test
