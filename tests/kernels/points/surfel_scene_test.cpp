// The first disk along a ray, what a voxel full of surfels becomes, and scenes of which only a part is in memory.
#include <catch2/catch.hpp>
#include <vector>

#include "kernels/points/surfel_scene.h"
#include "tests/kernels/points/in_order.h"
#include "tests/kernels/points/job_surfels.h"

namespace surfel_scene_test {

using namespace tessera;

namespace {

/// What a ray meets; `own` is a disk of the first part.
SightRay look(SurfelScene& scene, const Float3& from, const Float3& direction, float near, float far,
              std::uint32_t own = SurfelDisks::kNobody) {
  std::vector<SightRay> rays(1);
  rays[0].from = from, rays[0].direction = direction, rays[0].near = near, rays[0].far = far;
  rays[0].own_part = 0, rays[0].own_disk = own;
  scene.trace(rays);
  return rays[0];
}

SurfelScene scene_of(const SurfelParts& parts, std::uint64_t bytes) {
  SurfelScene scene(parts, bytes, in_order);
  for (std::size_t p = 0; p < parts.parts.size(); ++p) scene.add(p, parts.load(p));
  scene.finish();
  return scene;
}

}  // namespace

TEST_CASE("surfel scene: a ray meets the first disk, through empty bricks and regions", "[unit]") {
  std::vector<JobSurfel> surfels;
  const auto wall = [&](float x, float side) {
    for (int i = 0; i < 3; ++i)
      surfels.push_back({{x, 300.0f + 6.0f * static_cast<float>(i), 300.0f}, {side * 64.0f, 0, 0}, 0, 16});
  };
  wall(3000.0f, 1.0f);
  wall(1500.0f, -1.0f);
  const SurfelParts parts = one_part(surfels);
  SurfelScene scene = scene_of(parts, 1u << 30);
  const Float3 from = {20.0f, 306.0f, 300.0f}, direction = {1.0f, 1e-6f, 1e-6f};
  const SightRay first = look(scene, from, direction, 1.0f, 1e9f);
  CHECK(first.met);
  CHECK(first.distance == Approx(1480.0f));
  CHECK(first.cosine == Approx(1.0f));
  const SightRay second = look(scene, from, direction, 1481.0f, 1e9f);
  CHECK(second.distance == Approx(2980.0f));
  CHECK(second.cosine == Approx(-1.0f));
  CHECK_FALSE(look(scene, from, direction, 1.0f, 1400.0f).met);
  CHECK_FALSE(look(scene, from, {-1.0f, 1e-6f, 1e-6f}, 1.0f, 1e9f).met);
  CHECK_FALSE(look(scene, {20.0f, 330.0f, 300.0f}, direction, 1.0f, 1e9f).met);
}

TEST_CASE("surfel scene: the sides of a wall stay two disks, many patches of one side become one", "[unit]") {
  std::vector<JobSurfel> surfels;
  for (std::uint32_t patch = 0; patch < 40; ++patch)  // front, at x = 801
    surfels.push_back({{801.0f, 804.0f, 804.0f}, {1.6f, 0, 0}, patch, 1});
  surfels.push_back({{804.5f, 804.0f, 804.0f}, {-64.0f, 0, 0}, 77, 16});  // back
  std::vector<std::uint32_t> disk;
  const SurfelDisks disks(surfels, &disk);
  for (std::size_t i = 1; i < 40; ++i) CHECK(disk[i] == disk[0]);
  CHECK(disk[40] != disk[0]);
  CHECK(disks.disk(disk[0]).patch == SurfelDisks::kNobody);
  CHECK(disks.disk(disk[40]).patch == 77);
  const SurfelParts parts = one_part(surfels);
  SurfelScene scene = scene_of(parts, 1u << 30);
  const Float3 direction = {1.0f, 1e-6f, 1e-6f};
  const SightRay front = look(scene, {700.0f, 804.0f, 804.0f}, direction, 0.5f, 1e9f);
  CHECK(front.distance == Approx(101.0f));
  CHECK(front.patch == SurfelDisks::kNobody);
  // From the front through its own disk: the back shuts the view.
  const SightRay back = look(scene, {801.0f, 804.0f, 804.0f}, direction, 0.5f, 1e9f, disk[0]);
  CHECK(back.met);
  CHECK(back.distance == Approx(3.5f));
}

TEST_CASE("surfel scene: rays meet the same disks when one part alone fits", "[unit]") {
  const SurfelParts parts = cut(ball(), 64.0f);
  REQUIRE(parts.parts.size() > 30);
  SurfelScene all = scene_of(parts, 1u << 30), few = scene_of(parts, 1);
  std::vector<SightRay> rays;
  for (int i = 0; i < 500; ++i) {
    const double z = 1.0 - 2.0 * (i + 0.5) / 500, r = std::sqrt(1.0 - z * z), a = 2.399963229728653 * i;
    SightRay ray;
    ray.from = {180.0f, 230.0f, 210.0f};
    ray.direction = {static_cast<float>(r * std::cos(a)) + 1e-6f, static_cast<float>(r * std::sin(a)) + 1e-6f,
                     static_cast<float>(z) + 1e-6f};
    rays.push_back(ray);
    ray.from = {-5.0f + 430.0f * static_cast<float>(i % 2), 210.0f, 190.0f};  // from outside, some past it
    rays.push_back(ray);
  }
  std::vector<SightRay> again = rays;
  all.trace(rays), few.trace(again);
  std::size_t met = 0;
  for (std::size_t i = 0; i < rays.size(); ++i) {
    CHECK(rays[i].met == again[i].met);
    if (!rays[i].met || !again[i].met) continue;
    ++met;
    CHECK(rays[i].distance == again[i].distance);
    CHECK(rays[i].patch == again[i].patch);
  }
  CHECK(met > 400);
  CHECK(met < 1000);
}

}  // namespace surfel_scene_test
