// Bare ground from the lowest heights of a raster: scenes whose ground is known.
#include <algorithm>
#include <catch2/catch.hpp>
#include <cmath>
#include <cstdlib>
#include <vector>

#include "kernels/points/ground_filter.h"

namespace ground_filter_test {

using namespace tessera;

namespace {

constexpr int kWidth = 120, kHeight = 90;
constexpr std::int32_t kCell = 1000;

std::size_t at(int u, int v) {
  return static_cast<std::size_t>(v * kWidth + u);
}

/// A slope of one in ten with a gentle wave.
double terrain(double u, double v) {
  return 100.0 * u + 800.0 * std::sin(u * 0.05) * std::cos(v * 0.04) - 30.0 * v;
}

std::vector<std::int32_t> bare() {
  std::vector<std::int32_t> h;
  for (int v = 0; v < kHeight; ++v)
    for (int u = 0; u < kWidth; ++u) h.push_back(static_cast<std::int32_t>(terrain(u + 0.5, v + 0.5)));
  return h;
}

GroundRules rules() {
  GroundRules r;
  r.cell = kCell;
  return r;
}

double worst_error(const GroundSurface& g) {
  double worst = 0.0;
  for (int v = 3; v < kHeight - 3; ++v)
    for (int u = 3; u < kWidth - 3; ++u)
      worst = std::max(worst, std::fabs(g.ground[at(u, v)] - terrain(u + 0.5, v + 0.5)));
  return worst;
}

}  // namespace

TEST_CASE("ground filter: bare terrain stays as it is", "[unit]") {
  const std::vector<std::int32_t> lowest = bare();
  const GroundSurface g = find_ground(lowest, kWidth, kHeight, rules());
  // At the rim of the raster an opening of a slope ends.
  for (int v = 20; v < kHeight - 20; ++v)
    for (int u = 20; u < kWidth - 20; ++u) {
      REQUIRE(g.kind[at(u, v)] == kGroundMeasured);
      REQUIRE(g.ground[at(u, v)] == lowest[at(u, v)]);
    }
}

TEST_CASE("ground filter: houses and crowns go, and a membrane goes on below them", "[unit]") {
  std::vector<std::int32_t> lowest = bare();
  const auto raise = [&](int u0, int v0, int u1, int v1, std::int32_t by) {
    for (int v = v0; v < v1; ++v)
      for (int u = u0; u < u1; ++u) lowest[at(u, v)] += by;
  };
  raise(20, 20, 45, 40, 6000);   // a hall, 25 cells wide
  raise(70, 50, 73, 53, 12000);  // a crown
  raise(90, 10, 96, 70, 3000);   // a row of houses
  const GroundSurface g = find_ground(lowest, kWidth, kHeight, rules());
  for (const auto& [u, v] : {std::pair{32, 30}, {20, 20}, {44, 39}, {71, 51}, {92, 40}})
    CHECK(g.kind[at(u, v)] == kGroundObject);
  CHECK(g.kind[at(10, 10)] == kGroundMeasured);
  CHECK(g.kind[at(60, 60)] == kGroundMeasured);
  CHECK(worst_error(g) < 500.0);
  // Points: on the ground below the hall, on its roof, on the terrain beside it.
  const GroundAt hall = ground_at(g, rules(), 32.5, 30.5);
  CHECK(std::fabs(terrain(32.5, 30.5) - hall.height) < hall.tolerance);
  CHECK(terrain(32.5, 30.5) + 6000.0 - hall.height > hall.tolerance);
  CHECK(ground_at(g, rules(), 10.5, 10.5).height == Approx(terrain(10.5, 10.5)).margin(1.0));
}

TEST_CASE("ground filter: an object wider than the widest window is terrain", "[unit]") {
  std::vector<std::int32_t> lowest = bare();
  for (int v = 20; v < 60; ++v)
    for (int u = 20; u < 60; ++u) lowest[at(u, v)] += 9000;
  GroundRules narrow = rules();
  narrow.max_window = 10;
  CHECK(find_ground(lowest, kWidth, kHeight, narrow).kind[at(40, 40)] == kGroundMeasured);
  narrow.max_window = 22;
  CHECK(find_ground(lowest, kWidth, kHeight, narrow).kind[at(40, 40)] == kGroundObject);
}

TEST_CASE("ground filter: pits below the ground and cells without points do not pull it", "[unit]") {
  std::vector<std::int32_t> lowest = bare();
  for (int i = 0; i < 12; ++i) lowest[at(9 * i + 5, 7 * i + 4)] -= 9000;
  for (int v = 30; v < 42; ++v)
    for (int u = 70; u < 90; ++u) lowest[at(u, v)] = kNoGround;
  const GroundSurface g = find_ground(lowest, kWidth, kHeight, rules());
  CHECK(std::count(g.kind.begin(), g.kind.end(), kGroundPit) == 12);
  CHECK(std::count(g.kind.begin(), g.kind.end(), kGroundEmpty) == 12 * 20);
  CHECK(worst_error(g) < 500.0);
}

TEST_CASE("ground filter: a part with its context says of its cells what the whole says", "[unit]") {
  std::vector<std::int32_t> lowest = bare();
  for (int v = 40; v < 50; ++v)
    for (int u = 50; u < 62; ++u) lowest[at(u, v)] += 4000;
  GroundRules small = rules();
  small.max_window = 5;
  const GroundSurface whole = find_ground(lowest, kWidth, kHeight, small);
  constexpr int kHalo = 5 * 6 + 2, kFirst = 45, kLast = 70;
  std::vector<std::int32_t> part;
  for (int v = 0; v < kHeight; ++v)
    for (int u = kFirst - kHalo; u < kLast + kHalo; ++u) part.push_back(lowest[at(u, v)]);
  const int width = kLast - kFirst + 2 * kHalo;
  const GroundSurface cut = find_ground(part, width, kHeight, small);
  for (int v = 0; v < kHeight; ++v)
    for (int u = kFirst; u < kLast; ++u)
      REQUIRE(cut.kind[static_cast<std::size_t>(v * width + u - kFirst + kHalo)] == whole.kind[at(u, v)]);
}

TEST_CASE("ground filter: a membrane fills a hole from its rim alone, and keeps what is known", "[unit]") {
  std::vector<std::int32_t> heights = bare();
  std::vector<std::uint8_t> known(heights.size(), 1);
  for (int v = 40; v < 60; ++v)
    for (int u = 50; u < 75; ++u) heights[at(u, v)] = kNoGround, known[at(u, v)] = 0;
  std::vector<std::int32_t> other = heights;
  for (int v = 0; v < kHeight; ++v) other[at(5, v)] = 100000;  // far away
  fill_membrane(heights, known, kWidth, kHeight);
  fill_membrane(other, known, kWidth, kHeight);
  const std::vector<std::int32_t> truth = bare();
  for (int v = 0; v < kHeight; ++v)
    for (int u = 10; u < kWidth; ++u) {
      REQUIRE(other[at(u, v)] == heights[at(u, v)]);
      REQUIRE(std::abs(heights[at(u, v)] - truth[at(u, v)]) <= (known[at(u, v)] != 0 ? 0 : 600));
    }
}

TEST_CASE("ground filter: windows spread the greatest and the least height", "[unit]") {
  std::vector<std::int32_t> heights(kWidth * kHeight, 0);
  heights[at(20, 30)] = 7;
  dilate_raster(heights, kWidth, kHeight, 3);
  CHECK(std::count(heights.begin(), heights.end(), 7) == 49);
  CHECK(heights[at(23, 27)] == 7);
  erode_raster(heights, kWidth, kHeight, 2);
  CHECK(std::count(heights.begin(), heights.end(), 7) == 9);
  CHECK(heights[at(21, 29)] == 7);
}

TEST_CASE("ground filter: nothing measured, or nothing at all, is no error", "[unit]") {
  const std::vector<std::int32_t> none(12, kNoGround);
  const GroundSurface g = find_ground(none, 4, 3, rules());
  CHECK(std::count(g.kind.begin(), g.kind.end(), kGroundEmpty) == 12);
  CHECK(find_ground({}, 0, 0, rules()).ground.empty());
}

}  // namespace ground_filter_test
