#include "kernels/texture/point_means.h"

#include <catch2/catch.hpp>
#include <cmath>

#include "kernels/texture/point_colours.h"

namespace point_means_test {

using namespace tessera;

namespace {

struct Mean {
  Double3 at;
  std::uint32_t rgba;
  Double3 normal;
};

std::vector<Mean> means_of(const std::vector<Float3>& position, const std::vector<std::uint32_t>& rgba,
                           const std::vector<std::uint32_t>& normal, double edge) {
  std::vector<Mean> out;
  mean_points(position, rgba, normal, edge, [&](const Double3& p, std::uint32_t c, const Double3& n) {
    out.push_back({p, c, n});
  });
  return out;
}

}  // namespace

TEST_CASE("point means: one a cube, with the mean position, colour and normal of its points", "[unit]") {
  const std::vector<Float3> position = {{0.5f, 0.5f, 0.f}, {1.5f, 0.5f, 0.f}, {2.5f, 0.5f, 0.f}};
  const std::uint32_t up = pack_normal({0, 0, 1});
  const auto found = means_of(position, {10, 21, 200u << 8}, {up, up, up}, 2.0);
  REQUIRE(found.size() == 2);
  CHECK(found[0].at == Double3{1.0, 0.5, 0.0});
  CHECK(found[0].rgba == 16);  // halves go up
  CHECK(found[0].normal[2] > 0.999);
  CHECK(found[1].at == Double3{2.5, 0.5, 0.0});
  CHECK(found[1].rgba == 200u << 8);
}

TEST_CASE("point means: both sides of a thin wall keep their colours", "[unit]") {
  const std::vector<Float3> position = {{0.5f, 0.5f, 0.1f}, {0.5f, 0.5f, 0.2f}, {0.6f, 0.5f, 0.1f}};
  const std::uint32_t up = pack_normal({0, 0.1, 1}), down = pack_normal({0, 0, -1});
  const auto found = means_of(position, {100, 200, 102}, {up, down, up}, 1.0);
  REQUIRE(found.size() == 2);
  CHECK(found[0].rgba == 101);
  CHECK(found[1].rgba == 200);
  CHECK(means_of(position, {100, 200, 102}, {}, 1.0).size() == 1);
}

TEST_CASE("point means: wide faces get as many points as their areas hold, coloured between their corners",
          "[unit]") {
  MeshBlock block;
  block.key = {7, 9, 12, 40};
  block.position = {{0, 0, 0}, {60, 0, 0}, {60, 40, 0}, {0, 40, 0}};
  block.rgba = {0, 240, 240, 0};
  block.faces = {{0, 1, 2}, {0, 2, 3}};
  std::size_t count = 0;
  double by_x = 0.0, by_y = 0.0;
  sample_wide_faces(block, 1.0, [&](const Double3& p, std::uint32_t rgba, const Double3& n) {
    ++count;
    by_x += p[0], by_y += p[1];
    CHECK(std::abs(static_cast<double>(rgba & 255u) - 4.0 * p[0]) <= 0.51);
    CHECK(p[2] == 0.0);
    CHECK(n == Double3{0, 0, 1});
  });
  CHECK(count >= 2400);
  CHECK(count <= 2402);
  CHECK(by_x / static_cast<double>(count) == Approx(30.0).epsilon(0.01));
  CHECK(by_y / static_cast<double>(count) == Approx(20.0).epsilon(0.01));
  // Faces that vertices alone show are left alone.
  sample_wide_faces(block, 40.0, [&](const Double3&, std::uint32_t, const Double3&) { FAIL(); });
}

}  // namespace point_means_test
