// The first disk along a ray, and what a voxel full of surfels becomes.
#include <catch2/catch.hpp>
#include <vector>

#include "kernels/points/surfel_scene.h"

namespace surfel_scene_test {

using namespace tessera;

TEST_CASE("surfel scene: a ray meets the first disk, through empty bricks and regions", "[unit]") {
  std::vector<JobSurfel> surfels;
  const auto wall = [&](float x, float side) {
    for (int i = 0; i < 3; ++i)
      surfels.push_back({{x, 300.0f + 6.0f * static_cast<float>(i), 300.0f}, {side * 64.0f, 0, 0}, 0, 16});
  };
  wall(3000.0f, 1.0f);
  wall(1500.0f, -1.0f);
  const SurfelScene scene(surfels);
  const Float3 from = {20.0f, 306.0f, 300.0f}, direction = {1.0f, 1e-6f, 1e-6f};
  const SurfelScene::Visibility first = scene.look(from, direction, 1.0f, 1e9f, 99);
  CHECK(first.met);
  CHECK(first.distance == Approx(1480.0f));
  CHECK(first.cosine == Approx(1.0f));
  const SurfelScene::Visibility second = scene.look(from, direction, 1481.0f, 1e9f, 99);
  CHECK(second.distance == Approx(2980.0f));
  CHECK(second.cosine == Approx(-1.0f));
  CHECK_FALSE(scene.look(from, direction, 1.0f, 1400.0f, 99).met);
  CHECK_FALSE(scene.look(from, {-1.0f, 1e-6f, 1e-6f}, 1.0f, 1e9f, 99).met);
  CHECK_FALSE(scene.look({20.0f, 330.0f, 300.0f}, direction, 1.0f, 1e9f, 99).met);
}

TEST_CASE("surfel scene: the sides of a wall stay two disks, many patches of one side become one", "[unit]") {
  std::vector<JobSurfel> surfels;
  for (std::uint32_t patch = 0; patch < 40; ++patch)  // front, at x = 801
    surfels.push_back({{801.0f, 804.0f, 804.0f}, {1.6f, 0, 0}, patch, 1});
  surfels.push_back({{804.5f, 804.0f, 804.0f}, {-64.0f, 0, 0}, 77, 16});  // back
  const SurfelScene scene(surfels);
  for (std::size_t i = 1; i < 40; ++i) CHECK(scene.disk_of(i) == scene.disk_of(0));
  CHECK(scene.disk_of(40) != scene.disk_of(0));
  CHECK(scene.patch_of(scene.disk_of(0)) == SurfelScene::kNobody);
  CHECK(scene.patch_of(scene.disk_of(40)) == 77);
  const Float3 direction = {1.0f, 1e-6f, 1e-6f};
  const SurfelScene::Visibility front =
      scene.look({700.0f, 804.0f, 804.0f}, direction, 0.5f, 1e9f, SurfelScene::kNobody);
  CHECK(front.distance == Approx(101.0f));
  CHECK(front.disk == scene.disk_of(0));
  // From the front through its own disk: the back shuts the view.
  const SurfelScene::Visibility back =
      scene.look({801.0f, 804.0f, 804.0f}, direction, 0.5f, 1e9f, scene.disk_of(0));
  CHECK(back.met);
  CHECK(back.distance == Approx(3.5f));
}

}  // namespace surfel_scene_test
