// What lies on a surface stays, what is strewn through space goes.
#include <catch2/catch.hpp>
#include <cmath>
#include <utility>

#include "kernels/points/normals.h"
#include "kernels/points/volumetric_points.h"
#include "octree/points.h"

namespace volumetric_points_test {

using namespace tessera;

namespace {

struct Cloud {
  std::vector<Float3> position;
  std::vector<float> roughness;
  std::vector<std::uint16_t> flags;
  void add(const Float3& p, float rough, std::uint16_t flag = 0) {
    position.push_back(p), roughness.push_back(rough), flags.push_back(flag);
  }
};

std::size_t count(const std::vector<std::uint8_t>& volumetric, std::size_t first, std::size_t end) {
  std::size_t n = 0;
  for (std::size_t i = first; i < end; ++i) n += volumetric[i];
  return n;
}

}  // namespace

TEST_CASE("scatter: leaves go, a floor and its rough edge stay", "[unit]") {
  Cloud c;
  for (float y = 0.5f; y < 32.0f; y += 1.0f)
    for (float x = 0.5f; x < 32.0f; x += 1.0f) c.add({x, y, 5.0f}, 0.002f);
  const std::size_t edge = c.position.size();
  for (float x = 0.5f; x < 32.0f; x += 4.0f) c.add({x, 31.5f, 5.5f}, 0.12f);
  const std::size_t crown = c.position.size();
  for (float z = 40.5f; z < 56.0f; z += 2.0f)
    for (float y = 10.5f; y < 30.0f; y += 2.0f)
      for (float x = 10.5f; x < 30.0f; x += 2.0f) c.add({x, y, z}, 0.2f);
  const std::vector<std::uint8_t> volumetric = find_volumetric({c.position, c.roughness, c.flags});
  CHECK(count(volumetric, 0, edge) == 0);
  CHECK(count(volumetric, edge, crown) == 0);
  CHECK(count(volumetric, crown, c.position.size()) == c.position.size() - crown);
  CHECK(find_volumetric({c.position, c.roughness, {}}) == volumetric);
}

TEST_CASE("scatter: a flake of leaves in a crown lies among strewn points, the floor below does not",
          "[unit]") {
  Cloud c;
  for (float y = 0.5f; y < 64.0f; y += 1.0f)
    for (float x = 0.5f; x < 64.0f; x += 1.0f) c.add({x, y, 5.0f}, 0.002f);
  const std::size_t flake = c.position.size();
  for (float y = 18.5f; y < 24.0f; y += 1.0f)
    for (float x = 18.5f; x < 24.0f; x += 1.0f) c.add({x, y, 40.0f}, 0.002f);
  const std::size_t crown = c.position.size();
  for (float z = 30.5f; z < 56.0f; z += 1.0f)
    for (float y = 10.5f; y < 30.0f; y += 1.0f)
      for (float x = 10.5f; x < 30.0f; x += 1.0f) c.add({x, y, z}, 0.2f);
  const std::vector<std::uint8_t> volumetric = find_volumetric({c.position, c.roughness, c.flags});
  const std::vector<std::uint8_t> among =
      find_among_volumetric({c.position, c.roughness, c.flags}, volumetric);
  for (std::size_t i = flake; i < crown; ++i) CHECK(volumetric[i] + among[i] == 1);
  CHECK(count(among, 0, flake) == 0);
  CHECK(count(among, crown, c.position.size()) == 0);  // these are strewn themselves
  std::vector<std::uint16_t> ground(c.position.size(), kPointGround);
  CHECK(count(find_among_volumetric({c.position, c.roughness, ground}, volumetric), 0, crown) == 0);
}

TEST_CASE("scatter: ground is never strewn, an echo goes sooner than a last return", "[unit]") {
  Cloud c;
  for (float x = 8.5f; x < 56.0f; x += 1.0f) c.add({x, 8.5f, 8.5f}, 0.2f, kPointGround);
  const std::size_t echoes = c.position.size();
  for (float x = 8.5f; x < 56.0f; x += 1.0f) c.add({x, 40.5f, 40.5f}, 0.05f, kPointNotLast);
  const std::size_t last = c.position.size();
  for (float x = 8.5f; x < 56.0f; x += 1.0f) c.add({x, 8.5f, 40.5f}, 0.05f);
  const std::vector<std::uint8_t> volumetric = find_volumetric({c.position, c.roughness, c.flags});
  CHECK(count(volumetric, 0, echoes) == 0);
  CHECK(count(volumetric, echoes, last) == last - echoes);
  CHECK(count(volumetric, last, c.position.size()) == 0);
}

TEST_CASE("scatter: what grows on the ground does not tilt its planes", "[unit]") {
  PointBlock block;
  block.cells = {64, 64, 64};
  std::vector<std::pair<Float3, std::uint16_t>> points;
  for (float y = 20.25f; y < 24.0f; y += 0.5f)
    for (float x = 20.25f; x < 24.0f; x += 0.5f) {
      points.push_back({{x, y, 20.5f}, kPointGround});
      if (x > 22.0f) points.push_back({{x, y, 22.5f}, 0});  // a bush on one side
    }
  for (const auto& [p, flag] : points) {  // one cube of cells: any order is canonical enough for its sums
    block.x.push_back(p[0]), block.y.push_back(p[1]), block.z.push_back(p[2]);
    block.nx.push_back(0), block.ny.push_back(0), block.nz.push_back(0);
    block.flags.push_back(flag);
  }
  const std::vector<PointShape> with = estimate_shapes(block, {});
  block.flags.clear();
  const std::vector<PointShape> without = estimate_shapes(block, {});
  REQUIRE(with.size() == points.size());
  float minimum = 1.0f, min_without = 1.0f;
  for (std::size_t i = 0; i < points.size(); ++i) {
    if (points[i].second != kPointGround) continue;
    minimum = std::min(minimum, std::abs(with[i].normal[2]));
    min_without = std::min(min_without, std::abs(without[i].normal[2]));
    CHECK(with[i].roughness < 1e-3f);
  }
  CHECK(minimum > 0.9999f);
  CHECK(min_without < 0.95f);
}

}  // namespace volumetric_points_test
