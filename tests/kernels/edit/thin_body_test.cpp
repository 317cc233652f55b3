// Wires and sheets are told from bodies as wide as long.
#include "kernels/edit/thin_body.h"

#include <catch2/catch.hpp>
#include <cmath>

#include "tests/helpers/surfaces.h"

namespace thin_body_test {

using namespace tessera;

TEST_CASE("thin body: what is thinner than the width, however its triangles lie", "[unit]") {
  const test::Surface ball = test::sphere(3, 10.0);
  CHECK(thin_body_share(ball.position, ball.faces, 2.0) < 0.01);
  CHECK(thin_body_share(ball.position, ball.faces, 50.0) > 0.99);
  // A prism a hundred times as long as thick, of twelve long faces.
  std::vector<Double3> wire;
  for (int k = 0; k < 6; ++k)
    for (const double x : {0.0, 200.0})
      wire.push_back({x, std::cos(k * 3.14159265 / 3.0), std::sin(k * 3.14159265 / 3.0)});
  std::vector<std::array<std::uint32_t, 3>> faces;
  for (std::uint32_t k = 0; k < 6; ++k) {
    const std::uint32_t a = 2 * k, b = 2 * ((k + 1) % 6);
    faces.push_back({a, a + 1, b});
    faces.push_back({b, a + 1, b + 1});
  }
  CHECK(thin_body_share(wire, faces, 0.3) < 0.01);
  CHECK(thin_body_share(wire, faces, 8.0) > 0.9);
  CHECK(thin_body_share({}, {}, 1.0) == 0.0);
}

}  // namespace thin_body_test
