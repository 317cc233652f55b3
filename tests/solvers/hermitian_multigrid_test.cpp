// Complex Hermitian systems by multigrid: solutions, their independence of the start, and what is refused.
#include "solvers/hermitian_multigrid.h"

#include <catch2/catch.hpp>
#include <cmath>
#include <complex>
#include <limits>

#include "solvers/laplacian_system.h"
#include "tests/helpers/irregular_mesh.h"

namespace hermitian_multigrid_test {

namespace {

using namespace tessera;

/// A Laplacian with fixed vertices and, along every tenth row of unknowns, an antisymmetric part; the diagonal
/// outweighs it.
struct Problem {
  ConstrainedSystem system;
  SparseMatrix skew;
  std::vector<Double3> positions;
  std::vector<double> b;
};

Problem problem(std::size_t side) {
  const test::IrregularMesh mesh = test::irregular_mesh({.side = side});
  Problem p;
  p.system = laplacian_system(laplacian({mesh.positions, mesh.faces}), 1, mesh.fixed);
  for (const std::int32_t v : p.system.free_vertices) p.positions.push_back(mesh.positions[v]);
  SparseMatrix& a = p.system.matrix;
  p.skew.rows = p.skew.columns = a.rows;
  p.skew.start.push_back(0);
  for (std::int32_t i = 0; i < a.rows; ++i) {
    for (const std::int32_t j : {i - 1, i + 1})
      if (j >= 0 && j < a.rows && std::max(i, j) % 10 == 0) {
        const double v = 0.9 * std::fabs(entry(a, i, j));
        p.skew.column.push_back(j);
        p.skew.value.push_back(j > i ? v : -v);
        for (std::int32_t e = a.start[i]; e < a.start[i + 1]; ++e)
          if (a.column[e] == i) a.value[e] += v;
      }
    p.skew.start.push_back(static_cast<std::int32_t>(p.skew.column.size()));
  }
  for (std::int32_t i = 0; i < 2 * a.rows; ++i) p.b.push_back(std::sin(0.1 * i) + (i % 7 == 0));
  return p;
}

double residual(const Problem& p, const std::vector<double>& z) {
  using Complex = std::complex<double>;
  double sum = 0.0, norm = 0.0;
  const auto at = [](const std::vector<double>& v, std::int32_t i) {
    return Complex(v[2 * i], v[2 * i + 1]);
  };
  for (std::int32_t i = 0; i < p.skew.rows; ++i) {
    Complex r = at(p.b, i);
    norm += std::norm(r);
    for (std::int32_t j = 0; j < p.skew.rows; ++j)
      if (std::abs(j - i) < 400)  // numbers of neighbours are closer than that
        r -= Complex(entry(p.system.matrix, i, j), entry(p.skew, i, j)) * at(z, j);
    sum += std::norm(r);
  }
  return std::sqrt(sum / norm);
}

}  // namespace

TEST_CASE("hermitian multigrid: solves the complex system, on one level and on several", "[unit]") {
  for (const std::size_t side : {std::size_t{20}, std::size_t{80}}) {
    const Problem p = problem(side);
    HermitianMultigrid solver(p.system.matrix, p.skew, p.positions);
    REQUIRE(solver.report().status == SolveStatus::kSolved);
    std::vector<double> z(p.b.size());
    const SolveReport r = solver.solve(p.b, z, 1e-10, 100);
    CHECK(r.status == SolveStatus::kSolved);
    CHECK(r.iterations < 30);
    CHECK(residual(p, z) < 1e-9);
    // Another start leads to the same solution.
    std::vector<double> again(p.b.size(), 3.0);
    CHECK(solver.solve(p.b, again, 1e-10, 100).status == SolveStatus::kSolved);
    double largest = 0.0, difference = 0.0;
    for (std::size_t i = 0; i < z.size(); ++i) {
      largest = std::max(largest, std::fabs(z[i]));
      difference = std::max(difference, std::fabs(z[i] - again[i]));
    }
    CHECK(difference < 1e-6 * largest);
  }
}

TEST_CASE("hermitian multigrid: what cannot be solved is a value", "[unit]") {
  Problem p = problem(60);
  std::vector<double> z(p.b.size());
  SECTION("too few cycles") {
    HermitianMultigrid solver(p.system.matrix, p.skew, p.positions);
    const SolveReport r = solver.solve(p.b, z, 1e-12, 2);
    CHECK(r.status == SolveStatus::kNotConverged);
    CHECK_THAT(r.message, Catch::Contains("2 cycles"));
  }
  SECTION("a right-hand side that is not finite") {
    HermitianMultigrid solver(p.system.matrix, p.skew, p.positions);
    p.b[5] = std::numeric_limits<double>::infinity();
    CHECK(solver.solve(p.b, z, 1e-8, 100).status == SolveStatus::kNotFinite);
  }
  SECTION("a matrix that is not finite") {
    p.system.matrix.value[7] = std::nan("");
    CHECK(HermitianMultigrid(p.system.matrix, p.skew, p.positions).report().status ==
          SolveStatus::kNotFinite);
  }
  SECTION("an antisymmetric part that makes it indefinite") {
    for (double& v : p.skew.value) v *= 30.0;
    HermitianMultigrid solver(p.system.matrix, p.skew, p.positions);
    if (solver.report().status == SolveStatus::kSolved)
      CHECK(solver.solve(p.b, z, 1e-8, 200).status != SolveStatus::kSolved);
    else
      CHECK(solver.report().status == SolveStatus::kSingular);
  }
  SECTION("a row without anything") {
    for (std::int32_t e = p.system.matrix.start[3]; e < p.system.matrix.start[4]; ++e)
      p.system.matrix.value[e] = 0.0;
    CHECK(HermitianMultigrid(p.system.matrix, p.skew, p.positions).report().status == SolveStatus::kSingular);
  }
}

}  // namespace hermitian_multigrid_test
