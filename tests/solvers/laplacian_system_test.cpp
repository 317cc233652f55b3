// Systems of order 1, 2, 3: matrices against their definition, boundary conditions by measured convergence.
#include "solvers/laplacian_system.h"

#include <catch2/catch.hpp>
#include <cmath>

#include "octree/error.h"
#include "solvers/linear_solver.h"
#include "tests/helpers/irregular_mesh.h"
#include "tests/solvers/dense.h"

namespace laplacian_system_test {

namespace {

using namespace tessera;

struct Strip {
  std::vector<Double3> positions;
  std::vector<std::array<std::uint32_t, 3>> faces;
  std::vector<std::uint8_t> fixed;
  std::vector<double> values;
  std::size_t side = 0, margin = 0;
  double h = 0.0;
};

/// A regular grid; the outer quarter is fixed to a wavy function that no order reproduces.
Strip strip(std::size_t cells) {
  Strip s;
  s.side = cells + 1;
  s.margin = cells / 4;
  s.h = 1.0 / static_cast<double>(cells);
  for (std::size_t j = 0; j < s.side; ++j)
    for (std::size_t i = 0; i < s.side; ++i) {
      const double x = static_cast<double>(i) * s.h, y = static_cast<double>(j) * s.h;
      s.positions.push_back({x, y, 0.0});
      s.fixed.push_back(i <= s.margin || j <= s.margin || i >= s.side - 1 - s.margin ||
                        j >= s.side - 1 - s.margin);
      s.values.push_back(std::sin(4.0 * x + 1.0) * std::cos(3.0 * y) + x * x);
    }
  for (std::size_t j = 0; j + 1 < s.side; ++j)
    for (std::size_t i = 0; i + 1 < s.side; ++i) {
      const auto a = static_cast<std::uint32_t>(j * s.side + i), c = a + static_cast<std::uint32_t>(s.side);
      s.faces.push_back({a, a + 1, c + 1});
      s.faces.push_back({a, c + 1, c});
    }
  return s;
}

/// Jumps of the first and second derivative across the middle of the left boundary, by one-sided differences.
struct Jumps {
  double first, second;
};
Jumps jumps(std::size_t cells, int order) {
  Strip s = strip(cells);
  const Laplacian l = laplacian({s.positions, s.faces});
  const ConstrainedSystem system = laplacian_system(l, order, s.fixed);
  const auto solver = make_solver(SolverKind::kFronts);
  REQUIRE(solver->analyse(system.matrix).status == SolveStatus::kSolved);
  REQUIRE(solver->factor(system.matrix).status == SolveStatus::kSolved);
  const std::vector<double> b = system.right_hand_side(s.values, 1);
  std::vector<double> x(b.size());
  REQUIRE(solver->solve(b, x, 1).residual < 1e-9);
  system.scatter(x, s.values, 1);
  const double* u = s.values.data() + (s.side / 2) * s.side + s.margin;  // along x; u[0] is the boundary
  const double h = s.h;
  return {std::fabs((u[1] - u[0]) - (u[0] - u[-1])) / h,
          std::fabs((u[2] - 2 * u[1] + u[0]) - (u[0] - 2 * u[-1] + u[-2])) / (h * h)};
}

}  // namespace

TEST_CASE("laplacian system: matrices are (-1)^k L (M^-1 L)^(k-1) without fixed rows and columns", "[unit]") {
  const int order = GENERATE(1, 2, 3);
  const test::IrregularMesh mesh = test::irregular_mesh({.side = 14});
  const Laplacian l = laplacian({mesh.positions, mesh.faces});
  const Eigen::MatrixXd stiffness = test::dense(l.stiffness);
  const Eigen::VectorXd inverse_mass = test::dense(l.mass, 1).cwiseInverse();
  Eigen::MatrixXd full = stiffness;
  for (int k = 1; k < order; ++k) full = full * inverse_mass.asDiagonal() * stiffness;
  if (order % 2 == 1) full = -full;
  CHECK((test::dense(laplacian_power(l, order)) - full).norm() <= 1e-13 * full.norm());
  const ConstrainedSystem s = laplacian_system(l, order, mesh.fixed);
  CHECK(test::asymmetry(s.matrix) < 1e-14);
  for (std::size_t a = 0; a < s.free_vertices.size(); ++a)
    for (std::size_t b = 0; b < s.free_vertices.size(); ++b) {
      const auto i = static_cast<std::int32_t>(a), j = static_cast<std::int32_t>(b);
      if (std::fabs(entry(s.matrix, i, j) - full(s.free_vertices[a], s.free_vertices[b])) >
          1e-13 * full.norm())
        FAIL("row " << a << " column " << b);
    }
  // Every solver sees a positive definite matrix.
  const Eigen::LLT<Eigen::MatrixXd> llt(test::dense(s.matrix));
  REQUIRE(llt.info() == Eigen::Success);
  const std::vector<double> b = s.right_hand_side(mesh.target, 3);
  const Eigen::MatrixXd exact = llt.solve(test::dense(b, 3));
  for (const SolverKind kind : {SolverKind::kFronts, SolverKind::kMultigrid}) {
    CAPTURE(name(kind), order);
    const auto solver = make_solver(kind, {.tolerance = 1e-12, .order = order});
    REQUIRE(solver->analyse(s.matrix).status == SolveStatus::kSolved);
    REQUIRE(solver->factor(s.matrix).status == SolveStatus::kSolved);
    std::vector<double> x(b.size());
    const SolveReport report = solver->solve(b, x, 3);
    CHECK(report.status == SolveStatus::kSolved);
    CHECK(report.residual < 2e-12);
    CHECK((test::dense(x, 3) - exact).norm() < 1e-7 * exact.norm());
  }
}

TEST_CASE("laplacian system: order k meets its boundary with k - 1 derivatives", "[property]") {
  struct Case {
    int order;
    bool first, second;  // which derivatives must join
  };
  const auto c = GENERATE(Case{1, false, false}, Case{2, true, false}, Case{3, true, true});
  CAPTURE(c.order);
  const Jumps coarse = jumps(32, c.order), middle = jumps(64, c.order), fine = jumps(128, c.order);
  CAPTURE(coarse.first, middle.first, fine.first, coarse.second, middle.second, fine.second);
  if (c.first)
    CHECK((coarse.first > 1.6 * middle.first && middle.first > 1.6 * fine.first));
  else
    CHECK((fine.first > 0.7 * middle.first && fine.first > 0.1));
  if (c.second)
    CHECK((coarse.second > 1.6 * middle.second && middle.second > 1.6 * fine.second));
  else
    CHECK((fine.second > 0.7 * middle.second && fine.second > 0.05));
}

TEST_CASE("laplacian system: an order that is not there and a mesh without a free vertex are refused",
          "[unit]") {
  const test::IrregularMesh mesh = test::irregular_mesh({.side = 10});
  const Laplacian l = laplacian({mesh.positions, mesh.faces});
  CHECK_THROWS_AS(laplacian_system(l, 4, mesh.fixed), UsageError);
  CHECK_THROWS_AS(laplacian_system(l, 1, std::vector<std::uint8_t>(mesh.fixed.size(), 1)), UsageError);
}

TEST_CASE("laplacian system: an implicit step keeps the mean and damps what is rough", "[unit]") {
  const test::IrregularMesh mesh = test::irregular_mesh({.side = 20});
  const Laplacian l = laplacian({mesh.positions, mesh.faces});
  const int order = GENERATE(1, 2);
  const SparseMatrix a = implicit_step_matrix(l, order == 1 ? 1e-2 : 1e-4, order);
  std::vector<double> f(l.mass.size()), b(f.size()), x(f.size());
  double before = 0.0, after = 0.0, rough = 0.0, smooth = 0.0;
  for (std::size_t i = 0; i < f.size(); ++i) f[i] = i % 2 == 0 ? 1.0 : -1.0;
  for (std::size_t i = 0; i < f.size(); ++i) b[i] = l.mass[i] * f[i];
  const auto solver = make_solver(SolverKind::kFronts);
  REQUIRE(solver->analyse(a).status == SolveStatus::kSolved);
  REQUIRE(solver->factor(a).status == SolveStatus::kSolved);
  REQUIRE(solver->solve(b, x, 1).status == SolveStatus::kSolved);
  for (std::size_t i = 0; i < f.size(); ++i) {
    before += b[i];
    after += l.mass[i] * x[i];
    rough += l.mass[i] * f[i] * f[i];
    smooth += l.mass[i] * x[i] * x[i];
  }
  CHECK(after == Approx(before).margin(1e-10));
  CHECK(smooth < 0.2 * rough);
}

}  // namespace laplacian_system_test
