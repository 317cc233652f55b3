// A long support as the isotropic operators see it, and as those of its scaled map do.
#include "kernels/edit/anisotropic_metric.h"

#include <catch2/catch.hpp>
#include <cmath>

#include "octree/error.h"
#include "tests/helpers/surfaces.h"

namespace anisotropic_metric_test {

namespace {

using namespace tessera;
using namespace tessera::test;

constexpr int kCells = 80;

/// A plate four times as long as wide, its middle a handle, its rim fixed.
Surface plate(std::vector<std::int32_t>& role) {
  Surface s = height_grid(kCells, 1.0, [](double, double) { return 0.0; });
  for (Double3& p : s.position) {
    const double x = p[0], y = p[1];
    const bool edge = std::min(std::min(x, y), std::min(1 - x, 1 - y)) < 0.1;
    const bool middle = std::fabs(x - 0.5) < 0.04 && std::fabs(y - 0.5) < 0.04;
    role.push_back(edge ? kFixedVertex : middle ? 0 : kSupportVertex);
    p[0] *= 4.0;
  }
  return s;
}

/// Height of the lifted plate at a share of the way from the handle to the rim, along and across.
std::array<double, 2> heights(const Surface& s, const std::vector<std::int32_t>& role,
                              const Laplacian& metric) {
  EditRegions regions;
  regions.role = role;
  regions.handles = {"middle"};
  EditBasisReport report;
  const EditBasis basis = edit_basis({s.position, s.faces}, metric, regions, {.order = 2}, report);
  Placement lift;
  lift.shift = {0, 0, 1};
  const std::vector<Double3> posed = smooth_base(basis, s.position, std::vector<Placement>{lift});
  const auto at = [&](int i, int j) { return posed[static_cast<std::size_t>(j * (kCells + 1) + i)][2]; };
  return {at(kCells / 2 + 18, kCells / 2), at(kCells / 2, kCells / 2 + 18)};
}

}  // namespace

TEST_CASE("anisotropic metric: a bump is as long as its support", "[unit]") {
  std::vector<std::int32_t> role;
  const Surface s = plate(role);
  AnisotropicReport report;
  const Laplacian even = anisotropic_metric({s.position, s.faces}, role, 2, report);
  CHECK(report.ratio == Approx(4.0).epsilon(0.1));
  CHECK(report.flipped == 0);
  const std::array<double, 2> with = heights(s, role, even),
                              without = heights(s, role, laplacian({s.position, s.faces}));
  CHECK(with[0] == Approx(with[1]).epsilon(0.05));
  CHECK(without[0] < 0.5 * without[1]);
}

TEST_CASE("anisotropic metric: what is no disk is refused", "[unit]") {
  const Surface s = sphere(3, 1.0);
  std::vector<std::int32_t> role;
  for (const Double3& p : s.position)
    role.push_back(p[2] > 0.6 ? kFixedVertex : p[2] < -0.6 ? kFixedVertex : kSupportVertex);
  AnisotropicReport report;
  CHECK_THROWS_AS(anisotropic_metric({s.position, s.faces}, role, 1, report), InputError);
  CHECK_THROWS_WITH(anisotropic_metric({s.position, s.faces}, role, 1, report),
                    Catch::Contains("the mesh is not a disk"));
}

}  // namespace anisotropic_metric_test
