#include "kernels/certify/near_proof.h"

#include <catch2/catch.hpp>

#include <cmath>

#include "octree/vector.h"
#include "tests/helpers/surfaces.h"

namespace near_proof_test {

namespace {

using namespace tessera;
using test::Surface;

/// A fan of `sides` faces around a tip over the origin.
Surface tent(std::size_t sides, double height) {
  Surface s;
  s.position.push_back({0, 0, height});
  for (std::size_t i = 0; i < sides; ++i) {
    const double angle = 6.283185307179586 * static_cast<double>(i) / static_cast<double>(sides);
    s.position.push_back({std::cos(angle), std::sin(angle), 0.0});
    s.faces.push_back(
        {0, static_cast<std::uint32_t>(i + 1), static_cast<std::uint32_t>((i + 1) % sides + 1)});
  }
  return s;
}

/// The largest distance of points of a triangle to some faces.
double sampled(const std::array<Double3, 3>& t, const Surface& s, std::span<const std::uint32_t> faces) {
  constexpr int kSteps = 24;
  double maximum = 0.0;
  for (int i = 0; i <= kSteps; ++i)
    for (int j = 0; i + j <= kSteps; ++j) {
      const Double3 p = t[0] + (t[1] - t[0]) * (double(i) / kSteps) + (t[2] - t[0]) * (double(j) / kSteps);
      double minimum = 1e300;
      for (const std::uint32_t f : faces) {
        const auto& v = s.faces[f];
        minimum = std::min(minimum,
                           test::triangle_distance(p, s.position[v[0]], s.position[v[1]], s.position[v[2]]));
      }
      maximum = std::max(maximum, minimum);
    }
  return maximum;
}

}  // namespace

TEST_CASE("near proof: bounds what samples find, whichever faces are given, and proves most of what holds",
          "[property]") {
  test::Random random(7);
  int within = 0, proven = 0, refused = 0;
  for (int n = 0; n < 1500; ++n) {
    const std::size_t sides = 3 + static_cast<std::size_t>(random.in(0.0, 7.0));
    const Surface s = tent(sides, random.in(-0.8, 0.8));
    std::vector<std::uint32_t> given;
    for (std::uint32_t f = 0; f < sides; ++f)
      if (n % 3 != 0 || random.in(0.0, 1.0) < 0.7) given.push_back(f);
    if (given.size() < 2) continue;
    // Over the tip, of corners that lie near the tent.
    std::array<Double3, 3> t;
    const double limit = random.in(0.02, 0.2);
    for (Double3& corner : t) {
      corner = {random.in(-0.5, 0.5), random.in(-0.5, 0.5), 0.0};
      corner[2] = s.position[0][2] * (1.0 - std::sqrt(corner[0] * corner[0] + corner[1] * corner[1])) +
                  random.in(-0.1, 0.1);
    }
    NearProof proof({s.position, s.faces}, {0, 0, 0});
    const double bound = proof.bound(t, given, limit), truth = sampled(t, s, given);
    CAPTURE(n, sides, limit, bound, truth);
    within += truth < 0.9 * limit;
    if (!(bound <= limit)) {
      refused += truth > limit;
      continue;
    }
    CHECK(bound >= truth - 1e-12);
    ++proven;
  }
  CHECK(refused > 100);
  CHECK(within > 200);
  CHECK(proven > within * 9 / 10);
}

}  // namespace near_proof_test
