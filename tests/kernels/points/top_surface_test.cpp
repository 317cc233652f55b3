// What the highest surface of a scene tells of how it was scanned, and of the sides of what is steep.
#include <catch2/catch.hpp>
#include <cmath>

#include "kernels/points/top_surface.h"
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

}  // namespace

TEST_CASE("top surface: roofs over a street show upwards like the street", "[unit]") {
  std::vector<JobSurfel> surfels;
  add_square(surfels, 4.0f, 800.0f, 100.0f, 0);
  add_square(surfels, 150.0f, 350.0f, 400.0f, 1);  // nothing joins it to the street
  add_square(surfels, 450.0f, 650.0f, 200.0f, 2);
  const TopSurface above(surfels, {0, 0, 1});
  CHECK(above.covered_share() == Approx(2.0 * 25 * 25 / (100.0 * 100 + 2.0 * 25 * 25)).margin(0.01));
  for (std::uint32_t g = 0; g < 3; ++g) CHECK(shown(above.votes(3, kScale), g) < 0);
  const TopSurface flipped(surfels, {0, 0, -1});
  for (std::uint32_t g = 0; g < 3; ++g) CHECK(shown(flipped.votes(3, kScale), g) > 0);
}

TEST_CASE("top surface: a facade shows to the street, not into the house, whichever way it was turned",
          "[unit]") {
  std::vector<JobSurfel> surfels;
  add_square(surfels, 4.0f, 800.0f, 100.0f, 0);
  add_square(surfels, 150.0f, 350.0f, 260.0f, 1);
  add_wall(surfels, 146.0f, 108.0f, 256.0f, 2);  // its front looks at the roof's side
  add_wall(surfels, 354.0f, 108.0f, 256.0f, 3);
  const std::vector<PatchVote> votes = TopSurface(surfels, {0, 0, 1}).votes(4, kScale);
  CHECK(shown(votes, 2) < 0);
  CHECK(shown(votes, 3) > 0);
}

TEST_CASE("top surface: of a ball, half of what is level is covered", "[unit]") {
  const std::vector<JobSurfel> surfels = ball();
  for (const Float3& up : {Float3{0, 0, 1}, Float3{1, 0, 0}, Float3{0.6f, 0.0f, 0.8f}})
    CHECK(TopSurface(surfels, up).covered_share() == Approx(0.5).margin(0.05));
}

}  // namespace top_surface_test
