#include "kernels/points/density_levels.h"

#include <algorithm>
#include <catch2/catch.hpp>
#include <cmath>
#include <vector>

#include "octree/morton.h"
#include "tests/helpers/random.h"

namespace density_levels_test {

using namespace tessera;

namespace {

/// Points of a brick in canonical order.
PointBlock ordered(std::vector<Float3> points) {
  const auto code = [](const Float3& p) {
    return morton_encode(static_cast<std::uint32_t>(p[0] * 1024.0f),
                         static_cast<std::uint32_t>(p[1] * 1024.0f),
                         static_cast<std::uint32_t>(p[2] * 1024.0f));
  };
  for (Float3& p : points)
    for (float& c : p) c = std::floor(c * 1024.0f) / 1024.0f;
  std::sort(points.begin(), points.end(),
            [&](const Float3& a, const Float3& b) { return code(a) < code(b); });
  PointBlock block;
  block.cells = {64, 64, 64};
  for (const Float3& p : points) block.x.push_back(p[0]), block.y.push_back(p[1]), block.z.push_back(p[2]);
  return block;
}

/// A slanted plane over [0, to)^2, samples `apart` cells.
void add_plane(std::vector<Float3>& points, float to, float apart) {
  test::Random random(7);
  for (float y = 0.0f; y < to; y += apart)
    for (float x = 0.0f; x < to; x += apart) {
      const auto jitter = [&] { return static_cast<float>(random.unit()) * 0.5f * apart; };
      const Float3 p = {std::min(x + jitter(), to - 0.01f), std::min(y + jitter(), to - 0.01f), 0};
      points.push_back({p[0], p[1], 5.0f + 0.3f * p[0] + 0.2f * p[1]});
    }
}

/// Finest level that is anywhere.
int finest(const std::vector<DensityNode>& nodes, int levels) {
  int minimum = levels;
  for (const DensityNode& n : nodes) minimum = std::min(minimum, n.level);
  return nodes.empty() ? levels - 1 : minimum - 1;
}

}  // namespace

TEST_CASE("density levels: cells follow the spacing of the samples", "[unit]") {
  for (const auto& [apart, level] : {std::pair{1.0f, 4}, {0.62f, 4}, {0.31f, 3}, {0.15f, 2}, {0.07f, 1}}) {
    std::vector<Float3> points;
    add_plane(points, 64.0f, apart);
    CAPTURE(apart);
    CHECK(finest(split_by_density(ordered(points), {3, 4, 5}, 5, 0), 5) == level);
  }
}

TEST_CASE("density levels: only the dense part of a brick is split", "[unit]") {
  std::vector<Float3> points;
  add_plane(points, 64.0f, 0.35f);
  add_plane(points, 31.9f, 0.08f);
  const auto nodes = split_by_density(ordered(points), {1, 0, 2}, 4, 0);
  REQUIRE_FALSE(nodes.empty());
  CHECK(nodes.front().level == 3);
  CHECK(nodes.front().at == Int3{1, 0, 2});
  int fine = 0;
  for (const DensityNode& n : nodes) {
    if (n.level == 3) continue;
    // Nodes of level 2 are 32 of the brick's cells wide: the dense corner and what is in it.
    fine += n.level == 1;
    const int by = 1 << (2 - n.level);
    CHECK(Int3{n.at[0] / by, n.at[1] / by, n.at[2] / by} == Int3{2, 0, 4});
  }
  CHECK(fine >= 4);
}

TEST_CASE("density levels: lines, lone points and levels below the noise are not split", "[unit]") {
  std::vector<Float3> line;
  for (int i = 0; i < 60000; ++i) line.push_back({static_cast<float>(i) * 0.001f + 0.5f, 20.3f, 31.7f});
  CHECK(split_by_density(ordered(line), {0, 0, 0}, 4, 0).empty());
  CHECK(split_by_density(ordered({{1, 1, 1}, {50, 3, 3}}), {0, 0, 0}, 4, 0).empty());
  CHECK(split_by_density(PointBlock{}, {0, 0, 0}, 4, 0).empty());
  std::vector<Float3> plane;
  add_plane(plane, 64.0f, 0.1f);
  CHECK(finest(split_by_density(ordered(plane), {0, 0, 0}, 4, 2), 4) == 2);
}

}  // namespace density_levels_test
