// The field of cubic splines: exact for polynomials, the same after refinement, derivatives and inverse that belong to it.
#include "kernels/edit/displacement_lattice.h"

#include <catch2/catch.hpp>
#include <cmath>

namespace displacement_lattice_test {

using namespace tessera;

namespace {

DisplacementLattice wavy() {
  DisplacementLattice lattice = DisplacementLattice::over({-1, 0, 2}, {3, 1.5, 3}, 0.5);
  for (std::size_t i = 0; i < lattice.coefficient.size(); ++i) {
    const auto x = static_cast<double>(i);
    lattice.coefficient[i] = Double3{std::sin(x), std::cos(1.7 * x), std::sin(0.3 * x + 1.0)} * 0.05;
  }
  return lattice;
}

constexpr Double3 kPlaces[] = {
    {-1, 0, 2}, {3, 1.5, 3}, {0.3, 0.7, 2.2}, {1.99, 1.01, 2.5}, {2.5, 0.25, 2.75}};

}  // namespace

TEST_CASE("displacement lattice: a linear field is exact", "[unit]") {
  DisplacementLattice lattice = DisplacementLattice::over({-1, 0, 2}, {3, 1.5, 3}, 0.5);
  for (std::size_t k = 0; k < lattice.nodes[2]; ++k)
    for (std::size_t j = 0; j < lattice.nodes[1]; ++j)
      for (std::size_t i = 0; i < lattice.nodes[0]; ++i) {
        const Double3 p = {-1 + 0.5 * (static_cast<double>(i) - 1), 0.5 * (static_cast<double>(j) - 1),
                           2 + 0.5 * (static_cast<double>(k) - 1)};
        lattice.coefficient[lattice.index(i, j, k)] = {2 * p[0] - p[1], p[2] + 1, 3 * p[1]};
      }
  for (const Double3& p : kPlaces) {
    CHECK(norm(lattice.at(p) - Double3{2 * p[0] - p[1], p[2] + 1, 3 * p[1]}) < 1e-12);
    const auto d = lattice.derivatives(p);
    CHECK(norm(d[0] - Double3{2, 0, 0}) < 1e-12);
    CHECK(norm(d[1] - Double3{-1, 0, 3}) < 1e-12);
    CHECK(norm(d[2] - Double3{0, 1, 0}) < 1e-12);
  }
  CHECK(norm(lattice.at({-5, 1, 2.5}) - lattice.at({-1, 1, 2.5})) == 0.0);
}

TEST_CASE("displacement lattice: refined it is the same field", "[unit]") {
  const DisplacementLattice coarse = wavy(), fine = coarse.refined();
  CHECK(fine.spacing == coarse.spacing / 2);
  for (const Double3& p : kPlaces) CHECK(norm(coarse.at(p) - fine.at(p)) < 1e-14);
}

TEST_CASE("displacement lattice: coarsening is the transpose of refinement", "[unit]") {
  const DisplacementLattice coarse = wavy(), fine = coarse.refined();
  std::vector<Double3> any(fine.coefficient.size());
  for (std::size_t i = 0; i < any.size(); ++i) any[i] = {std::cos(static_cast<double>(i)), 1.0, 0.5};
  const std::vector<Double3> down = coarsen_nodes(any, coarse.nodes);
  double left = 0.0, right = 0.0;
  for (std::size_t i = 0; i < any.size(); ++i) left += dot(any[i], fine.coefficient[i]);
  for (std::size_t i = 0; i < down.size(); ++i) right += dot(down[i], coarse.coefficient[i]);
  CHECK(left == Approx(right).epsilon(1e-12));
}

TEST_CASE("displacement lattice: derivatives are those of differences, the inverse leads back", "[unit]") {
  const DisplacementLattice lattice = wavy();
  const Double3 p = {0.63, 0.81, 2.37};
  const auto d = lattice.derivatives(p);
  for (std::size_t a = 0; a < 3; ++a) {
    Double3 low = p, high = p;
    low[a] -= 1e-5, high[a] += 1e-5;
    CHECK(norm((lattice.at(high) - lattice.at(low)) * (0.5 / 1e-5) - d[a]) < 1e-8);
  }
  CHECK(norm(lattice.origin_of(p + lattice.at(p)) - p) < 1e-8);
}

}  // namespace displacement_lattice_test
