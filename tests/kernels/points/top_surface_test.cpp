// What the highest surface of a scene tells of how it was scanned, and of the sides of what is steep.
#include <catch2/catch.hpp>
#include <cmath>

#include "kernels/points/top_surface.h"
#include "octree/vector.h"
#include "tests/helpers/random.h"
#include "tests/kernels/points/job_surfels.h"

namespace top_surface_test {

using namespace tessera;

namespace {

constexpr double kScale = 4096.0;

/// A level square of surfels that show downwards, 8 cells apart.
void add_square(std::vector<JobSurfel>& surfels, float low, float high, float z, std::uint32_t group) {
  for (float y = low; y < high; y += 8.0f)
    for (float x = low; x < high; x += 8.0f) surfels.push_back(surfel({x, y, z}, {0, 0, -1}, group));
}

/// A wall across x that shows to +x.
void add_wall(std::vector<JobSurfel>& surfels, float x, float low, float high, std::uint32_t group) {
  for (float z = low; z < high; z += 8.0f)
    for (float y = 150.0f; y < 350.0f; y += 8.0f) surfels.push_back(surfel({x, y, z}, {1, 0, 0}, group));
}

std::int64_t shown(const std::vector<PatchVote>& votes, std::uint32_t group) {
  for (const PatchVote& v : votes)
    if (v.a == group) return v.same - v.opposite;
  return 0;
}

/// Surfels of a crown, each a patch of its own that faces any way.
void add_crown(std::vector<JobSurfel>& surfels, test::Random& random, const Float3& middle, float radius) {
  for (int i = 0; i < 60; ++i) {
    Float3 at, normal;
    for (std::size_t a = 0; a < 3; ++a) {
      at[a] = middle[a] + static_cast<float>(random.in(-1.0, 1.0)) * radius;
      normal[a] = static_cast<float>(random.in(-1.0, 1.0));
    }
    const auto patch = static_cast<std::uint32_t>(surfels.size());
    surfels.push_back(surfel(at, unit(normal), patch));
    for (float& a : surfels.back().area) a *= 0.3f;
  }
}

/// Rings of surfels about a limb from `from` to `to` that face away from it.
void add_limb(std::vector<JobSurfel>& surfels, const Float3& from, const Float3& to, float radius) {
  const Float3 axis = unit(to - from);
  const Float3 u = unit(cross(axis, std::fabs(axis[2]) < 0.5f ? Float3{0, 0, 1} : Float3{1, 0, 0}));
  const Float3 v = cross(axis, u);
  const float length = norm(to - from);
  for (float along = 0.0f; along <= length; along += 5.0f)
    for (int k = 0; k < 8; ++k) {
      const float angle = 0.7853982f * static_cast<float>(k);
      const Float3 out = u * std::cos(angle) + v * std::sin(angle);
      surfels.push_back(surfel(from + axis * along + out * radius, out, static_cast<std::uint32_t>(k % 2)));
    }
}

}  // namespace

TEST_CASE("top surface: a forest was seen from above though its crowns cover the ground", "[unit]") {
  std::vector<JobSurfel> surfels;
  test::Random random(3);
  add_square(surfels, 4.0f, 400.0f, 100.0f, 0);
  for (float y = 20.0f; y < 400.0f; y += 40.0f)
    for (float x = 20.0f; x < 400.0f; x += 40.0f) add_crown(surfels, random, {x, y, 160.0f}, 20.0f);
  const TopSurface above(surfels, {0, 0, 1});
  CHECK(above.covered_share() > 0.5);
  CHECK(above.roofed_share() < 0.01);
  CHECK(above.seen_from_above());
  // The same crowns as one surface are a ceiling.
  std::vector<std::uint32_t> group(surfels.size(), 1);
  group[0] = 0;
  const TopSurface roofed(surfels, {0, 0, 1}, group);
  CHECK(roofed.covered_share() == above.covered_share());
  CHECK(roofed.roofed_share() > 0.5);
  CHECK_FALSE(roofed.seen_from_above());
}

TEST_CASE("top surface: ground with trees that show their flanks is land, trees alone are not", "[unit]") {
  std::vector<JobSurfel> surfels;
  test::Random random(5);
  const auto add_trees = [&] {
    for (float y = 20.0f; y < 400.0f; y += 40.0f)
      for (float x = 20.0f; x < 400.0f; x += 40.0f) {
        add_crown(surfels, random, {x, y, 260.0f}, 20.0f);
        add_limb(surfels, {x, y, 110.0f}, {x, y, 240.0f}, 4.0f);
      }
  };
  add_square(surfels, 4.0f, 400.0f, 100.0f, 0);
  add_trees();
  const TopSurface clearing(surfels, {0, 0, 1});
  CHECK(clearing.covered_share() > 0.3);
  CHECK(clearing.level_share() < 0.5);
  CHECK(clearing.ground_share() > 0.6);
  CHECK(clearing.seen_from_above());
  surfels.clear();
  add_trees();
  const TopSurface trees(surfels, {0, 0, 1});
  CHECK(trees.covered_share() > 0.3);
  CHECK(trees.ground_share() < 0.1);
  CHECK_FALSE(trees.seen_from_above());
}

TEST_CASE("top surface: a small clearing with trees is land, a shrub without its ground is not", "[unit]") {
  std::vector<JobSurfel> surfels;
  test::Random random(6);
  const auto add_trees = [&] {
    for (float y = 20.0f; y < 100.0f; y += 30.0f)
      for (float x = 20.0f; x < 100.0f; x += 30.0f) {
        add_crown(surfels, random, {x, y, 200.0f}, 14.0f);
        add_limb(surfels, {x, y, 110.0f}, {x, y, 190.0f}, 3.0f);
      }
  };
  add_square(surfels, 4.0f, 108.0f, 100.0f, 0);
  add_trees();
  const TopSurface clearing(surfels, {0, 0, 1});
  CHECK(clearing.columns().columns().size() < 256);
  CHECK(clearing.covered_share() > 0.3);
  CHECK(clearing.ground_share() > 0.8);
  CHECK(clearing.roofed_share() < 0.06);
  CHECK(clearing.seen_from_above());
  surfels.clear();
  add_trees();
  const TopSurface trees(surfels, {0, 0, 1});
  CHECK(trees.columns().columns().size() < 256);
  CHECK(trees.covered_share() > 0.3);
  CHECK_FALSE(trees.seen_from_above());
}

TEST_CASE("top surface: a room was not seen from above, however small or wide", "[unit]") {
  const float wide = GENERATE(60.0f, 400.0f), high = GENERATE(20.0f, 60.0f);
  CAPTURE(wide, high);
  std::vector<JobSurfel> surfels;
  add_square(surfels, 4.0f, wide, 100.0f, 0);
  add_square(surfels, 4.0f, wide, 100.0f + high, 1);
  for (float z = 104.0f; z < 100.0f + high; z += 8.0f)
    for (float x = 4.0f; x < wide; x += 8.0f) {
      surfels.push_back(surfel({x, 4.0f, z}, {0, 1, 0}, 2));
      surfels.push_back(surfel({x, wide, z}, {0, -1, 0}, 3));
    }
  const TopSurface room(surfels, {0, 0, 1});
  CHECK(room.covered_share() == Approx(0.5).margin(0.02));
  CHECK(room.roofed_share() == Approx(0.5).margin(0.02));
  CHECK_FALSE(room.seen_from_above());
}

TEST_CASE("top surface: a small animal was not seen from above, a small slope was", "[unit]") {
  std::vector<JobSurfel> animal;
  add_limb(animal, {10, 16, 30}, {50, 16, 30}, 4.0f);
  for (const float x : {12.0f, 48.0f})
    for (const float y : {13.0f, 19.0f}) add_limb(animal, {x, y, 0}, {x, y, 26}, 1.5f);
  CHECK(TopSurface(animal, {0, 0, 1}).covered_share() > 0.3);
  CHECK_FALSE(TopSurface(animal, {0, 0, 1}).seen_from_above());

  // Steeper than the depth that counts as covered, measured within a column.
  std::vector<JobSurfel> slope;
  for (float y = 1.0f; y < 48.0f; y += 2.0f)
    for (float x = 1.0f; x < 48.0f; x += 2.0f)
      slope.push_back(surfel({x, y, 10.0f + 1.4f * x}, unit(Float3{-1.4f, 0, 1}), 0));
  CHECK(TopSurface(slope, {0, 0, 1}).covered_share() == 0.0);
  CHECK(TopSurface(slope, {0, 0, 1}).level_share() == Approx(1.0 / std::sqrt(1.0 + 1.4 * 1.4)).margin(1e-4));
}

TEST_CASE("top surface: roofs over a street show upwards like the street", "[unit]") {
  std::vector<JobSurfel> surfels;
  add_square(surfels, 4.0f, 800.0f, 100.0f, 0);
  add_square(surfels, 150.0f, 350.0f, 400.0f, 1);  // nothing joins it to the street
  add_square(surfels, 450.0f, 650.0f, 200.0f, 2);
  const TopSurface above(surfels, {0, 0, 1});
  CHECK(above.covered_share() == Approx(2.0 * 25 * 25 / (100.0 * 100 + 2.0 * 25 * 25)).margin(0.01));
  for (std::uint32_t g = 0; g < 3; ++g) CHECK(shown(vote_by_top(surfels, above.columns(), 3, kScale), g) < 0);
  const TopSurface flipped(surfels, {0, 0, -1});
  for (std::uint32_t g = 0; g < 3; ++g)
    CHECK(shown(vote_by_top(surfels, flipped.columns(), 3, kScale), g) > 0);
}

TEST_CASE("top surface: a facade shows to the street, not into the house, whichever way it was turned",
          "[unit]") {
  std::vector<JobSurfel> surfels;
  add_square(surfels, 4.0f, 800.0f, 100.0f, 0);
  add_square(surfels, 150.0f, 350.0f, 260.0f, 1);
  add_wall(surfels, 146.0f, 108.0f, 256.0f, 2);  // its front looks at the roof's side
  add_wall(surfels, 354.0f, 108.0f, 256.0f, 3);
  const std::vector<PatchVote> votes =
      vote_by_top(surfels, TopSurface(surfels, {0, 0, 1}).columns(), 4, kScale);
  CHECK(shown(votes, 2) < 0);
  CHECK(shown(votes, 3) > 0);
}

TEST_CASE("top surface: of a ball, half of what is level is covered", "[unit]") {
  const std::vector<JobSurfel> surfels = ball();
  for (const Float3& up : {Float3{0, 0, 1}, Float3{1, 0, 0}, Float3{0.6f, 0.0f, 0.8f}})
    CHECK(TopSurface(surfels, up).covered_share() == Approx(0.5).margin(0.05));
}

}  // namespace top_surface_test
