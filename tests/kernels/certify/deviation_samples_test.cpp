// Surfaces cut into triangles for maps of distances.
#include "kernels/certify/deviation_samples.h"

#include <catch2/catch.hpp>

#include <algorithm>
#include <cmath>
#include <vector>

#include "octree/vector.h"

namespace deviation_samples_test {

namespace {

using namespace tessera;

struct Cut {
  std::size_t pieces = 0;
  double area = 0.0, longest = 0.0;
  float maximum = 0.0f;
};

/// One face over a plane that lies 0.5 below all of it.
Cut cut_face(const std::array<Double3, 3>& corner, double edge) {
  const std::vector<Double3> plane = {{-100, -100, -0.5}, {200, -100, -0.5}, {50, 300, -0.5}};
  const std::vector<std::array<std::uint32_t, 3>> one = {{0, 1, 2}};
  const std::vector<Double3> face(corner.begin(), corner.end());
  const ClosestFaces reference(plane, one, {0, 0, 0});
  Cut cut;
  sample_deviation({face, one}, {{-1e9, -1e9, -1e9}, {1e9, 1e9, 1e9}}, reference, {edge, 10.0, false},
                   [&](const DeviationTriangle& t) {
                     ++cut.pieces;
                     cut.area += 0.5 * norm(triangle_normal(t.corner[0], t.corner[1], t.corner[2]));
                     for (std::size_t k = 0; k < 3; ++k)
                       cut.longest = std::max(cut.longest, norm(t.corner[(k + 1) % 3] - t.corner[k]));
                     for (const float d : t.deviation)
                       cut.maximum = std::max(cut.maximum, std::abs(d - 0.5f));
                   });
  return cut;
}

}  // namespace

TEST_CASE("deviation samples: a needle is cut along its length, not into a grid", "[unit]") {
  // 1000 edges of the sampling long, half of one high.
  const Cut cut = cut_face({Double3{0, 0, 0}, {100, 0, 0}, {40, 0.05, 0}}, 0.1);
  CHECK(cut.pieces > 1000);
  CHECK(cut.pieces < 50'000);  // a grid has 10^6
  CHECK(cut.longest <= 0.1);
  CHECK(cut.area == Approx(2.5));
  CHECK(cut.maximum < 1e-6f);
}

TEST_CASE("deviation samples: what is too thin to be seen is measured once", "[unit]") {
  const Cut cut = cut_face({Double3{0, 0, 0}, {100, 0, 0}, {40, 0.003, 0}}, 0.1);
  CHECK(cut.pieces == 1);
  CHECK(cut.area == Approx(0.15));
}

TEST_CASE("deviation samples: a round face is cut until no side is longer than asked for", "[unit]") {
  const Cut cut = cut_face({Double3{0, 0, 0}, {1, 0, 0}, {0, 1, 0}}, 0.1);
  CHECK(cut.longest <= 0.1 * (1.0 + 1e-12));
  CHECK(cut.pieces < 400);
  CHECK(cut.area == Approx(0.5));
}

}  // namespace deviation_samples_test
