#include "kernels/blends/blend_hole.h"

#include <catch2/catch.hpp>
#include <set>

#include "tests/helpers/block_meshes.h"

namespace blend_hole_test {

using namespace tessera;
using namespace tessera::test;

using Face = std::array<std::uint32_t, 3>;

TEST_CASE("blend hole: triangles meet a rectangle by what they cover, not by their corners", "[unit]") {
  const auto meets = [](const std::array<Double2, 3>& t) { return meets_rectangle(t, 0.0, 10.0, 2.0); };
  CHECK(meets({{{1, 0}, {2, 0}, {1, 1}}}));
  CHECK(meets({{{-5, -50}, {15, -50}, {5, 50}}}));    // around it, no corner inside
  CHECK(meets({{{5, -9}, {5.1, -9}, {5.05, 9}}}));    // a sliver across
  CHECK_FALSE(meets({{{11, 0}, {12, 0}, {11, 1}}}));  // beyond its end
  CHECK_FALSE(meets({{{9, 4}, {12, 1}, {12, 4}}}));   // its box meets, its long side passes the corner
  CHECK(meets({{{9, 2.5}, {11, 0.5}, {12, 4}}}));     // that one does not pass it
}

TEST_CASE("blend hole: the largest piece stays, with what it surrounds", "[unit]") {
  const MeshBlock block = grid_block(12, 6, [](double, double) { return 0.0; });
  const FaceCorners corners(block);
  std::vector<std::uint8_t> removed(block.faces.size(), 0), wanted(block.faces.size(), 0);
  std::size_t island = removed.size();
  for (std::size_t f = 0; f < removed.size(); ++f) {
    double x = 0.0, y = 0.0;
    for (const std::uint32_t v : block.faces[f])
      x += block.position[v][0] / 3.0, y += block.position[v][1] / 3.0;
    const bool large = x < 5.0 && y > 1.0 && y<5.0, small = x> 8.0 && x < 10.0 && y > 2.0 && y < 4.0;
    wanted[f] = large;
    removed[f] = large || small;
    if (x > 2.0 && x < 3.0 && y > 2.0 && y < 3.0) island = f;
  }
  REQUIRE(island < removed.size());
  removed[island] = 0;
  keep_largest_piece(block, corners, removed);
  CHECK(removed == wanted);
}

TEST_CASE("blend hole: vertices where faces are no manifold are named", "[unit]") {
  const MeshBlock sphere = sphere_block(2);
  std::vector<Face> faces(sphere.faces.begin(), sphere.faces.end());
  const std::size_t n = sphere.position.size();
  std::vector<std::uint8_t> open(faces.size(), 0);
  const auto loose = [&](std::size_t vertices) {
    const std::vector<std::uint32_t> out = loose_vertices(faces, open, vertices);
    return std::set<std::uint32_t>(out.begin(), out.end());
  };
  CHECK(loose(n).empty());
  SECTION("a face is missing") {
    const Face gone = faces.back();
    faces.pop_back();
    open.pop_back();
    CHECK(loose(n) == std::set<std::uint32_t>(gone.begin(), gone.end()));
    for (std::size_t f = 0; f < faces.size(); ++f)
      for (std::size_t k = 0; k < 3; ++k)
        for (std::size_t j = 0; j < 3; ++j)
          if (faces[f][k] == gone[(j + 1) % 3] && faces[f][(k + 1) % 3] == gone[j])
            open[f] = static_cast<std::uint8_t>(open[f] | 1u << k);
    CHECK(loose(n).empty());
  }
  SECTION("a face is there twice") {
    faces.push_back(faces[0]);
    open.push_back(0);
    for (const std::uint32_t v : faces[0]) CHECK(loose(n).count(v) == 1);
  }
  SECTION("two spheres hang together at one vertex") {
    const std::size_t one = faces.size();
    for (std::size_t f = 0; f < one; ++f) {
      Face t = faces[f];
      for (std::uint32_t& v : t) v = v == 0 ? 0 : v + static_cast<std::uint32_t>(n);
      faces.push_back(t);
      open.push_back(0);
    }
    CHECK(loose(2 * n) == std::set<std::uint32_t>{0});
  }
}

}  // namespace blend_hole_test
