#include "kernels/blends/curvature_tensors.h"

#include <catch2/catch.hpp>

#include "tests/helpers/block_meshes.h"
#include "tests/helpers/filleted.h"

namespace curvature_tensors_test {

using namespace tessera;
using namespace tessera::test;

TEST_CASE("vertex bends: a fillet bends across its axis by 1 / radius, flanks not at all", "[unit]") {
  const bool convex = GENERATE(true, false);
  Swept s;
  s.radius = 8.0;
  s.convex = convex;
  const MeshBlock block = swept_block(s);
  const std::vector<CurvatureTensor> curvatures =
      curvature_tensors(block, std::vector<std::uint8_t>(block.key.size(), 1), 3.0);
  std::size_t arc = 0, flank = 0;
  for (std::size_t v = 0; v < curvatures.size(); ++v) {
    const Double3& p = block.position[v];
    if (p[1] < 4.0 || p[1] > 36.0) continue;
    if (std::fabs(p[0]) < 2.0) {
      ++arc;
      CHECK(curvatures[v].across * (convex ? 1.0 : -1.0) == Approx(1.0 / 8.0).epsilon(0.12));
      CHECK(std::fabs(curvatures[v].minimum) < 0.02);
      CHECK(std::fabs(curvatures[v].along[1]) > 0.98);
      CHECK(curvatures[v].normal[2] > 0.9);
    } else if (std::fabs(p[0]) > 10.0) {
      ++flank;
      CHECK(std::fabs(curvatures[v].across) < 1e-9);
    }
  }
  CHECK(arc > 50);
  CHECK(flank > 50);
}

TEST_CASE("vertex bends: what is not asked for stays zero, what lies beyond the ball has no say", "[unit]") {
  Swept s;
  const MeshBlock whole = swept_block(s);
  const MeshBlock part = piece_of(whole, [&](std::uint32_t v) { return whole.position[v][1] < 25.0; });
  std::vector<std::uint8_t> wanted(part.key.size(), 0), all(whole.key.size(), 1);
  for (std::size_t v = 0; v < wanted.size(); ++v) wanted[v] = part.position[v][1] < 18.0;
  const std::vector<CurvatureTensor> some = curvature_tensors(part, wanted, 4.0),
                                     every = curvature_tensors(whole, all, 4.0);
  std::size_t compared = 0;
  for (std::size_t v = 0; v < part.key.size(); ++v) {
    if (!wanted[v]) {
      CHECK(some[v].across == 0.0);
      continue;
    }
    const auto at = static_cast<std::size_t>(
        std::lower_bound(whole.key.begin(), whole.key.end(), part.key[v]) - whole.key.begin());
    CHECK(some[v].across == every[at].across);
    CHECK(some[v].along == every[at].along);
    ++compared;
  }
  CHECK(compared > 100);
}

}  // namespace curvature_tensors_test
