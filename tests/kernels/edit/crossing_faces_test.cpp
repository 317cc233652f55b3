// Faces that pass through others are found, those that touch are not; as every pair tested tells.
#include "kernels/edit/crossing_faces.h"

#include <catch2/catch.hpp>

#include "tests/helpers/random.h"

namespace {

using namespace tessera;
using Face = std::array<std::uint32_t, 3>;

}  // namespace

TEST_CASE("crossing faces: two through each other, with and without a common vertex", "[unit]") {
  std::vector<Double3> p = {{0, 0, 0}, {2, 0, 0}, {0, 2, 0}, {0.5, 0.5, -1}, {0.5, 0.5, 1}, {3, 3, 1}};
  const std::vector<Face> apart = {{0, 1, 2}, {3, 4, 5}};
  CHECK(crossing_faces(p, apart, {}).faces == std::vector<std::uint32_t>{0, 1});
  CHECK(crossing_faces(p, apart, {}).pairs == 1);
  const std::vector<std::uint8_t> none = {0, 0}, second = {0, 1};
  CHECK(crossing_faces(p, apart, none).pairs == 0);
  CHECK(crossing_faces(p, apart, second).faces.size() == 2);
  CHECK(crossing_faces(p, apart, second).pairs == 1);
  const std::vector<Face> joined = {{0, 1, 2}, {0, 3, 4}};
  CHECK(crossing_faces(p, joined, {}).pairs == 1);
  p[3] = {0.5, 0.5, 0.0};  // touches from above
  CHECK(crossing_faces(p, apart, {}).pairs == 0);
  p[3] = {0.5, 0.5, 0.5};
  CHECK(crossing_faces(p, apart, {}).pairs == 0);
  CHECK(crossing_faces({}, {}, {}).pairs == 0);
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
      pairs += crossing_faces(p, two, {}).pairs;
    }
  CHECK(pairs > 30);
  CHECK(crossing_faces(p, faces, {}).pairs == pairs);
}
