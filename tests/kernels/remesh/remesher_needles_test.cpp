// Shapes far shorter than an edge: what remeshing takes away and what it keeps.
#include <catch2/catch.hpp>

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <numeric>
#include <vector>

#include "kernels/mesh/block_contacts.h"
#include "kernels/mesh/flat_faces.h"
#include "kernels/remesh/triangle_quality.h"
#include "tests/helpers/block_meshes.h"
#include "tests/helpers/remeshed_block.h"

namespace remesher_needles_test {

using namespace tessera;
using namespace tessera::test;

namespace {

/// Strips a thousand times as long as wide, apart from each other: splits leave edges as long as they are wide.
MeshBlock long_strips(int count) {
  std::vector<Double3> position;
  std::vector<std::array<std::uint32_t, 3>> faces;
  for (int i = 0; i < count; ++i) {
    const auto first = static_cast<std::uint32_t>(position.size());
    const double y = 10.0 * i;
    position.insert(position.end(), {{0, y, 0}, {100, y, 0}, {100, y + 0.1, 0}, {0, y + 0.1, 0}});
    faces.insert(faces.end(), {{first, first + 1, first + 2}, {first, first + 2, first + 3}});
  }
  return make_block(position, faces);
}

}  // namespace

TEST_CASE("remesh: ribs far narrower than an edge give way, walls as high as edges stay", "[unit]") {
  // Profiles across the ribs, each a crease along all of the plate.
  const auto ribbed = [](double width, double height) {
    constexpr int kRibs = 8, kAlong = 12;
    std::vector<std::array<double, 2>> profile;
    for (int r = 0; r < kRibs; ++r) {
      const double x = 3.0 * r, rib = x + 1.5;
      for (const std::array<double, 2>& p : {std::array<double, 2>{x, 0.0},
                                             {rib, 0.0},
                                             {rib, height},
                                             {rib + width, height},
                                             {rib + width, 0.0}})
        profile.push_back(p);
    }
    profile.push_back({3.0 * kRibs, 0.0});
    std::vector<Double3> position;
    std::vector<std::array<std::uint32_t, 3>> faces;
    for (const auto& [x, z] : profile)
      for (int y = 0; y <= kAlong; ++y) position.push_back({x, static_cast<double>(y), z});
    for (std::uint32_t k = 0; k + 1 < profile.size(); ++k)
      for (std::uint32_t y = 0; y < kAlong; ++y) {
        const std::uint32_t a = k * (kAlong + 1) + y, b = a + kAlong + 1;
        faces.push_back({a, b, b + 1});
        faces.push_back({a, b + 1, a + 1});
      }
    return make_block(position, faces);
  };
  RemeshOptions o = options_for(1.0);
  o.tolerance = 0.2;
  o.collapse_needles = true;
  const MeshBlock low = ribbed(0.05, 0.05), out = remeshed(low, o);
  CHECK(checks_of(out).defects() == 0);
  TriangleQuality q;
  q.add(out, 1.0);
  CHECK(q.faces < 1000);  // 1,400 where ribs stay
  // And four tenths of them are below 25 degrees there.
  CHECK(std::accumulate(q.minimum.begin(), q.minimum.begin() + 25, std::uint64_t{0}) < q.faces / 10);
  CHECK(certified(out, low, 0.1) < 0.3);
  const MeshBlock high = ribbed(0.5, 1.0), kept = remeshed(high, o);
  CHECK(checks_of(kept).defects() == 0);
  CHECK(certified(kept, high, 0.1) < 0.3);
}

TEST_CASE("remesh: faces without area around a pole go, whose border is shorter than rounding", "[unit]") {
  // A quarter of a globe, around the pole of which its border has edges that no number tells from none.
  constexpr int kAround = 60, kDown = 12;
  std::vector<Double3> at;
  std::vector<std::array<std::uint32_t, 3>> faces;
  for (int j = 0; j <= kDown; ++j)
    for (int i = 0; i <= kAround; ++i) {
      const double along = std::numbers::pi * i / kAround, down = 0.5 * std::numbers::pi * j / kDown;
      const double out = j == 0 ? 1e-15 : std::sin(down);
      at.push_back({out * std::cos(along), out * std::sin(along), std::cos(down)});
    }
  for (std::uint32_t j = 0; j < kDown; ++j)
    for (std::uint32_t i = 0; i < kAround; ++i) {
      const std::uint32_t next = i + 1, up = j * (kAround + 1), low = up + kAround + 1;
      faces.push_back({up + i, low + i, low + next});
      faces.push_back({up + i, low + next, up + next});
    }
  const MeshBlock dome = make_block(at, faces);
  const auto flat = [](const MeshBlock& b) {
    return std::count_if(b.faces.begin(), b.faces.end(), [&](const auto& f) {
      return face_extent(b.position[f[0]], b.position[f[1]], b.position[f[2]]).is_flat();
    });
  };
  CHECK(flat(dome) == kAround);
  MeshBlock block = dome;
  RemeshOptions options;
  options.edge = 0.15;
  remesh(block, dome, options);
  CHECK(flat(block) <= 1);  // between two corners of the border that stay
  CHECK(block.faces.size() > 200);
  CHECK(count_contacts(block) == 0);
}

TEST_CASE("remesh: needles that leave no hope of few faces are given up after two iterations", "[unit]") {
  const MeshBlock strips = long_strips(40);
  RemeshOptions o = options_for(2.0);
  o.max_faces = 4000;
  RemeshReport all, given_up;
  const MeshBlock done = remeshed(strips, o, &all);
  REQUIRE(all.by_capacity > 0);
  REQUIRE(done.faces.size() > 1500);
  o.hopeless_faces = 1000;
  const MeshBlock left = remeshed(strips, o, &given_up);
  CHECK(given_up.moves < all.moves / 2);
  CHECK(left.faces.size() > o.hopeless_faces);
  CHECK(checks_of(left).defects() == 0);
  o.hopeless_faces = 4000;  // as many as there is room for: nothing is given up
  RemeshReport kept;
  const MeshBlock again = remeshed(strips, o, &kept);
  CHECK(again.position == done.position);
  CHECK(again.faces == done.faces);
  CHECK(kept.moves == all.moves);
}

}  // namespace remesher_needles_test
