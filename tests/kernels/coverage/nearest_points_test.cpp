// The nearest neighbours of points, and what they tell of spacing and surfaces.
#include <algorithm>
#include <catch2/catch.hpp>
#include <vector>

#include "kernels/coverage/nearest_points.h"
#include "tests/helpers/random.h"

namespace nearest_points_test {

using namespace tessera;

namespace {

struct Cloud {
  std::vector<float> x, y, z;
  void add(const Float3& p) { x.push_back(p[0]), y.push_back(p[1]), z.push_back(p[2]); }
  Float3 at(std::size_t i) const { return {x[i], y[i], z[i]}; }
};

using Neighbours = std::vector<NearestPoints::Neighbour>;

Neighbours brute_force(const Cloud& cloud, const Float3& p, std::size_t count, double limit) {
  Neighbours all;
  for (std::uint32_t i = 0; i < cloud.x.size(); ++i) {
    const double square = squared_distance(wide(cloud.at(i)), wide(p));
    if (square <= limit * limit) all.push_back({square, i});
  }
  std::sort(all.begin(), all.end(), [](const auto& a, const auto& b) {
    return a.square != b.square ? a.square < b.square : a.point < b.point;
  });
  all.resize(std::min(count, all.size()));
  return all;
}

/// A square grid on z = 0 of 13 by 13 points, bent and shaken by what `height` says.
template <class Height>
Cloud sheet(const Height& height) {
  Cloud cloud;
  for (int j = 0; j < 13; ++j)
    for (int i = 0; i < 13; ++i)
      cloud.add({static_cast<float>(i), static_cast<float>(j), static_cast<float>(height(i, j))});
  return cloud;
}

bool middle_is_confirmed(const Cloud& cloud, std::size_t middle = 6 * 13 + 6) {
  const NearestPoints nearest(cloud.x, cloud.y, cloud.z, 2.0);
  Neighbours found;
  nearest.find(cloud.at(middle), kConfirmingPoints, kConfirmingReach, found);
  if (found.size() < kConfirmingPoints) return false;
  std::array<Float3, kConfirmingPoints> at{};
  for (std::size_t i = 0; i < at.size(); ++i) at[i] = cloud.at(found[i].point);
  return confirmed(cloud.at(middle), at, 1.0);
}

}  // namespace

TEST_CASE("nearest points: the same as by looking at all, with ties and fewer than asked for", "[unit]") {
  test::Random random(11);
  Cloud cloud;
  for (int i = 0; i < 3000; ++i) {
    Float3 p{};
    // Steps of an eighth: many are equally far. A few lie far away, so that cubes are large.
    for (float& c : p) c = static_cast<float>(static_cast<int>(random.in(0.0, 80.0))) * 0.125f;
    if (i % 500 == 0) p[2] += 200.0f;
    cloud.add(p);
  }
  for (const double edge : {0.05, 0.7, 40.0}) {
    const NearestPoints nearest(cloud.x, cloud.y, cloud.z, edge);
    Neighbours found;
    for (std::size_t i = 0; i < cloud.x.size(); i += 97)
      for (const double limit : {0.5, 3.0}) {
        nearest.find(cloud.at(i), 13, limit, found);
        const Neighbours all = brute_force(cloud, cloud.at(i), 13, limit);
        CAPTURE(edge, i, limit);
        REQUIRE(found.size() == all.size());
        for (std::size_t k = 0; k < all.size(); ++k) REQUIRE(found[k].point == all[k].point);
      }
  }
}

TEST_CASE("nearest points: any neighbour of a square grid tells its spacing", "[unit]") {
  const Cloud cloud = sheet([](int, int) { return 0.0; });
  const NearestPoints nearest(cloud.x, cloud.y, cloud.z, 1.0);
  Neighbours found;
  nearest.find(cloud.at(6 * 13 + 6), 9, 4.0, found);
  REQUIRE(found.size() == 9);
  for (int n = 1; n <= 8; ++n)
    CHECK(spacing_by_neighbour(found[static_cast<std::size_t>(n)].square, n) == Approx(1.0));
}

TEST_CASE("nearest points: a surface confirms, its corner, lines and strewn points do not", "[unit]") {
  CHECK(middle_is_confirmed(sheet([](int, int) { return 0.0; })));
  CHECK(middle_is_confirmed(sheet([](int i, int j) { return 0.1 * ((i * 7 + j * 3) % 5 - 2); })));
  CHECK(middle_is_confirmed(sheet([](int i, int) { return 0.7 * i; })));
  CHECK_FALSE(middle_is_confirmed(sheet([](int i, int j) { return 1.2 * ((i * 7 + j * 3) % 5 - 2); })));
  CHECK_FALSE(middle_is_confirmed(sheet([](int, int) { return 0.0; }), 0));  // in a corner
  Cloud line, sparse;
  for (int i = 0; i < 169; ++i) {
    line.add({0.25f * static_cast<float>(i), 0.02f * static_cast<float>(i % 3),
              0.01f * static_cast<float>(i % 2)});
    sparse.add({2.5f * static_cast<float>(i % 13), 2.5f * static_cast<float>(i / 13), 0.0f});
  }
  CHECK_FALSE(middle_is_confirmed(line));
  CHECK_FALSE(middle_is_confirmed(sparse));
}

TEST_CASE("nearest points: nothing to find among no points", "[unit]") {
  const NearestPoints nearest({}, {}, {}, 1.0);
  Neighbours found = {{1.0, 2}};
  nearest.find({0, 0, 0}, 3, 1.0, found);
  CHECK(found.empty());
}

}  // namespace nearest_points_test
