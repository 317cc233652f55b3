#include "kernels/boolean/solid_fans.h"

#include <algorithm>

namespace tessera {

SolidFans::SolidFans(const PointTable& points, std::span<const std::array<std::uint32_t, 3>> faces)
    : points_(points), faces_(faces), vertex_of_(3 * faces.size()) {}

void SolidFans::join(std::uint32_t half, std::uint32_t other) {
  const auto next = [](std::uint32_t h) { return h % 3 == 2 ? h - 2 : h + 1; };
  vertex_of_.unite(half, next(other));
  vertex_of_.unite(next(half), other);
}

bool SolidFans::is_balanced(std::span<const std::uint32_t> half, std::uint32_t low) const {
  std::size_t up = 0;
  for (const std::uint32_t h : half) up += start(h) == low;
  return 2 * up == half.size();
}

void SolidFans::join_around(std::span<const std::uint32_t> half, std::uint32_t low) {
  if (half.size() == 2) {
    join(half[0], half[1]);
    return;
  }
  std::vector<std::uint32_t> around(half.begin(), half.end());
  sort_around(around, low);
  for (std::size_t i = 0; i < around.size(); ++i) {
    const std::uint32_t h = around[i], g = around[(i + 1) % around.size()];
    // Seen along the edge a face that runs along it has its outside ahead.
    if (start(h) != low && start(g) == low) join(h, g);
  }
}

/// Counter-clockwise around the edge, seen against its direction from the lower vertex on; from the first one.
void SolidFans::sort_around(std::vector<std::uint32_t>& half, std::uint32_t low) const {
  const std::uint32_t first = half[0];
  const std::uint32_t high = start(first) == low ? faces_[first / 3][(first % 3 + 1) % 3] : start(first);
  const auto turn = [&](std::uint32_t h, std::uint32_t g) {
    return points_.orient3d(low, high, tip(h), tip(g));
  };
  // Half turns behind the first: 0, within the first half, opposite, within the second half.
  const auto quarter = [&](std::uint32_t h) {
    if (h == first) return 0;
    const int t = turn(first, h);
    return t > 0 ? 1 : t == 0 ? 2 : 3;
  };
  std::stable_sort(half.begin(), half.end(), [&](std::uint32_t h, std::uint32_t g) {
    const int i = quarter(h), j = quarter(g);
    return i != j ? i < j : turn(h, g) > 0;
  });
}

}  // namespace tessera
