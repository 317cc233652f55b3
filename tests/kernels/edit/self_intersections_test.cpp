// Faces that pass through others are found, those that touch are not; as every pair tested tells.
#include "kernels/edit/self_intersections.h"

#include <catch2/catch.hpp>
#include <cmath>

#include "tests/helpers/random.h"

namespace self_intersections_test {

namespace {

using namespace tessera;
using Face = std::array<std::uint32_t, 3>;

}  // namespace

TEST_CASE("crossing faces: two through each other, with and without a common vertex", "[unit]") {
  std::vector<Double3> p = {{0, 0, 0}, {2, 0, 0}, {0, 2, 0}, {0.5, 0.5, -1}, {0.5, 0.5, 1}, {3, 3, 1}};
  const std::vector<Face> apart = {{0, 1, 2}, {3, 4, 5}};
  CHECK(self_intersections(p, apart, {}).faces == std::vector<std::uint32_t>{0, 1});
  CHECK(self_intersections(p, apart, {}).pairs == 1);
  const std::vector<std::uint8_t> none = {0, 0}, second = {0, 1};
  CHECK(self_intersections(p, apart, none).pairs == 0);
  CHECK(self_intersections(p, apart, second).faces.size() == 2);
  CHECK(self_intersections(p, apart, second).pairs == 1);
  const std::vector<Face> joined = {{0, 1, 2}, {0, 3, 4}};
  CHECK(self_intersections(p, joined, {}).pairs == 1);
  // One folds, the other meets what is not connected with it at all.
  CHECK(self_intersections(p, joined, {}).local == 2);
  CHECK(self_intersections(p, apart, {}).local == 0);
  p[3] = {0.5, 0.5, 0.0};  // touches from above
  CHECK(self_intersections(p, apart, {}).pairs == 0);
  p[3] = {0.5, 0.5, 0.5};
  CHECK(self_intersections(p, apart, {}).pairs == 0);
  CHECK(self_intersections({}, {}, {}).pairs == 0);
}

TEST_CASE("crossing faces: a line of crossing that ends near is not local where it meets what is far",
          "[unit]") {
  // A strip wound up to one turn and a bit, whose end passes through its beginning at a slant.
  constexpr int kCount = 60;
  std::vector<Double3> p;
  std::vector<Face> faces;
  for (int i = 0; i <= kCount; ++i) {
    const double angle = 2.0 * 3.14159265358979 * 1.1 * i / kCount;
    for (const double z : {0.0, 1.0}) {
      const double r = 3.0 + (i > kCount / 2 ? 0.3 * (z - 0.5) : 0.0);
      p.push_back({r * std::cos(angle), r * std::sin(angle), z});
    }
  }
  for (std::uint32_t i = 0; i < kCount; ++i) {
    faces.push_back({2 * i, 2 * i + 2, 2 * i + 1});
    faces.push_back({2 * i + 1, 2 * i + 2, 2 * i + 3});
  }
  const SelfIntersections wound = self_intersections(p, faces, {});
  CHECK(wound.faces.size() > 4);
  CHECK(wound.local == 0);
}

TEST_CASE("crossing faces: the tree misses none that pairs one by one find", "[property]") {
  test::Random random(7);
  std::vector<Double3> p;
  std::vector<Face> faces;
  for (std::uint32_t f = 0; f < 300; ++f) {
    const Double3 at = {random.unit(), random.unit(), random.unit()};
    for (int k = 0; k < 3; ++k) p.push_back(at + Double3{random.unit(), random.unit(), random.unit()} * 0.2);
    faces.push_back({3 * f, 3 * f + 1, 3 * f + 2});
  }
  std::size_t pairs = 0;
  for (std::size_t f = 0; f < faces.size(); ++f)
    for (std::size_t g = f + 1; g < faces.size(); ++g) {
      const std::vector<Face> two = {faces[f], faces[g]};
      pairs += self_intersections(p, two, {}).pairs;
    }
  CHECK(pairs > 30);
  CHECK(self_intersections(p, faces, {}).pairs == pairs);
}

}  // namespace self_intersections_test
