// Splits behind the last iteration, where no tolerance asks for them.
#include <catch2/catch.hpp>

#include <cmath>

#include "kernels/remesh/remesh.h"
#include "tests/helpers/block_meshes.h"
#include "tests/helpers/mesh_checks.h"
#include "tests/helpers/remeshed_block.h"

namespace remesher_refine_test {

using namespace tessera;
using namespace tessera::test;

TEST_CASE("remesh: a few splits bring a surface within a share of the edges, many are not made", "[unit]") {
  constexpr double kEdge = 6.0, kWithin = 0.08 * kEdge;
  /// Of bumps no wider than some edges, `apart` from each other.
  const auto bumps = [](double apart) {
    return grid_block(120, 120, [=](double x, double y) {
      const double u = std::remainder(x - 60, apart), v = std::remainder(y - 60, apart);
      return 4.0 * std::exp(-(u * u + v * v) / 40.0);
    });
  };
  const auto distance = [&](const MeshBlock& block, double within, RemeshReport& report) {
    RemeshOptions o = options_for(kEdge);
    o.tolerance = 0.2 * kEdge;
    o.refine_within = within;
    const MeshBlock out = remeshed(block, o, &report);
    CHECK(checks_of(out).defects() == 0);
    return certified(out, block, 0.25 * kEdge);
  };
  RemeshReport plain, few, many, none;
  const MeshBlock one = bumps(120), all = bumps(15);
  CHECK(distance(one, 0.0, plain) > 1.5 * kWithin);
  CHECK(distance(one, kWithin, few) <= 1.05 * kWithin);
  CHECK(few.faces_out > plain.faces_out);
  CHECK(few.faces_out < plain.faces_out + plain.faces_out / 10);
  CHECK(distance(all, kWithin, many) > 1.5 * kWithin);
  distance(all, 0.0, none);
  CHECK(many.faces_out < none.faces_out + none.faces_out / 20);
}

}  // namespace remesher_refine_test
