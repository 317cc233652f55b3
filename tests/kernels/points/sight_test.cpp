// What surfels see tells how a scene was scanned, and which side of them shows.
#include <catch2/catch.hpp>
#include <cmath>

#include "kernels/points/sight.h"
#include "tests/kernels/points/in_order.h"

using namespace tessera;

namespace {

constexpr double kScale = 4096.0;

JobSurfel surfel(const Float3& at, const Float3& normal, std::uint32_t group, float points) {
  JobSurfel s;
  s.position = at;
  for (std::size_t a = 0; a < 3; ++a) s.area[a] = 64.0f * normal[a];
  s.patch = group, s.surfels = 16, s.points = points;
  return s;
}

/// A level square of surfels, 8 cells apart.
void add_square(std::vector<JobSurfel>& surfels, float low, float high, float z, std::uint32_t group) {
  for (float y = low; y < high; y += 8.0f)
    for (float x = low; x < high; x += 8.0f) surfels.push_back(surfel({x, y, z}, {0, 0, -1}, group, 10.0f));
}

/// A ball whose normals show outwards. \param dense  times as many points on its lowest part as elsewhere
std::vector<JobSurfel> ball(float dense) {
  std::vector<JobSurfel> surfels;
  constexpr int kCount = 4000;
  for (int i = 0; i < kCount; ++i) {
    const double z = 1.0 - 2.0 * (i + 0.5) / kCount, r = std::sqrt(1.0 - z * z), a = 2.399963229728653 * i;
    const Float3 n = {static_cast<float>(r * std::cos(a)), static_cast<float>(r * std::sin(a)),
                      static_cast<float>(z)};
    surfels.push_back(surfel({200.0f + 140.0f * n[0], 200.0f + 140.0f * n[1], 200.0f + 140.0f * n[2]}, n, 0,
                             z < -0.9 ? 10.0f * dense : 10.0f));
  }
  return surfels;
}

std::int64_t shown(const SightVotes& v, std::uint32_t group) {
  for (const PatchVote& side : v.sides)
    if (side.a == group) return side.same - side.opposite;
  return 0;
}

}  // namespace

TEST_CASE("sight: roofs over a street, seen from above, show upwards like the street", "[unit]") {
  std::vector<JobSurfel> surfels;
  add_square(surfels, 4.0f, 800.0f, 100.0f, 0);
  add_square(surfels, 150.0f, 350.0f, 400.0f, 1);  // nothing joins it to the street
  add_square(surfels, 450.0f, 650.0f, 200.0f, 2);
  const SightVotes v = vote_by_sight(surfels, 3, {0, 0, 1}, kScale, in_order);
  CHECK(v.scene == SceneKind::kFromAbove);
  CHECK(v.pairs.empty());
  for (std::uint32_t g = 0; g < 3; ++g) CHECK(shown(v, g) < 0);  // the surfels were given downwards
  for (JobSurfel& s : surfels) s.position[2] = 600.0f - s.position[2];
  const SightVotes turned = vote_by_sight(surfels, 3, {0, 0, -1}, kScale, in_order);
  CHECK(turned.scene == SceneKind::kFromAbove);
  for (std::uint32_t g = 0; g < 3; ++g) CHECK(shown(turned, g) > 0);
}

TEST_CASE("sight: a shell with even density is an object, one that is dense at one place a room", "[unit]") {
  const SightVotes object = vote_by_sight(ball(1.0f), 1, {0, 0, 1}, kScale, in_order);
  CHECK(object.scene == SceneKind::kObject);
  CHECK(shown(object, 0) > 0);
  const SightVotes room = vote_by_sight(ball(100.0f), 1, {0, 0, 1}, kScale, in_order);
  CHECK(room.scene == SceneKind::kRoom);
  CHECK(room.pairs.empty());
  CHECK(shown(room, 0) < 0);
}

TEST_CASE("sight: a wide bore through an object does not make it a room, however many surfels it has",
          "[unit]") {
  std::vector<JobSurfel> surfels;
  for (const double radius : {400.0, 500.0}) {
    const auto around = static_cast<int>(6.283185307179586 * radius / 4.0);
    for (int i = 0; i < around; ++i) {
      const double a = 6.283185307179586 * i / around;
      const auto x = static_cast<float>(std::cos(a)), y = static_cast<float>(std::sin(a));
      const auto r = static_cast<float>(radius);
      for (float z = 4.0f; z < 604.0f; z += 4.0f)
        surfels.push_back(surfel({600.0f + r * x, 600.0f + r * y, z}, {x, y, 0}, r > 450.0f ? 1 : 0, 10.0f));
    }
  }
  const SightVotes v = vote_by_sight(surfels, 2, {0, 0, 1}, kScale, in_order);
  CHECK(v.enclosed < 0.002);
  CHECK(v.scene != SceneKind::kRoom);
}
