// What a tolerance of colours keeps of a mesh that is decimated.
#include <catch2/catch.hpp>

#include <algorithm>
#include <cmath>

#include "kernels/decimate/decimate.h"
#include "octree/vector.h"
#include "tests/helpers/block_meshes.h"

namespace colour_guard_test {

using namespace tessera;
using namespace tessera::test;

TEST_CASE("colour guard: a flat table keeps its borders of colours", "[unit]") {
  MeshBlock b = grid_block(30, 30, [](double, double) { return 0.0; });
  const auto red = [](const Double3& p) { return p[0] + 0.4 * p[1] < 17.3; };
  for (const Double3& p : b.position) b.rgba.push_back(red(p) ? 0xff0000ffu : 0xffff0000u);
  const MeshBlock original = b;
  // Vertices of the original that the result shows in another colour, farther from the border than an edge.
  const auto smeared = [&](double colour_tolerance, std::size_t& faces) {
    DecimateOptions o;
    o.tolerance = 0.01;
    o.colour_tolerance = colour_tolerance;
    b = original;
    decimate(b, original, o);
    faces = b.faces.size();
    std::size_t count = 0;
    for (std::size_t v = 0; v < original.position.size(); ++v) {
      const Double3& p = original.position[v];
      if (std::fabs(p[0] + 0.4 * p[1] - 17.3) < 2.0) continue;
      for (const auto& t : b.faces) {
        Double3 w{};
        double whole = 0.0;
        bool inside = true;
        for (std::size_t k = 0; k < 3; ++k) {
          const Double3 &q = b.position[t[(k + 1) % 3]], &r = b.position[t[(k + 2) % 3]];
          w[k] = (q[0] - p[0]) * (r[1] - p[1]) - (q[1] - p[1]) * (r[0] - p[0]);
          inside = inside && w[k] >= 0.0;
          whole += w[k];
        }
        if (!inside || !(whole > 0.0)) continue;
        double level = 0.0;
        for (std::size_t k = 0; k < 3; ++k) level += w[k] / whole * (b.rgba[t[k]] & 255u);
        count += std::fabs(level - (original.rgba[v] & 255u)) > 64.0;
        break;
      }
    }
    return count;
  };
  std::size_t loose = 0, tight = 0;
  CHECK(smeared(0.0, loose) > 50);
  CHECK(smeared(32.0, tight) == 0);
  CHECK(loose < tight);
  CHECK(tight < 400);
  // These colours have no noise: by default as little as shows may change.
  std::size_t automatic = 0;
  CHECK(smeared(kAutoColourTolerance, automatic) == 0);
  CHECK(tight <= automatic);
}

TEST_CASE("colour guard: the tolerance follows the noise of colours, and the report tells what they keep",
          "[unit]") {
  const auto decimated = [](std::uint32_t noise, bool border) {
    MeshBlock b = grid_block(30, 30, [](double, double) { return 0.0; });
    for (std::size_t v = 0; v < b.position.size(); ++v) {
      const std::uint32_t grey = 100 + static_cast<std::uint32_t>(v * 2654435761u >> 16) % (noise + 1);
      b.rgba.push_back(border && b.position[v][0] < 13.5 ? 0xff000000u : 0xff000000u | grey * 0x10101u);
    }
    DecimateOptions o;
    o.tolerance = 0.01;
    o.colour_tolerance = kAutoColourTolerance;
    const MeshBlock original = b;
    return decimate(b, original, o);
  };
  const DecimateReport plain = decimated(0, false), noisy = decimated(20, false),
                       painted = decimated(0, true);
  CHECK(plain.colour_tolerance == 8.0);
  CHECK(noisy.colour_tolerance > 40.0);
  CHECK(noisy.colour_tolerance <= 80.0);
  CHECK(painted.colour_tolerance == 8.0);
  CHECK(plain.kept_for_colour == 0);
  CHECK(noisy.faces_out <= 8);
  CHECK(painted.kept_for_colour > 0);
  CHECK(painted.kept_for_colour < painted.vertices_out);
  CHECK(painted.faces_out > plain.faces_out);
  // No border stands out of so much noise: colours follow.
  const DecimateReport wild = decimated(155, false);
  CHECK(wild.colour_tolerance == 0.0);
  CHECK(wild.faces_out == plain.faces_out);
}

TEST_CASE("colour guard: optimal places keep to the tolerance as well", "[unit]") {
  MeshBlock b = grid_block(30, 30, [](double x, double y) { return 0.2 * std::sin(x) * std::cos(0.7 * y); });
  for (const Double3& p : b.position) b.rgba.push_back(p[0] < 13.5 ? 0xff0000ffu : 0xffff0000u);
  const MeshBlock original = b;
  DecimateOptions o;
  o.tolerance = 0.2;
  o.placement = DecimatePlacement::kOptimal;
  const auto blended = [&] {
    return std::count_if(b.rgba.begin(), b.rgba.end(),
                         [](std::uint32_t c) { return c != 0xff0000ffu && c != 0xffff0000u; });
  };
  decimate(b, original, o);
  CHECK(blended() > 0);
  b = original;
  o.colour_tolerance = 32.0;
  decimate(b, original, o);
  CHECK(blended() == 0);
}

}  // namespace colour_guard_test
