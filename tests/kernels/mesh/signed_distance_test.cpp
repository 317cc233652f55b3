#include "kernels/mesh/signed_distance.h"

#include <catch2/catch.hpp>

#include <cmath>

#include "tests/helpers/surfaces.h"

namespace signed_distance_test {

namespace {

using namespace tessera;

MeshBlock block_of(const test::Surface& s, std::uint8_t flags = 0) {
  MeshBlock block;
  block.position = s.position;
  block.faces = s.faces;
  for (std::size_t v = 0; v < s.position.size(); ++v) block.key.push_back(v);
  block.vertex_class.assign(block.key.size(), VertexClass::kSmooth);
  block.face_flags.assign(block.faces.size(), flags);
  return block;
}

}  // namespace

TEST_CASE("signed distance: brute force has the same, signs are those of the solid", "[property]") {
  // A box: most feet far away are on edges and corners, where face normals alone tell wrong sides.
  test::Surface box;
  for (int c = 0; c < 8; ++c)
    box.position.push_back({c & 1 ? 2.0 : 0.0, c & 2 ? 1.0 : 0.0, c & 4 ? 0.25 : 0.0});
  box.faces = {{0, 2, 1}, {1, 2, 3}, {4, 5, 6}, {5, 7, 6}, {0, 1, 4}, {1, 5, 4},
               {2, 6, 3}, {3, 6, 7}, {0, 4, 2}, {2, 4, 6}, {1, 3, 5}, {3, 7, 5}};
  const Double3 origin = {0.3, -0.2, 0.1};
  test::Random random(5);
  for (const test::Surface& s : {box, test::sphere(3, 0.7)}) {
    const SignedDistance field(block_of(s), origin);
    for (int i = 0; i < 4000; ++i) {
      const Double3 p = {random.in(-1, 3), random.in(-1, 2), random.in(-1, 1)};
      double nearest = 1e9;
      for (const auto& f : s.faces)
        nearest = std::min(nearest,
                           test::triangle_distance(p, s.position[f[0]], s.position[f[1]], s.position[f[2]]));
      const SignedDistance::Foot foot = field.closest(p - origin, 1e9);
      REQUIRE(foot.face != SignedDistance::kNone);
      const double d = SignedDistance::signed_distance(p - origin, foot);
      CHECK(std::fabs(std::fabs(d) - nearest) < 1e-12);
      CHECK(std::fabs(norm(p - origin - foot.at) - nearest) < 1e-12);
      const bool inside = s.position.size() == 8
                              ? p[0] > 0 && p[0] < 2 && p[1] > 0 && p[1] < 1 && p[2] > 0 && p[2] < 0.25
                              : norm(p) < 0.68;
      const bool outside = s.position.size() == 8 ? !inside : norm(p) > 0.7;
      if (inside) CHECK(d < 0.0);
      if (outside) CHECK(d > 0.0);
    }
  }
}

TEST_CASE("signed distance: feet beyond a border say so", "[unit]") {
  const test::Surface sheet = test::height_grid(4, 1.0, [](double, double) { return 0.0; });
  MeshBlock block = block_of(sheet);
  for (std::size_t f = 0; f < block.faces.size(); ++f)
    for (std::size_t k = 0; k < 3; ++k) {
      const Double3 &a = block.position[block.faces[f][k]], &b = block.position[block.faces[f][(k + 1) % 3]];
      for (std::size_t axis = 0; axis < 2; ++axis)
        if (a[axis] == b[axis] && (a[axis] == 0.0 || a[axis] == 1.0))
          block.face_flags[f] = static_cast<std::uint8_t>(block.face_flags[f] | 1u << k);
    }
  const SignedDistance field(block, {0, 0, 0});
  CHECK(field.closest({1.5, 0.4, 0.1}, 9.0).border);
  CHECK(field.closest({1.5, 1.5, 0.1}, 9.0).border);
  CHECK_FALSE(field.closest({0.5, 0.4, 0.1}, 9.0).border);
  CHECK(field.closest({0.5, 0.4, 4.0}, 9.0).face == SignedDistance::kNone);
}

}  // namespace signed_distance_test
