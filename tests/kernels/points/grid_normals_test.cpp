// Normals from rows and columns: exact on planes at any angle, own to each side of a jump, none where nothing tells.
#include "kernels/points/grid_normals.h"

#include <catch2/catch.hpp>

#include <array>
#include <cmath>
#include <functional>
#include <limits>

#include "octree/portable_math.h"

namespace grid_normals_test {

using namespace tessera;

namespace {

constexpr double kStep = 0.002;  // radians between rays

/// The ray of a line and cell, unit, about along x.
Double3 ray(int line, std::int64_t cell) {
  const SinCos yaw = sin_cos(kStep * line), rise = sin_cos(kStep * static_cast<double>(cell));
  return {rise.cos * yaw.cos, rise.cos * yaw.sin, rise.sin};
}

/// Where the ray meets the plane n p = d.
double range_of(const Double3& r, const Double3& n, double d) {
  return d / dot(n, r);
}

/// Seven lines of 41 cells around the middle; a range that is not positive leaves the cell empty.
struct Grid {
  std::array<GridLine, kGridLines> lines;
  explicit Grid(const std::function<double(int line, std::int64_t cell, const Double3& ray)>& range) {
    for (int l = 0; l < static_cast<int>(kGridLines); ++l)
      for (std::int64_t c = 30; c-- > -11;) {  // downwards, as some scanners do
        const Double3 r = ray(l - kGridRadius, c);
        const double d = range(l - kGridRadius, c, r);
        if (d > 0.0) lines[static_cast<std::size_t>(l)].put(c, {d * r[0], d * r[1], d * r[2]});
      }
  }
  Float3 normal(std::int64_t cell, bool half = false) const {
    std::array<const GridLine*, kGridLines> window{};
    for (std::size_t l = 0; l < kGridLines; ++l)
      if (!half || l >= kGridRadius) window[l] = &lines[l];
    return grid_normal(window, cell);
  }
};

double degrees_between(const Float3& a, const Double3& b) {
  const Double3 w = wide(a);
  return std::acos(std::min(1.0, dot(w, b) / norm(w) / norm(b))) * 180.0 / kPi;
}

constexpr Float3 kNone = {0, 0, 0};

}  // namespace

TEST_CASE("grid normals: planes across the view and at a glance, towards the scanner", "[unit]") {
  const double tilt = GENERATE(0.0, 30.0, 60.0, 80.0, 86.0);  // degrees from the way back to the scanner
  const SinCos t = sin_cos(tilt * kPi / 180.0);
  const Double3 n = {-t.cos, 0.0, t.sin};
  const Grid grid([&](int, std::int64_t, const Double3& r) { return range_of(r, n, -20.0 * t.cos); });
  for (const std::int64_t cell : {-11, -10, 0, 7}) {
    const Float3 got = grid.normal(cell);
    CAPTURE(tilt, cell);
    REQUIRE(got != kNone);
    CHECK(degrees_between(got, n) < 0.01);
    CHECK(norm(wide(got)) == Approx(1.0).epsilon(1e-6));
    CHECK(degrees_between(grid.normal(cell, true), n) < 0.01);  // where the grid ends
  }
}

TEST_CASE("grid normals: beyond a jump of depth nothing counts, however near in the grid", "[unit]") {
  // In front a tilted board up to cell 4, behind it a wall.
  const Double3 board = {-0.9, 0.1, 0.42}, wall = {-1.0, 0.0, 0.0};
  const double gap = GENERATE(0.3, 2.0, 50.0);
  const Grid grid([&](int, std::int64_t cell, const Double3& r) {
    return cell <= 4 ? range_of(r, board, -9.0) : range_of(r, wall, -10.0 - gap);
  });
  for (std::int64_t cell = 0; cell <= 9; ++cell) {
    CAPTURE(gap, cell);
    const Float3 got = grid.normal(cell);
    REQUIRE(got != kNone);
    CHECK(degrees_between(got, cell <= 4 ? board : wall) < 0.01);
  }
}

TEST_CASE("grid normals: a crease bends the normals of its neighbours by little, noise all of them",
          "[unit]") {
  const Double3 left = {-0.8, 0.0, 0.6}, right = {-0.8, 0.0, -0.6};
  const Grid roof([&](int, std::int64_t, const Double3& r) {
    return std::max(range_of(r, left, -8.0), range_of(r, right, -8.0));
  });
  CHECK(degrees_between(roof.normal(4), left) < 0.01);
  CHECK(degrees_between(roof.normal(-4), right) < 0.01);
  CHECK(degrees_between(roof.normal(2), left) < 0.01);  // the window shrinks
  CHECK(degrees_between(roof.normal(-2), right) < 0.01);

  const Double3 wall = {-1.0, 0.0, 0.0};
  const double share = GENERATE(0.0, 0.2, 0.5);  // of the distance between samples
  const Grid noisy([&](int line, std::int64_t cell, const Double3& r) {
    const double random = to_unit(random_bits(3, static_cast<std::uint64_t>(line + 100),
                                              static_cast<std::uint64_t>(cell + 100))) -
                          0.5;
    return range_of(r, wall, -10.0) + 3.4641 * random * share * kStep * 10.0;
  });
  double worst = 0.0;
  for (std::int64_t cell = -7; cell < 26; ++cell)
    worst = std::max(worst, degrees_between(noisy.normal(cell), wall));
  CAPTURE(share, worst);
  CHECK(worst <= 0.01 + 14.0 * share);
}

TEST_CASE("grid normals: none for samples without neighbours, on one line, or in rubble", "[unit]") {
  const Double3 wall = {-1.0, 0.0, 0.0};
  const Grid alone([&](int line, std::int64_t cell, const Double3& r) {
    return line == 0 && cell == 0 ? range_of(r, wall, -5.0) : 0.0;
  });
  CHECK(alone.normal(0) == kNone);
  const Grid fence(
      [&](int line, std::int64_t, const Double3& r) { return line == 0 ? range_of(r, wall, -5.0) : 0.0; });
  CHECK(fence.normal(0) == kNone);
  const Grid rubble([&](int line, std::int64_t cell, const Double3& r) {
    return range_of(r, wall, -5.0) + 0.2 * to_unit(random_bits(5, static_cast<std::uint64_t>(line + 9),
                                                               static_cast<std::uint64_t>(cell + 99)));
  });
  std::size_t without = 0;
  for (std::int64_t cell = -7; cell < 26; ++cell) without += rubble.normal(cell) == kNone;
  CHECK(without > 25);
}

TEST_CASE("grid line: cells come in any order, the first sample of a cell stays, far ones have no place",
          "[unit]") {
  GridLine line;
  for (const std::int64_t cell : {5, 9, -3, 5})
    line.put(cell, {static_cast<double>(cell), cell == 5 ? 1.0 : 0.0, 0});
  line.put(5, {7, 7, 7});
  CHECK((*line.find(5) == Double3{5, 1, 0}));
  CHECK((*line.find(-3) == Double3{-3, 0, 0}));
  for (const std::int64_t cell : {-4, 4, 6, 10}) CHECK(line.find(cell) == nullptr);
  for (const std::int64_t far : {std::int64_t{1} << 50, -(std::int64_t{1} << 50),
                                 std::int64_t{kMaxGridCells} - 3, 9 - std::int64_t{kMaxGridCells}})
    line.put(far, {1, 2, 3});
  CHECK(line.find(std::int64_t{1} << 50) == nullptr);
  CHECK(line.find(std::int64_t{kMaxGridCells} - 3) == nullptr);
  line.put(static_cast<std::int64_t>(kMaxGridCells) - 4, {1, 2, 3});
  CHECK(line.find(static_cast<std::int64_t>(kMaxGridCells) - 4) != nullptr);
  line.clear();
  CHECK(line.find(5) == nullptr);
}

}  // namespace grid_normals_test
