// The smoothest displacement that brings places onto planes.
#include "kernels/edit/lattice_fit.h"

#include <catch2/catch.hpp>
#include <cmath>
#include <vector>

namespace lattice_fit_test {

using namespace tessera;

namespace {

/// Places on the sides of the unit cube, to be moved by `wanted` as far as their normals tell.
template <class Wanted>
std::vector<PlaneSample> cube_samples(const Wanted& wanted) {
  constexpr int kSide = 12;
  std::vector<PlaneSample> out;
  for (std::size_t a = 0; a < 3; ++a)
    for (const double end : {0.0, 1.0})
      for (int i = 0; i < kSide; ++i)
        for (int j = 0; j < kSide; ++j) {
          PlaneSample s;
          s.at[a] = end;
          s.at[(a + 1) % 3] = (i + 0.5) / kSide;
          s.at[(a + 2) % 3] = (j + 0.5) / kSide;
          s.normal[a] = end > 0.0 ? 1.0 : -1.0;
          s.offset = dot(s.normal, wanted(s.at));
          out.push_back(s);
        }
  return out;
}

DisplacementLattice refined_lattice(std::size_t times) {
  DisplacementLattice lattice = DisplacementLattice::over({0, 0, 0}, {1, 1, 1}, 0.5);
  for (std::size_t k = 0; k < times; ++k) lattice = lattice.refined();
  return lattice;
}

double off(const DisplacementLattice& lattice, const std::vector<PlaneSample>& samples) {
  double worst = 0.0;
  for (const PlaneSample& s : samples)
    worst = std::max(worst, std::fabs(dot(s.normal, lattice.at(s.at)) - s.offset));
  return worst;
}

}  // namespace

TEST_CASE("lattice fit: what is linear costs nothing, however stiff", "[unit]") {
  const auto samples = cube_samples([](const Double3& p) {
    return Double3{0.1 * p[0] + 0.02 * p[1] + 0.3, 0.05 * p[2] - 0.02 * p[0], 0.2 * p[2]};
  });
  for (const int order : {2, 3}) {
    DisplacementLattice lattice = refined_lattice(2);
    fit_lattice(lattice, 2, samples,
                {.order = order, .stiffness = 10.0, .hold = 1e-9, .tolerance = 1e-7, .max_iterations = 1000});
    CHECK(off(lattice, samples) < 1e-4);
  }
}

TEST_CASE("lattice fit: a bend is followed where it is cheap, and not where it costs", "[unit]") {
  const auto samples = cube_samples([](const Double3& p) {
    return Double3{0, 0, 0.1 * std::sin(6.0 * p[0])};
  });
  double last = 1.0;
  for (const double stiffness : {10.0, 1e-5, 1e-8}) {
    DisplacementLattice lattice = refined_lattice(3);
    fit_lattice(lattice, 3, samples, {.stiffness = stiffness, .tolerance = 1e-6});
    const double now = off(lattice, samples);
    CHECK(now < 0.5 * last);
    last = now;
  }
  CHECK(last < 1e-3);
}

TEST_CASE("lattice fit: levels of the preconditioner change the way, not the end", "[unit]") {
  const auto samples = cube_samples([](const Double3& p) {
    return Double3{0, 0.02 * p[0] * p[2], 0.05 * p[0] * p[0]};
  });
  DisplacementLattice one = refined_lattice(3), all = one;
  const LatticeFitOptions options{.stiffness = 1e-4, .tolerance = 1e-8, .max_iterations = 20000};
  const int alone = fit_lattice(one, 0, samples, options).iterations;
  const int levels = fit_lattice(all, 3, samples, options).iterations;
  CHECK(2 * levels < alone);
  for (const PlaneSample& s : samples) CHECK(norm(one.at(s.at) - all.at(s.at)) < 1e-5);
}

}  // namespace lattice_fit_test
