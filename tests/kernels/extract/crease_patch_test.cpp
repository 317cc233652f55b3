// Loops of cells cut along creases: every region is triangulated alone, and what cannot be cut is told.
#include "kernels/extract/crease_patch.h"

#include <catch2/catch.hpp>
#include <cmath>

namespace crease_patch_test {

using namespace tessera;

namespace {

constexpr std::uint8_t kLowX = 1, kHighX = 2, kLowY = 4, kHighY = 8;

/// The level z = 0.5 of a cell, counter-clockwise from above, with kinks on its sides.
/// \param low, high  x of kinks in the faces y = 0 and y = 1, ascending
PatchOutline level(const std::vector<float>& low, const std::vector<float>& high) {
  PatchOutline outline;
  const auto add = [&](float x, float y, unsigned faces) {
    const auto vertex = static_cast<std::uint8_t>(outline.corners.size());
    outline.corners.push_back({{x, y, 0.5f}, vertex, static_cast<std::uint8_t>(faces)});
  };
  add(0, 0, kLowX | kLowY);
  for (const float x : low) add(x, 0, kLowY);
  add(1, 0, kHighX | kLowY);
  add(1, 1, kHighX | kHighY);
  for (auto x = high.rbegin(); x != high.rend(); ++x) add(*x, 1, kHighY);
  add(0, 1, kLowX | kHighY);
  return outline;
}

double area_of(const PatchOutline& outline, const CreasePatch& patch) {
  const auto at = [&](std::uint8_t v) {
    return wide(v < outline.corners.size() ? outline.corners[v].at : patch.inner[v - outline.corners.size()]);
  };
  double sum = 0.0;
  for (const auto& t : patch.triangles) sum += 0.5 * norm(triangle_normal(at(t[0]), at(t[1]), at(t[2])));
  return sum;
}

bool has_edge(const CreasePatch& patch, std::uint8_t a, std::uint8_t b) {
  for (const auto& t : patch.triangles)
    for (std::size_t k = 0; k < 3; ++k)
      if (t[k] == a && t[(k + 1) % 3] == b) return true;
  return false;
}

}  // namespace

TEST_CASE("crease patch: two creases through one cell are edges, both", "[unit]") {
  PatchOutline outline = level({0.3f, 0.6f}, {0.35f, 0.7f});
  // Corners 1, 2 on the side y = 0; 5, 6 on y = 1, from right to left. Between the creases the surface stands up.
  for (const std::size_t c : {1u, 2u, 5u, 6u}) outline.corners[c].at[2] = 0.9f;
  outline.links = {{{1, 6}, {0, 0}}, {{2, 5}, {0, 0}}};
  CreasePatch patch;
  REQUIRE(triangulate_patch(outline, 8, patch));
  CHECK(patch.inner.empty());
  CHECK(patch.triangles.size() == 6);
  for (const auto& [a, b] : {std::pair<std::uint8_t, std::uint8_t>{1, 6}, {2, 5}}) {
    CHECK(has_edge(patch, a, b));
    CHECK(has_edge(patch, b, a));
  }
}

TEST_CASE("crease patch: a corner and a crease beside it", "[unit]") {
  PatchOutline outline = level({0.3f, 0.7f}, {0.75f});
  // Corner 0 .. 3 on y = 0 with kinks 1, 2; kink 5 on y = 1. Three edges meet in the corner: two to kink 1 and the face x = 0,
  // the third runs out in the cell; the crease goes by.
  outline.corners.push_back({{0, 0.6f, 0.5f}, 7, kLowX});
  outline.inner = {{0.3f, 0.6f, 0.8f}, {0.5f, 0.8f, 0.7f}};
  outline.links = {{{1, 8}, {0, 0}}, {{7, 8}, {0, 2}}, {{8, 9}, {1, 0}}, {{2, 5}, {0, 0}}};
  REQUIRE(outline.corners.size() == 8);
  CreasePatch patch;
  SECTION("counter-clockwise") {
    REQUIRE(triangulate_patch(outline, 8, patch));
  }
  SECTION("clockwise") {
    outline.clockwise = true;
    std::swap(outline.links[1].rank[1], outline.links[2].rank[0]);
    REQUIRE(triangulate_patch(outline, 8, patch));
  }
  REQUIRE(patch.inner.size() == 2);
  CHECK(patch.is_corner[0] == 1);
  for (const auto& [a, b] : {std::pair<std::uint8_t, std::uint8_t>{1, 8}, {7, 8}, {8, 9}, {2, 5}}) {
    CHECK(has_edge(patch, a, b));
    CHECK(has_edge(patch, b, a));
  }
}

TEST_CASE("crease patch: straight stretches lose their points, bends keep them", "[unit]") {
  PatchOutline outline = level({0.5f}, {0.5f});
  outline.inner = {{0.5f, 0.25f, 0.5f}, {0.5f, 0.5f, 0.5f}, {0.501f, 0.75f, 0.5f}};
  outline.links = {{{1, 6}, {0, 0}}, {{6, 7}, {1, 0}}, {{8, 7}, {0, 1}}, {{8, 4}, {1, 0}}};
  CreasePatch patch;
  REQUIRE(triangulate_patch(outline, 6, patch));
  CHECK(patch.inner.empty());
  CHECK(area_of(outline, patch) == Approx(1.0));
  outline.inner[1] = {0.6f, 0.5f, 0.5f};
  REQUIRE(triangulate_patch(outline, 6, patch));
  CHECK(patch.inner.size() >= 1);
  CHECK(area_of(outline, patch) == Approx(1.0));
}

TEST_CASE("crease patch: a crease that comes back to its face keeps off it, or is refused", "[unit]") {
  PatchOutline outline = level({0.3f, 0.7f}, {});
  outline.inner = {{0.5f, 0.002f, 0.6f}};
  outline.links = {{{1, 6}, {0, 0}}, {{6, 2}, {1, 0}}};
  CreasePatch patch;
  REQUIRE(triangulate_patch(outline, 6, patch));
  CHECK(patch.inner.size() == 1);
  // A chord between corners of one face that are not next to each other.
  outline = level({0.3f, 0.5f, 0.7f}, {});
  outline.links = {{{1, 3}, {0, 0}}};
  CHECK_FALSE(triangulate_patch(outline, 7, patch));
}

TEST_CASE("crease patch: creases that cross, or whose turn is unknown, are refused", "[unit]") {
  CreasePatch patch;
  PatchOutline outline = level({0.3f, 0.7f}, {0.3f, 0.7f});
  outline.links = {{{1, 5}, {0, 0}}, {{2, 6}, {0, 0}}};
  CHECK_FALSE(triangulate_patch(outline, 8, patch));
  outline = level({0.3f, 0.7f}, {0.5f});
  outline.inner = {{0.5f, 0.5f, 0.7f}};
  outline.links = {{{1, 7}, {0, 255}}, {{2, 7}, {0, 255}}, {{5, 7}, {0, 255}}};
  CHECK_FALSE(triangulate_patch(outline, 7, patch));
}

TEST_CASE("crease patch: a region that would have to fold is refused", "[unit]") {
  CreasePatch patch;
  PatchOutline outline = level({0.5f}, {});
  outline.corners[1].at[2] = 0.6f;
  CHECK(triangulate_patch(outline, 5, patch));
  outline.corners[1].at[2] = 1.9f;
  CHECK_FALSE(triangulate_patch(outline, 5, patch));
}

}  // namespace crease_patch_test
