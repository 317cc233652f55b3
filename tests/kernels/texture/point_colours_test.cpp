#include "kernels/texture/point_colours.h"

#include <catch2/catch.hpp>
#include <cmath>

#include "octree/portable_math.h"

namespace point_colours_test {

using namespace tessera;

namespace {

struct Coloured {
  std::vector<Float3> position;
  std::vector<std::uint32_t> rgba, normal;
};

/// A lattice in the plane of this height: red by x, green by y.
void add_lattice(Coloured& c, float z, std::uint32_t blue, const Double3& normal) {
  for (int j = 0; j < 40; ++j)
    for (int i = 0; i < 40; ++i) {
      c.position.push_back({static_cast<float>(i), static_cast<float>(j), z});
      c.rgba.push_back(static_cast<std::uint32_t>(5 * i) | static_cast<std::uint32_t>(5 * j) << 8 |
                       blue << 16);
      c.normal.push_back(pack_normal(normal));
    }
}

std::array<int, 3> channels(std::uint32_t rgba) {
  return {static_cast<int>(rgba & 255), static_cast<int>(rgba >> 8 & 255),
          static_cast<int>(rgba >> 16 & 255)};
}

}  // namespace

TEST_CASE("point colours: points keep their colours, between them lies what lies between", "[unit]") {
  Coloured c;
  add_lattice(c, 0.3f, 7, {0, 0, 1});
  const PointColours colours(c.position, c.rgba, {}, {1.0, 4.0, 8});
  std::vector<PointColours::Near> near;
  std::uint32_t rgba = 0;
  REQUIRE(colours.find({10, 20, 0}, {0, 0, 1}, rgba, near));
  CHECK(channels(rgba) == std::array<int, 3>{50, 100, 7});
  REQUIRE(colours.find({10.5, 20.5, 0}, {0, 0, 1}, rgba, near));
  CHECK(std::abs(channels(rgba)[0] - 53) <= 1);
  CHECK_FALSE(colours.find({10, 20, 9}, {0, 0, 1}, rgba, near));
  CHECK(rgba >> 24 == 255);
}

TEST_CASE("point colours: speckle is passed over", "[unit]") {
  Coloured c;
  add_lattice(c, 0.0f, 7, {0, 0, 1});
  c.rgba[20 * 40 + 10] = 0xffffffffu;
  const PointColours colours(c.position, c.rgba, {}, {1.0, 4.0, 8});
  std::vector<PointColours::Near> near;
  std::uint32_t rgba = 0;
  REQUIRE(colours.find({10, 20, 0}, {0, 0, 1}, rgba, near));
  CHECK(channels(rgba)[0] < 60);
}

TEST_CASE("point colours: of a thin wall each side keeps its own where normals are known", "[unit]") {
  Coloured c;
  add_lattice(c, 0.1f, 0, {0, 0, 1});
  add_lattice(c, -0.1f, 200, {0, 0, -1});
  const PointColours colours(c.position, c.rgba, c.normal, {1.0, 4.0, 8});
  std::vector<PointColours::Near> near;
  std::uint32_t rgba = 0;
  REQUIRE(colours.find({10.2, 20.3, -0.05}, {0, 0, 1}, rgba, near));
  CHECK(channels(rgba)[2] == 0);
  REQUIRE(colours.find({10.2, 20.3, 0.05}, {0, 0, -1}, rgba, near));
  CHECK(channels(rgba)[2] == 200);
}

TEST_CASE("point colours: normals of 32 bits", "[unit]") {
  for (int i = 0; i < 1000; ++i) {
    const auto at = [&](std::uint64_t axis) {
      return to_unit(random_bits(3, axis, static_cast<std::uint64_t>(i))) - 0.5;
    };
    const Double3 n = unit(Double3{at(0), at(1), at(2)});
    const std::uint32_t packed = pack_normal(n);
    CHECK(packed != 0);
    CHECK(norm(unpack_normal(packed) - n) < 1e-4);
  }
  CHECK(pack_normal({}) == 0);
  CHECK(unpack_normal(0) == Double3{});
}

}  // namespace point_colours_test
