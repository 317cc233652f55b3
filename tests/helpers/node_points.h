/// \file node_points.h
/// Points on which octrees of points branch: sparse far and wide, and too many for a leaf in one place.
#pragma once
#include <array>
#include <cmath>
#include <cstdint>
#include <vector>

#include "tests/helpers/random.h"

namespace tessera::test {

using Steps = std::array<std::int32_t, 3>;

/// A sheet with waves, and a block of 60,000 points within a few steps.
inline std::vector<Steps> node_points(std::size_t count) {
  Random random(11);
  std::vector<Steps> points;
  for (std::size_t i = 0; i < count; ++i) {
    const double x = random.in(-5e5, 5e5), y = random.in(-3e5, 3e5);
    points.push_back({static_cast<std::int32_t>(x), static_cast<std::int32_t>(y),
                      static_cast<std::int32_t>(4e4 * std::sin(x * 1e-5) + random.in(0, 2e3))});
  }
  for (std::int32_t i = 0; i < 60'000; ++i) points.push_back({1000 + i % 40, 2000 + i / 40 % 40, i / 1600});
  return points;
}

}  // namespace tessera::test
