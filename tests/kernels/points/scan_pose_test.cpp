// Poses: scans as scanners make them hold, whatever they show; world coordinates with the pose of no scan do not.
#include "kernels/points/scan_pose.h"

#include <catch2/catch.hpp>

#include <cmath>
#include <functional>

#include "octree/portable_math.h"
#include "tests/helpers/random.h"

namespace scan_pose_test {

using namespace tessera;
using test::Random;

namespace {

constexpr int kLines = 120, kCells = 150;

ScanPose check(const std::function<Double3(int, int)>& sample, bool filled_in, bool grid = true,
               const Double3& scanner = {}) {
  std::vector<Double3> spread;
  std::vector<GridSample> samples;
  for (int l = 0; l < kLines; ++l)
    for (int c = 0; c < kCells; ++c) {
      const Double3 p = sample(l, c) - scanner;
      if ((l * kCells + c) % 16 == 0) spread.push_back(p);
      if (grid && (l % 4 < 2) && (c % 3 < 2)) samples.push_back({l, c, p});
    }
  return check_scan_pose(spread, samples, filled_in);
}

Double3 sphere_ray(double azimuth, double elevation) {
  const SinCos yaw = sin_cos(azimuth), rise = sin_cos(elevation);
  return {rise.cos * yaw.cos, rise.cos * yaw.sin, rise.sin};
}

/// How far a room of random boxes is, from sample to sample.
double clutter(int line, int cell) {
  Random random(static_cast<std::uint64_t>(line / 7 * 1000 + cell / 9));
  return 2.0 + 8.0 * random.unit();
}

/// A surveyed terrain, a point every 0.25; in world coordinates by `shift`.
Double3 terrain(int line, int cell, const Double3& shift, double relief = 1.5) {
  const double x = 0.25 * line, y = 0.25 * cell;
  return shift + Double3{x, y, relief * std::sin(x / 5.0) * std::cos(y / 7.0)};
}

}  // namespace

TEST_CASE("scan pose: scans of scanners hold, by columns and by rows, over the zenith and with a pinhole",
          "[unit]") {
  const auto columns = [](int l, int c) { return sphere_ray(0.05 * l, 0.02 * c - 1.0) * clutter(l, c); };
  CHECK(check(columns, false) == ScanPose::kHolds);
  CHECK(check([&](int l, int c) { return columns(c, l); }, false) == ScanPose::kHolds);
  // A mirror that turns from the ground over the zenith to the ground behind, while the head turns by half.
  CHECK(check([](int l, int c) { return sphere_ray(0.026 * l, 0.028 * c - 0.9) * clutter(l, c); }, true) ==
        ScanPose::kHolds);
  CHECK(check(
            [](int l, int c) {
              return unit(Double3{0.01 * (l - 60), 0.01 * (c - 75), 1.0}) * clutter(l, c);
            },
            false) == ScanPose::kHolds);
  // An object seen by a scanner four of its sizes away, in a frame that leans.
  const auto far = [](int l, int c) {
    const Double3 ray = unit(Double3{0.001 * (l - 60), 0.001 * (c - 75), 1.0});
    const double along = 1.0 + 0.05 * std::sin(0.1 * l) * std::cos(0.1 * c);
    return Double3{0.6 * ray[0] + 0.8 * ray[2], ray[1], -0.8 * ray[0] + 0.6 * ray[2]} * along;
  };
  CHECK(check(far, false) == ScanPose::kHolds);
  // Coordinates rounded to a millimetre at steps of two.
  CHECK(check(
            [](int l, int c) {
              Double3 p = sphere_ray(0.001 * l, 0.001 * c) * 2.0;
              for (double& v : p) v = std::floor(v * 1000.0 + 0.5) / 1000.0;
              return p;
            },
            false) == ScanPose::kHolds);
}

TEST_CASE("scan pose: world coordinates are refused, far off, beside the origin and around it", "[unit]") {
  const auto at = [](const Double3& shift) { return [shift](int l, int c) { return terrain(l, c, shift); }; };
  CHECK(check(at({500000, 5400000, 300}), false) == ScanPose::kFar);
  CHECK(check(at({500000, 5400000, 300}), true) == ScanPose::kFar);  // a pose applied twice
  CHECK(check(at({300, 100, 2}), false) == ScanPose::kOffRays);
  CHECK(check(at({300, 100, 200}), false) == ScanPose::kOffRays);
  CHECK(check(at({-20, -20, -1}), false) == ScanPose::kOffRays);
  CHECK(check(at({-20, -20, 3}), false) == ScanPose::kOffRays);
  // Where the scanner stood is right, what the file calls rows and columns is not.
  Random random(3);
  CHECK(check(
            [&](int, int) {
              const int l = static_cast<int>(random.unit() * kLines),
                        c = static_cast<int>(random.unit() * kCells);
              return terrain(l, c, {-20, -20, -1});
            },
            false) == ScanPose::kOffRays);
}

TEST_CASE(
    "scan pose: a raster in space is no scan from anywhere, flat or with relief, also with samples missing",
    "[unit]") {
  const auto at = [](const Double3& shift, double relief, double edge) {
    return [=](int l, int c) {
      const double x = edge / kLines * l, y = edge / kLines * c;
      return shift + Double3{x, y, relief * std::sin(x / 5.0) * std::cos(y / 7.0)};
    };
  };
  for (const double relief : {1.5, 0.2, 0.0})
    for (const double edge : {10.0, 20.0})
      for (const Double3& shift :
           {Double3{300, 100, 200}, {-10, -10, -0.5}, {-4, -7, 1.5}, {30, 0, 10}, {-5, -30, 20}}) {
        CAPTURE(relief, edge, shift[0], shift[2]);
        CHECK(check(at(shift, relief, edge), false) != ScanPose::kHolds);
        CHECK(check(at(shift, relief, edge), true) != ScanPose::kHolds);
      }
  // On its side, coordinates rounded to a centimetre.
  const auto side = [](int l, int c) {
    return Double3{std::floor(12.0 * l + 0.5) / 100.0, 40.0 + 0.2 * std::sin(0.1 * l),
                   30.0 + std::floor(10.0 * c + 0.5) / 100.0};
  };
  CHECK(check(side, false) == ScanPose::kRaster);
}

TEST_CASE("scan pose: planes that a scanner or a camera looks at straight are no raster", "[unit]") {
  // Cameras, lenses of narrow and wide view, noise of a tenth of a step, the wall straight ahead and oblique.
  for (const double lean : {0.0, 0.3, 1.0})
    for (const double view : {0.05, 0.2, 0.6, 1.2})
      for (const double noise : {0.0, 0.1}) {
        const auto depth = [=](const Double3& ray) { return 5.0 / (ray[2] + std::tan(lean) * ray[0] * 0.5); };
        const auto camera = [=](int l, int c) {
          Random random(static_cast<std::uint64_t>(l * 1000 + c));
          const double step = view / kCells;
          const Double3 ray = unit(Double3{step * (l - 60 + noise * random.in(-1, 1)),
                                           step * (c - 75 + noise * random.in(-1, 1)), 1.0});
          return ray * (depth(ray) * (1.0 + 0.1 * noise * step * random.in(-1, 1)));
        };
        const auto scanner = [=](int l, int c) {
          Random random(static_cast<std::uint64_t>(l * 1000 + c));
          const double step = view / kCells;
          const Double3 d = sphere_ray(step * (l - 60 + noise * random.in(-1, 1)),
                                       step * (c - 75 + noise * random.in(-1, 1)));
          const Double3 ray = {d[1], d[2], d[0]};
          return ray * depth(ray);
        };
        CAPTURE(lean, view, noise);
        CHECK(check(camera, false) == ScanPose::kHolds);
        CHECK(check(scanner, false) == ScanPose::kHolds);
      }
  // A floor around the scanner.
  const auto floor = [](int l, int c) {
    const Double3 ray = sphere_ray(0.05 * l, -1.4 + 0.008 * c);
    return ray * (1.7 / -ray[2]);
  };
  CHECK(check(floor, false) == ScanPose::kHolds);
}

TEST_CASE("scan pose: without a grid distance alone tells, less of it where nobody gave a pose", "[unit]") {
  const auto at = [](double x) { return [x](int l, int c) { return terrain(l, c, {x, -20, -5}); }; };
  CHECK(check(at(-20), false, false) == ScanPose::kHolds);
  CHECK(check(at(30), false, false) == ScanPose::kHolds);
  CHECK(check(at(120), false, false) == ScanPose::kFar);
  CHECK(check(at(120), true, false) == ScanPose::kHolds);
  CHECK(check(at(1000), true, false) == ScanPose::kFar);
  CHECK(check_scan_pose(std::vector<Double3>(10, Double3{1e6, 0, 0}), {}, false) == ScanPose::kHolds);
}

TEST_CASE("even spread: of a stream of any length, positions from all over it", "[unit]") {
  for (const int count : {10, 2047, 2048, 100000}) {
    EvenSpread spread;
    for (int i = 0; i < count; ++i)
      if (spread.wants_next()) spread.add({1.0 * i, 0, 0});
    const auto kept = spread.positions();
    CAPTURE(count);
    REQUIRE(kept.size() >= std::min<std::size_t>(static_cast<std::size_t>(count), 1024));
    CHECK(kept.size() <= 2048);
    CHECK(kept.front()[0] == 0.0);
    CHECK(kept.back()[0] > 0.9 * count - 2);
  }
}

}  // namespace scan_pose_test
