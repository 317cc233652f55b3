// What creases may do in remeshing: how far chords leave them, and what makes them yield.
#include <catch2/catch.hpp>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <vector>

#include "kernels/mesh/closest_face.h"
#include "kernels/remesh/remesh.h"
#include "kernels/remesh/triangle_quality.h"
#include "octree/portable_math.h"
#include "tests/helpers/block_meshes.h"
#include "tests/helpers/mesh_checks.h"
#include "tests/helpers/remeshed_block.h"

namespace remesher_checks_test {

using namespace tessera;
using namespace tessera::test;

namespace {

/// A closed cylinder of radius and height 1.
MeshBlock cylinder_block(int sides) {
  std::vector<Double3> at = {{0, 0, 0}, {0, 0, 1}};
  std::vector<std::array<std::uint32_t, 3>> faces;
  const auto n = static_cast<std::uint32_t>(sides);
  for (std::uint32_t i = 0; i < n; ++i) {
    const double turn = 2.0 * kPi * i / n, x = std::cos(turn), y = std::sin(turn);
    at.insert(at.end(), {{x, y, 0}, {x, y, 1}});
    const std::uint32_t a = 2 + 2 * i, b = 2 + 2 * ((i + 1) % n);
    faces.insert(faces.end(), {{0, b, a}, {1, a + 1, b + 1}, {a, b, b + 1}, {a, b + 1, a + 1}});
  }
  return make_block(at, faces);
}

/// How far the middle of an edge of a crease lies within the circle, at the most.
double deepest_chord(const MeshBlock& b) {
  double deepest = 0.0;
  for (std::size_t f = 0; f < b.faces.size(); ++f)
    for (std::size_t e = 0; e < 3; ++e) {
      if ((b.face_flags[f] & unsigned{kFaceCrease01} << e) == 0) continue;
      const Double3 middle = (b.position[b.faces[f][e]] + b.position[b.faces[f][(e + 1) % 3]]) * 0.5;
      deepest = std::max(deepest, 1.0 - std::hypot(middle[0], middle[1]));
    }
  return deepest;
}

/// A closed pyramid of height 3 over a polygon of radius 1, in rings: lines that turn by less than 45 degrees meet at its tip.
MeshBlock pyramid_block(int sides) {
  constexpr std::uint32_t kRings = 20;
  std::vector<Double3> at = {{0, 0, 0}, {0, 0, 3}};
  std::vector<std::array<std::uint32_t, 3>> faces;
  const auto n = static_cast<std::uint32_t>(sides);
  for (std::uint32_t r = 0; r < kRings; ++r)
    for (std::uint32_t i = 0; i < n; ++i) {
      const double turn = 2.0 * kPi * i / n, up = static_cast<double>(r) / kRings;
      at.push_back({(1.0 - up) * std::cos(turn), (1.0 - up) * std::sin(turn), 3.0 * up});
      const std::uint32_t a = 2 + r * n + i, b = 2 + r * n + (i + 1) % n;
      if (r == 0) faces.push_back({0, b, a});
      if (r + 1 == kRings)
        faces.push_back({1, a, b});
      else
        faces.insert(faces.end(), {{a, b, b + n}, {a, b + n, a + n}});
    }
  return make_block(at, faces);
}

/// How far points of the pyramid's edges below its tip are from the nearest crease of the block, at the most.
double farthest_from_creases(const MeshBlock& b, int sides) {
  std::vector<std::array<std::uint32_t, 3>> lines;
  for (std::size_t f = 0; f < b.faces.size(); ++f)
    for (std::size_t e = 0; e < 3; ++e)
      if (b.face_flags[f] & unsigned{kFaceCrease01} << e)
        lines.push_back({b.faces[f][e], b.faces[f][(e + 1) % 3], b.faces[f][(e + 1) % 3]});
  REQUIRE_FALSE(lines.empty());
  const ClosestFaces there(b.position, lines, Double3{});
  double farthest = 0.0;
  for (int i = 0; i < sides; ++i) {
    const auto foot = [&](int of) {
      return Double3{std::cos(2.0 * kPi * of / sides), std::sin(2.0 * kPi * of / sides), 0};
    };
    for (int k = 0; k <= 90; ++k)
      for (const Double3& to : {Double3{0, 0, 3}, foot(i + 1)}) {
        const Double3 p = foot(i) + (to - foot(i)) * (k / 100.0);
        farthest = std::max(farthest,
                            there.closest(p, std::numeric_limits<double>::max(), ClosestFaces::kNone).square);
      }
  }
  return std::sqrt(farthest);
}

}  // namespace

TEST_CASE("remesh: on creases that bend edges get as short as their chords ask for", "[unit]") {
  RemeshOptions o = options_for(0.5);
  const MeshBlock even = remeshed(cylinder_block(120), o);
  CHECK(deepest_chord(even) > 0.02);
  o.crease_tolerance = 0.01;
  const MeshBlock graded = remeshed(cylinder_block(120), o);
  CHECK(checks_of(graded).defects() == 0);
  CHECK(deepest_chord(graded) > 0.0);
  CHECK(deepest_chord(graded) < 0.0105);
  CHECK(graded.faces.size() < 6 * even.faces.size());
  TriangleQuality q;
  q.add(graded, 0.5);
  CHECK(q.smallest > 20000);
}

TEST_CASE("remesh: creases keep their place against the shape of faces where chords have to keep to them",
          "[unit]") {
  constexpr int kSides = 12;
  RemeshOptions o = options_for(0.3);
  o.max_faces = 20000;
  CHECK(farthest_from_creases(remeshed(pyramid_block(kSides), o), kSides) > 0.1);
  o.crease_tolerance = 0.006;
  const MeshBlock graded = remeshed(pyramid_block(kSides), o);
  CHECK(checks_of(graded).defects() == 0);
  CHECK(farthest_from_creases(graded, kSides) < 0.006);
}

}  // namespace remesher_checks_test
