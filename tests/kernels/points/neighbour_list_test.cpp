#include "kernels/points/neighbour_list.h"

#include <catch2/catch.hpp>
#include <cmath>
#include <cstdint>

namespace neighbour_list_test {

using namespace tessera;

namespace {

/// Points on a coarse raster, so that squares of distances are exact, in and around the cube at (4, 4, 4).
struct Raster {
  std::vector<float> x, y, z, nx, ny, nz;
  std::vector<std::uint8_t> ground;

  explicit Raster(std::size_t count) {
    std::uint32_t state = 7;
    const auto next = [&](std::uint32_t below) {
      return ((state = state * 1664525u + 1013904223u) >> 12) % below;
    };
    for (std::size_t i = 0; i < count; ++i) {
      const auto at = [&] { return static_cast<float>(next(256) % 256) / 16.0f - 2.0f; };
      x.push_back(at()), y.push_back(at()), z.push_back(at());
      const bool up = next(3) != 0;
      nx.push_back(up ? 0.0f : 1.0f), ny.push_back(0.0f), nz.push_back(up ? 1.0f : 0.0f);
      ground.push_back(next(2) != 0);
    }
  }
  NeighbourSource source() const { return {x, y, z, nx, ny, nz, ground}; }
};

}  // namespace

TEST_CASE("neighbour list: sums and counts are those over all points, whatever the runs", "[property]") {
  const Raster raster(203);
  const Float3 corner = {4, 4, 4};
  const float radius = GENERATE(1.5f, 3.0f, 4.0f);
  const bool only_ground = GENERATE(false, true);
  const std::vector<std::pair<std::uint32_t, std::uint32_t>> runs = {{0, 5}, {5, 5}, {5, 100}, {101, 203}};
  NeighbourList list;
  CHECK(list.empty());
  list.fill(raster.source(), runs, corner, radius, only_ground, true);
  REQUIRE(!list.empty());
  int maximum = 0;
  for (int i = 0; i < 27; ++i) {
    const Float3 p = {static_cast<float>(i % 3) * 1.75f, static_cast<float>(i / 3 % 3) * 1.75f,
                      static_cast<float>(i / 9) * 1.75f};
    std::vector<std::uint32_t> packs;
    list.select(p, p, radius, packs);
    NeighbourSums sums;
    const int count = list.sum(packs, p, radius, sums, 2);
    const auto [near, agree] = list.supported(packs, p, {0, 0, 1}, radius);
    int want = 0, want_up = 0;
    double weight = 0.0, xz = 0.0;
    for (std::uint32_t k = 0; k < raster.x.size(); ++k) {
      if (k == 100 || (only_ground && raster.ground[k] == 0)) continue;
      const double d[3] = {static_cast<double>(raster.x[k]) - 4.0 - static_cast<double>(p[0]),
                           static_cast<double>(raster.y[k]) - 4.0 - static_cast<double>(p[1]),
                           static_cast<double>(raster.z[k]) - 4.0 - static_cast<double>(p[2])};
      const double square = d[0] * d[0] + d[1] * d[1] + d[2] * d[2],
                   r2 = static_cast<double>(radius * radius);
      if (!(square < r2)) continue;
      ++want;
      want_up += raster.nz[k] > 0.5f;
      const double q = 1.0 - square / r2;
      weight += q * q, xz += q * q * d[0] * d[2];
    }
    maximum = std::max(maximum, want);
    CHECK(count == want);
    CHECK(near == want);
    CHECK(agree == want_up);
    CHECK(sums.row[NeighbourSums::kWeight][2] == Approx(weight).margin(1e-4));
    CHECK(sums.row[NeighbourSums::kXZ][2] == Approx(xz).margin(1e-4));
    CHECK(sums.row[NeighbourSums::kWeight][1] == 0.0);
  }
  CHECK(maximum > 1);
}

TEST_CASE("neighbour list: packs are left out only where nothing can be a neighbour", "[unit]") {
  const Raster raster(203);
  const std::vector<std::pair<std::uint32_t, std::uint32_t>> runs = {{0, 203}};
  NeighbourList list;
  list.fill(raster.source(), runs, {4, 4, 4}, 4.0f, false, false);
  std::vector<std::uint32_t> all, some;
  list.select({0, 0, 0}, {4, 4, 4}, 4.0f, all);
  list.select({0, 0, 0}, {0, 0, 0}, 1.0f, some);
  CHECK(some.size() < all.size());
  const auto total = [&](const std::vector<std::uint32_t>& packs) {
    NeighbourSums sums;
    return std::pair(list.sum(packs, {0, 0, 0}, 1.0f, sums, 0), sums.row[NeighbourSums::kWeight][0]);
  };
  CHECK(total(some) == total(all));
  list.clear();
  CHECK(list.empty());
}

}  // namespace neighbour_list_test
