#include <catch2/catch.hpp>
#include <cmath>

#include "octree/morton.h"
#include "octree/points.h"

namespace points_test {

using namespace tessera;

TEST_CASE("morton: decode inverts encode", "[unit]") {
  for (std::uint32_t v : {0u, 1u, 2u, 12345u, (1u << 21) - 1}) {
    const auto c = morton_decode(morton_encode(v, v / 3, v ^ 5u));
    CHECK(c == std::array<std::uint32_t, 3>{v, v / 3, v ^ 5u});
  }
}

TEST_CASE("normals: octahedral code keeps directions to 1e-4 rad", "[unit]") {
  for (int i = 0; i < 2000; ++i) {
    const double z = 1.0 - 2.0 * (i + 0.5) / 2000.0;
    const double r = std::sqrt(1.0 - z * z);
    const double a = 2.399963 * i;
    const float n[3] = {float(r * std::cos(a)), float(r * std::sin(a)), float(z)};
    const std::uint32_t code = encode_normal(n[0], n[1], n[2]);
    REQUIRE(code != kNoNormal);
    const Float3 d = decode_normal(code);
    const double dx = d[0] - n[0], dy = d[1] - n[1], dz = d[2] - n[2];
    CHECK(std::sqrt(dx * dx + dy * dy + dz * dz) < 1e-4);
  }
  CHECK(encode_normal(0, 0, 0) == kNoNormal);
  CHECK(decode_normal(encode_normal(0, 0, -1)) == Float3{0, 0, -1});
}

}  // namespace points_test
