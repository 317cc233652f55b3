/// \file random_points.h
/// Reproducible scans for tests.
#pragma once
#include <algorithm>
#include <cmath>
#include <vector>

#include "tests/helpers/memory_points.h"
#include "tests/helpers/random.h"

namespace tessera::test {

/// Points on a sphere with normals and colours, some of them twice.
inline std::vector<TestPoint> sphere_points(std::size_t count, double radius, const Double3& centre,
                                            std::uint64_t seed = 1) {
  Random random(seed);
  std::vector<TestPoint> points;
  while (points.size() < count) {
    const double x = random.in(-1, 1);
    const double y = random.in(-1, 1);
    const double z = random.in(-1, 1);
    const double size = std::sqrt(x * x + y * y + z * z);
    if (size > 1.0 || size < 0.1) continue;
    TestPoint p;
    p.p = {centre[0] + radius * x / size, centre[1] + radius * y / size, centre[2] + radius * z / size};
    p.n = {static_cast<float>(x / size), static_cast<float>(y / size), static_cast<float>(z / size)};
    p.rgba = static_cast<std::uint32_t>(random.bits()) | 0xff000000u;
    points.push_back(p);
    if (points.size() % 17 == 0) {  // the same position with other attributes
      p.rgba = static_cast<std::uint32_t>(random.bits()) | 0xff000000u;
      std::swap(p.n[0], p.n[1]);
      points.push_back(p);
    }
  }
  points.resize(count);
  return points;
}

inline void shuffle(std::vector<TestPoint>& points, std::uint64_t seed) {
  Random random(seed);
  for (std::size_t i = points.size(); i > 1; --i) std::swap(points[i - 1], points[random.below(i)]);
}

}  // namespace tessera::test
