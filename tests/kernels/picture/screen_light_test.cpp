// Occlusion and creases of the pixels of a band: what is open is light, what lies in a corner is not.
#include <catch2/catch.hpp>

#include <cmath>
#include <vector>

#include "kernels/picture/screen_light.h"

namespace screen_light_test {

using namespace tessera;

namespace {

constexpr int kSide = 64;

/// From above on a scene of 64 x 64 whose depth below the eye is depth(x, y), normals given.
template <class Depth, class Normal>
std::vector<std::vector<float>> shares(const Depth& depth, const Normal& normal, double strength) {
  Camera camera;
  camera.half_width = camera.half_height = 32.0;
  camera.near_plane = 1.0, camera.far_plane = 200.0;
  ScreenLight light(camera, kSide, kSide, 0, kSide, 0.5);
  for (int y = 0; y < kSide; ++y)
    for (int x = 0; x < kSide; ++x) {
      light.set_distance(x, y, static_cast<float>(depth(x, y)));
      light.set_normal(x, y, normal(x, y));
    }
  light.find_occlusion(strength, 8.0);
  std::vector<std::vector<float>> rows;
  for (int y = 0; y < kSide; ++y) {
    rows.emplace_back(light.row_size());
    light.shares(y, 2.0, rows.back());
  }
  return rows;
}

Float3 up(int, int) {
  return {0.0f, 0.0f, 1.0f};
}

}  // namespace

TEST_CASE("screen light: a plane is open, its border too", "[unit]") {
  const auto rows = shares([](int, int) { return 100.0; }, up, 1.0);
  for (int y = 0; y < kSide; ++y)
    for (int x = 0; x < kSide; ++x)
      CHECK(rows[static_cast<std::size_t>(y)][static_cast<std::size_t>(x)] == Approx(1.0).margin(1e-5));
}

TEST_CASE("screen light: beside a wall it is darker, the more the nearer, and not on top of it", "[unit]") {
  const auto wall = [](int x, int) { return x < 24 ? 90.0 : 100.0; };
  const auto rows = shares(wall, up, 1.0);
  const std::vector<float>& row = rows[32];
  CHECK(row[25] < 0.9f);
  CHECK(row[25] < row[28]);
  CHECK(row[28] < row[34]);
  CHECK(row[50] == Approx(1.0).margin(1e-5));
  CHECK(row[10] == Approx(1.0).margin(1e-5));
  const auto off = shares(wall, up, 0.0);
  CHECK(off[32][25] == Approx(1.0).margin(1e-5));
}

TEST_CASE("screen light: where faces meet at a right angle there is a crease, where they bend little none",
          "[unit]") {
  const double degrees = GENERATE(90.0, 20.0);
  const auto half = static_cast<float>(0.5 * degrees * M_PI / 180.0);
  const auto roof = [&](int x, int) { return Float3{std::sin(x < 32 ? -half : half), 0.0f, std::cos(half)}; };
  const auto rows = shares([](int, int) { return 100.0; }, roof, 0.0);
  CHECK((rows[20][31] < 0.6f) == (degrees > 45.0));
  CHECK(rows[20][29] == Approx(1.0).margin(1e-5));
  CHECK(rows[20][33] == Approx(1.0).margin(1e-5));
}

}  // namespace screen_light_test
