#include "kernels/remesh/sizing_field.h"

#include <catch2/catch.hpp>

#include <cmath>

#include "tests/helpers/block_meshes.h"

namespace sizing_field_test {

using namespace tessera;
using namespace tessera::test;

namespace {

std::vector<float> lengths(const MeshBlock& block, const SizingOptions& options) {
  return sizing_field(block, std::vector<std::uint8_t>(block.key.size(), 0), {}, {}, options);
}

}  // namespace

TEST_CASE("sizing field: on a sphere a chord of the length stays within the tolerance", "[unit]") {
  const MeshBlock sphere = sphere_block(5);
  for (const double e : {0.001, 0.01, 0.05}) {
    CAPTURE(e);
    const double expected = std::sqrt(6.0 * e - 3.0 * e * e);
    for (const float length : lengths(sphere, {e, 0.001, 10.0}))
      REQUIRE(static_cast<double>(length) == Approx(expected).epsilon(0.2));
  }
  for (const float length : lengths(sphere, {0.0, 0.001, 3.0})) REQUIRE(length == 3.0f);
  for (const float length : lengths(sphere, {0.01, 0.3, 10.0})) REQUIRE(length >= 0.3f);
}

TEST_CASE("sizing field: lengths grow slowly away from what bends, and are the longest far from it",
          "[unit]") {
  const MeshBlock fold =
      grid_block(120, 20, [](double x, double) { return x < 10.0 ? 0.05 * (10.0 - x) * (10.0 - x) : 0.0; });
  const SizingOptions options{0.02, 0.1, 15.0};
  const std::vector<float> length = lengths(fold, options);
  for (const auto& f : fold.faces)
    for (std::size_t k = 0; k < 3; ++k) {
      const std::uint32_t a = f[k], b = f[(k + 1) % 3];
      const double distance = norm(fold.position[a] - fold.position[b]);
      REQUIRE(std::fabs(static_cast<double>(length[a] - length[b])) <= kSizingGrowth * distance + 1e-5);
    }
  for (std::size_t v = 0; v < length.size(); ++v) {
    if (fold.position[v][0] > 95.0) CHECK(length[v] == 15.0f);
    if (fold.position[v][0] < 8.0) CHECK(length[v] < 3.0f);
  }
}

TEST_CASE("sizing field: a line that turns is cut as finely as half the tolerance asks for", "[unit]") {
  const MeshBlock plane = grid_block(20, 20, [](double, double) { return 0.0; });
  std::vector<std::uint8_t> on_line(plane.key.size(), 0);
  // A right turn over two steps of unit length: curvature sqrt(2).
  const std::array<std::uint32_t, 3> corner = {10 * 21 + 9, 10 * 21 + 10, 11 * 21 + 10};
  for (const std::uint32_t v : corner) on_line[v] = 1;
  const std::vector<float> length = sizing_field(plane, on_line, std::vector{corner}, {}, {0.1, 0.01, 5.0});
  const double e = 0.05;
  CHECK(static_cast<double>(length[corner[1]]) ==
        Approx(std::sqrt(6.0 * e / std::sqrt(2.0) - 3.0 * e * e)).epsilon(1e-6));
  CHECK(length[0] > length[corner[1]]);
}

}  // namespace sizing_field_test
