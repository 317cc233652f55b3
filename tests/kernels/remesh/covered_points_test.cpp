#include "kernels/remesh/covered_points.h"

#include <catch2/catch.hpp>

#include <vector>

#include "tests/helpers/block_meshes.h"

namespace covered_points_test {

using namespace tessera;
using namespace tessera::test;

namespace {

std::size_t count_all(const CoveredPoints& covered, const CollapseMesh& mesh) {
  std::size_t points = 0;
  for (std::uint32_t f = 0; f < mesh.faces().size(); ++f) points += covered.count(f);
  return points;
}

std::array<Double3, 3> corners_of(const CollapseMesh& mesh, std::uint32_t f, const Double3& moved = {}) {
  std::array<Double3, 3> at;
  for (std::size_t i = 0; i < 3; ++i) at[i] = mesh.at(mesh.face(f).vertex[i]) + moved;
  return at;
}

}  // namespace

TEST_CASE(
    "covered points: every vertex, edge and face of what is near is somebody's, what is far is nobody's",
    "[unit]") {
  const MeshBlock sheet = grid_block(4, 4, [](double, double) { return 0.0; });
  const MeshBlock fine =
      grid_block(8, 4, [](double, double) { return 0.05; });  // half of it beside the sheet
  const CollapseMesh mesh(sheet, Double3{});
  const CoveredPoints covered(mesh, fine.position, fine.faces, 0.1);
  // 5 x 5 vertices, 16 squares of two faces; edges inside and half of those of the border.
  std::size_t edges = 0;
  for (const auto& f : fine.faces)
    for (std::size_t k = 0; k < 3; ++k) {
      const Double3 middle = (fine.position[f[k]] + fine.position[f[(k + 1) % 3]]) * 0.5;
      edges += f[k] < f[(k + 1) % 3] && middle[0] <= 4.0;
    }
  CHECK(edges > 40);
  CHECK(count_all(covered, mesh) == 25 + 32 + edges);
  const CoveredPoints none(mesh, fine.position, fine.faces, 0.03);
  CHECK(count_all(none, mesh) == 0);
}

TEST_CASE("covered points: an edit that leaves one too far away is not near, one that was far may stay so",
          "[unit]") {
  const MeshBlock sheet = grid_block(4, 4, [](double, double) { return 0.0; });
  const CollapseMesh mesh(sheet, Double3{});
  const std::array<std::uint32_t, 1> face = {9};
  const auto stays = [&](double height, double limit, double up) {
    const MeshBlock above = grid_block(4, 4, [&](double, double) { return height; });
    const CoveredPoints covered(mesh, above.position, above.faces, limit);
    REQUIRE(covered.count(face[0]) > 0);
    return covered.stay_near(face, std::vector{corners_of(mesh, face[0], {0.0, 0.0, up})});
  };
  CHECK(stays(0.0, 0.1, 0.09));
  CHECK_FALSE(stays(0.0, 0.1, 0.11));
  CHECK(stays(0.11, 0.1, 0.0));
  CHECK_FALSE(stays(0.11, 0.1, -0.005));
}

TEST_CASE("covered points: a flip hands points on to the nearer of its faces, and loses none", "[unit]") {
  const MeshBlock sheet = grid_block(4, 4, [](double, double) { return 0.0; });
  const MeshBlock fine = grid_block(40, 40, [](double, double) { return 0.0; });
  std::vector<Double3> position = fine.position;
  for (Double3& p : position) p = p * 0.1;
  CollapseMesh mesh(sheet, Double3{});
  CoveredPoints covered(mesh, position, fine.faces, 0.01);
  std::uint32_t c = 0;
  while ((c & 3u) == 3u || mesh.opposite(c) == kNoCorner ||
         mesh.at(mesh.vertex(next_corner(c)))[0] == mesh.at(mesh.vertex(prev_corner(c)))[0] ||
         mesh.at(mesh.vertex(next_corner(c)))[1] == mesh.at(mesh.vertex(prev_corner(c)))[1])
    ++c;
  const std::array<std::uint32_t, 2> faces = {c >> 2, mesh.opposite(c) >> 2};
  const std::size_t all = count_all(covered, mesh);
  const std::size_t both = covered.count(faces[0]) + covered.count(faces[1]);
  mesh.flip(c);
  covered.hand_on(faces, faces);
  CHECK(count_all(covered, mesh) == all);
  CHECK(covered.count(faces[0]) + covered.count(faces[1]) == both);
  for (const std::uint32_t f : faces) {
    CHECK(covered.count(f) > both / 3);
    const std::array<std::uint32_t, 1> one = {f};
    CHECK(covered.stay_near(one, std::vector{corners_of(mesh, f)}));
  }
}

}  // namespace covered_points_test
