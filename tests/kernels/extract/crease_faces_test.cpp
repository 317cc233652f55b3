// Segments with kinks within one face of the lattice: which are sound, and what lies between them and their straight segments.
#include "kernels/extract/crease_faces.h"

#include <catch2/catch.hpp>

namespace crease_faces_test {

using namespace tessera;

namespace {

double area_of(const FaceChain& chain, const std::vector<std::array<std::uint8_t, 3>>& triangles) {
  double sum = 0.0;
  for (const auto& t : triangles) {
    const Double2 &a = chain[t[0]], &b = chain[t[1]], &c = chain[t[2]];
    sum += 0.5 * ((b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]));
  }
  return sum;
}

}  // namespace

TEST_CASE("crease faces: chains that cross or nearly meet are not sound", "[unit]") {
  const FaceChain low = {{0, 0.2}, {0.4, 0.3}, {1, 0.2}};
  CHECK(chains_are_sound({{low}}));
  CHECK(chains_are_sound({{low, FaceChain{{0, 0.7}, {1, 0.7}}}}));
  CHECK(chains_are_sound({{low, FaceChain{{0, 0.7}, {0.4, 0.4}, {1, 0.7}}}}));
  // Through another chain, through another's straight segment alone, and onto it.
  CHECK_FALSE(chains_are_sound({{low, FaceChain{{0, 0.7}, {0.5, 0.1}, {1, 0.7}}}}));
  CHECK_FALSE(chains_are_sound(
      {{FaceChain{{0, 0.2}, {0.5, 0.6}, {1, 0.2}}, FaceChain{{0, 0.5}, {0.5, 0.8}, {1, 0.5}}}}));
  CHECK_FALSE(chains_are_sound({{low, FaceChain{{0, 0.7}, {0.4, 0.3002}, {1, 0.7}}}}));
  // A chain that crosses itself, one that folds back, and one of two kinks at one place.
  CHECK_FALSE(chains_are_sound({{FaceChain{{0, 0.2}, {0.8, 0.2}, {0.8, 0.6}, {0.4, 0.1}, {1, 0.8}}}}));
  CHECK_FALSE(chains_are_sound({{FaceChain{{0, 0.2}, {0.8, 0.2}, {0.4, 0.2001}, {1, 0.8}}}}));
  CHECK_FALSE(chains_are_sound({{FaceChain{{0, 0.2}, {0.5, 0.3}, {0.5, 0.3001}, {1, 0.2}}}}));
  // The first and the last link of a step lie in one line.
  CHECK(chains_are_sound({{FaceChain{{0, 0.2}, {0.3, 0.2}, {0.3, 0.6}, {0.6, 0.6}, {0.6, 0.2}, {1, 0.2}}}}));
}

TEST_CASE("crease faces: what lies between a chain and its segment is covered once", "[unit]") {
  std::vector<std::array<std::uint8_t, 3>> triangles;
  const FaceChain above = {{0, 0.2}, {0.2, 0.6}, {0.5, 0.3}, {0.9, 0.5}, {1, 0.2}};
  REQUIRE(triangulate_flap(above, triangles));
  CHECK(triangles.size() == 3);
  CHECK(area_of(above, triangles) == Approx(-0.5 * (0.2 * 0.4 + 0.3 * 0.5 + 0.4 * 0.4 + 0.1 * 0.3)));
  FaceChain below = above;
  for (Double2& p : below) p[1] = 0.4 - p[1];
  REQUIRE(triangulate_flap(below, triangles));
  CHECK(area_of(below, triangles) == Approx(-area_of(above, triangles)));
  // On both sides of its segment, nearly on it, and without kinks there is none.
  CHECK_FALSE(triangulate_flap({{0, 0.2}, {0.3, 0.4}, {0.7, 0.1}, {1, 0.2}}, triangles));
  CHECK_FALSE(triangulate_flap({{0, 0.2}, {0.5, 0.2001}, {1, 0.2}}, triangles));
  CHECK_FALSE(triangulate_flap({{0, 0.2}, {1, 0.2}}, triangles));
}

}  // namespace crease_faces_test
