// The solvers behind one interface: results, reports, and everything that can go wrong with a system.
#include "solvers/linear_solver.h"

#include <catch2/catch.hpp>
#include <cmath>
#include <limits>

#include "octree/error.h"
#include "solvers/laplacian_system.h"
#include "tests/helpers/cholmod_solver.h"
#include "tests/helpers/irregular_mesh.h"
#include "tests/solvers/dense.h"

namespace linear_solver_test {

namespace {

using namespace tessera;

struct Problem {
  test::IrregularMesh mesh;
  Laplacian operators;
  ConstrainedSystem system;
  SparseMatrix neighbours;
  std::vector<Double3> positions;
  std::vector<double> b;
};

Problem problem(std::size_t side, int order, double stretch = 1.0) {
  Problem p;
  p.mesh = test::irregular_mesh({.side = side, .stretch = stretch});
  p.operators = laplacian(
      {p.mesh.positions, p.mesh.faces},
      {.weights = stretch > 1.0 ? LaplacianWeights::kIntrinsicDelaunay : LaplacianWeights::kCotangent});
  p.system = laplacian_system(p.operators, order, p.mesh.fixed);
  p.neighbours = mesh_neighbours(p.operators, p.system);
  for (const std::int32_t v : p.system.free_vertices) p.positions.push_back(p.mesh.positions[v]);
  p.b = p.system.right_hand_side(p.mesh.target, 3);
  return p;
}

SolverOptions multigrid_options(const Problem& p, int order, MultigridCycle cycle) {
  SolverOptions o;
  o.order = order;
  o.cycle = cycle;
  o.tolerance = 1e-6;
  o.positions = p.positions;
  o.neighbours = &p.neighbours;
  return o;
}

int cycles(std::size_t side, int order, MultigridCycle cycle, double stretch = 1.0) {
  const Problem p = problem(side, order, stretch);
  const auto solver = make_solver(SolverKind::kMultigrid, multigrid_options(p, order, cycle));
  REQUIRE(solver->analyse(p.system.matrix).status == SolveStatus::kSolved);
  REQUIRE(solver->factor(p.system.matrix).status == SolveStatus::kSolved);
  std::vector<double> x(p.b.size());
  const SolveReport r = solver->solve(p.b, x, 3);
  CHECK(r.status == SolveStatus::kSolved);
  CHECK(r.residual < 1.1e-6);
  return r.iterations;
}

constexpr SolverKind kAll[] = {SolverKind::kFronts, SolverKind::kMultigrid, SolverKind::kLu};

/// The first status that is not kSolved, of all steps, and its sentence.
SolveReport attempt(SolverKind kind, const SolverOptions& options, const SparseMatrix& a,
                    std::span<const double> b) {
  const auto solver = make_solver(kind, options);
  FactorReport f = solver->analyse(a);
  if (f.status == SolveStatus::kSolved) f = solver->factor(a);
  if (f.status != SolveStatus::kSolved) {
    SolveReport r;
    r.status = f.status;
    r.message = f.message;
    return r;
  }
  std::vector<double> x(b.size());
  return solver->solve(b, x, 1);
}

}  // namespace

TEST_CASE("cholmod: every ordering gives the same solution and an honest factor count", "[unit]") {
  const Problem p = problem(60, 2);
  const auto reference = test::make_cholmod_solver({.ordering = Ordering::kNatural});
  reference->analyse(p.system.matrix);
  const FactorReport natural = reference->factor(p.system.matrix);
  std::vector<double> x0(p.b.size());
  reference->solve(p.b, x0, 3);
  for (const Ordering ordering : {Ordering::kAuto, Ordering::kMinimumDegree, Ordering::kNestedDissection,
                                  Ordering::kReverseCuthillMcKee}) {
    CAPTURE(name(ordering));
    const auto solver = test::make_cholmod_solver({.ordering = ordering});
    const FactorReport predicted = solver->analyse(p.system.matrix);
    const FactorReport made = solver->factor(p.system.matrix);
    CHECK(predicted.factor_entries == made.factor_entries);
    CHECK(made.factor_entries < natural.factor_entries);
    // The promise about memory holds and is not idle.
    CHECK(made.peak_bytes <= predicted.peak_bytes);
    CHECK(static_cast<double>(predicted.peak_bytes) < 1.5 * static_cast<double>(made.peak_bytes));
    std::vector<double> x(p.b.size());
    CHECK(solver->solve(p.b, x, 3).residual < 1e-12);
    CHECK((test::dense(x, 3) - test::dense(x0, 3)).norm() < 1e-8 * test::dense(x0, 3).norm());
  }
}

TEST_CASE("solver: values may change under one analysis", "[unit]") {
  const Problem p = problem(24, 1);
  const SolverKind kind = GENERATE(SolverKind::kFronts, SolverKind::kMultigrid);
  CAPTURE(name(kind));
  const SparseMatrix a = implicit_step_matrix(p.operators, 1e-3), b = implicit_step_matrix(p.operators, 5e-2);
  REQUIRE(a.column == b.column);
  std::vector<double> load(p.operators.mass), x(load.size()), y(load.size());
  for (std::size_t i = 0; i < load.size(); i += 3) load[i] *= -2.0;
  const auto reused = make_solver(kind, {.tolerance = 1e-12});
  reused->analyse(a);
  reused->factor(a);
  reused->solve(load, x, 1);
  REQUIRE(reused->factor(b).status == SolveStatus::kSolved);
  REQUIRE(reused->solve(load, x, 1).status == SolveStatus::kSolved);
  const auto fresh = make_solver(kind, {.tolerance = 1e-12});
  fresh->analyse(b);
  fresh->factor(b);
  fresh->solve(load, y, 1);
  CHECK(x == y);
}

TEST_CASE("solver: many right-hand sides are the single ones", "[unit]") {
  const Problem p = problem(40, 1);
  for (const SolverKind kind : kAll) {
    CAPTURE(name(kind));
    SolverOptions o = multigrid_options(p, 1, MultigridCycle::kFull);
    o.tolerance = 1e-11;
    const auto solver = make_solver(kind, o);
    solver->analyse(p.system.matrix);
    REQUIRE(solver->factor(p.system.matrix).status == SolveStatus::kSolved);
    const std::size_t n = p.positions.size();
    std::vector<double> wide(n * 7), out(n * 7), one(n), single(n);
    for (std::size_t i = 0; i < wide.size(); ++i) wide[i] = std::sin(0.37 * static_cast<double>(i));
    REQUIRE(solver->solve(wide, out, 7).status == SolveStatus::kSolved);
    for (const std::size_t c : {0, 3, 6}) {
      for (std::size_t i = 0; i < n; ++i) one[i] = wide[i * 7 + c];
      REQUIRE(solver->solve(one, single, 1).status == SolveStatus::kSolved);
      double difference = 0.0, norm = 0.0;
      for (std::size_t i = 0; i < n; ++i) {
        difference += std::pow(single[i] - out[i * 7 + c], 2);
        norm += single[i] * single[i];
      }
      CHECK(std::sqrt(difference) < 1e-8 * std::sqrt(norm));
    }
    std::vector<double> nothing(n, 0.0);
    CHECK(solver->solve(nothing, single, 1).status == SolveStatus::kSolved);
    CHECK(single == nothing);
  }
}

TEST_CASE("multigrid: the number of cycles hardly grows with the mesh", "[property]") {
  // 1.4k, 12k and 46k unknowns; tools/bench solvers goes on to a million.
  for (const int order : {1, 2}) {
    CAPTURE(order);
    const int small = cycles(48, order, MultigridCycle::kV), middle = cycles(120, order, MultigridCycle::kV),
              large = cycles(224, order, MultigridCycle::kV);
    CAPTURE(small, middle, large);
    CHECK(large < 25);
    CHECK(2 * large <= 3 * middle + 1);
    CHECK(cycles(120, order, MultigridCycle::kFull) <= middle);
  }
  CHECK(cycles(100, 1, MultigridCycle::kV, 10.0) < 25);
  CHECK(cycles(100, 2, MultigridCycle::kV, 10.0) < 45);
}

TEST_CASE("multigrid: the cascade converges too, with more and cheaper steps", "[unit]") {
  CHECK(cycles(80, 1, MultigridCycle::kCascading) < 300);
}

TEST_CASE("multigrid: order 3 and systems without positions converge", "[unit]") {
  CHECK(cycles(64, 3, MultigridCycle::kFull) < 100);
  const Problem p = problem(64, 1);
  std::vector<double> x(p.b.size());
  const auto solver = make_solver(SolverKind::kMultigrid, {.tolerance = 1e-8});
  solver->analyse(p.system.matrix);
  REQUIRE(solver->factor(p.system.matrix).status == SolveStatus::kSolved);
  CHECK(solver->solve(p.b, x, 3).status == SolveStatus::kSolved);
}

TEST_CASE("solver: an unconstrained mesh is singular, and every solver says so or does not converge",
          "[unit]") {
  const Problem p = problem(30, 1);
  const int order = GENERATE(1, 2, 3);
  const SparseMatrix a = laplacian_power(p.operators, order);
  std::vector<double> b(p.operators.mass);  // not orthogonal to constants: no solution exists
  for (const SolverKind kind : kAll) {
    CAPTURE(name(kind), order);
    const SolveReport r = attempt(kind, {.max_iterations = 200, .order = order}, a, b);
    CHECK((r.status == SolveStatus::kSingular || r.status == SolveStatus::kNotConverged));
    CHECK_FALSE(r.message.empty());
  }
  CHECK(attempt(SolverKind::kFronts, {}, a, b).status == SolveStatus::kSingular);
}

TEST_CASE("solver: a vertex that only faces without area hold is singular, intrinsic triangles cure it",
          "[unit]") {
  test::IrregularMesh mesh = test::irregular_mesh({.side = 20});
  const auto n = static_cast<std::uint32_t>(mesh.positions.size());
  // Vertex n lies on the edge from f[0] to f[1], which it splits; its two faces on one side have no area.
  auto& f = mesh.faces[mesh.faces.size() / 2];
  const std::array<std::uint32_t, 3> old = f;
  mesh.positions.push_back(mesh.positions[old[0]]);
  mesh.fixed.push_back(0);
  mesh.faces.push_back({old[0], n, old[1]});
  for (const LaplacianWeights weights :
       {LaplacianWeights::kCotangent, LaplacianWeights::kIntrinsicDelaunay}) {
    const Laplacian l = laplacian({mesh.positions, mesh.faces}, {.weights = weights});
    CHECK(l.report.degenerate_faces == 1);
    const ConstrainedSystem s = laplacian_system(l, 1, mesh.fixed);
    const std::vector<double> b(s.free_vertices.size(), 1.0);
    const bool healed = weights == LaplacianWeights::kIntrinsicDelaunay;
    for (const SolverKind kind : kAll) {
      CAPTURE(name(kind), healed);
      CHECK((attempt(kind, {.tolerance = 1e-6}, s.matrix, b).status == SolveStatus::kSolved) == healed);
    }
  }
}

TEST_CASE("solver: NaN in a matrix or a right-hand side is a value", "[unit]") {
  Problem p = problem(16, 1);
  for (const SolverKind kind : kAll) {
    CAPTURE(name(kind));
    std::vector<double> b(p.positions.size(), 1.0);
    b[3] = std::numeric_limits<double>::quiet_NaN();
    CHECK(attempt(kind, {}, p.system.matrix, b).status == SolveStatus::kNotFinite);
    SparseMatrix broken = p.system.matrix;
    broken.value[10] = std::numeric_limits<double>::infinity();
    b[3] = 1.0;
    CHECK(attempt(kind, {}, broken, b).status == SolveStatus::kNotFinite);
  }
}

TEST_CASE("solver: a factor that would not fit is refused before it is tried", "[memory]") {
  const Problem p = problem(80, 2);
  const std::vector<double> b(p.positions.size(), 1.0);
  for (const SolverKind kind : kAll) {
    CAPTURE(name(kind));
    const SolveReport r = attempt(kind, {.memory_bytes = 1 << 20, .order = 2}, p.system.matrix, b);
    CHECK(r.status == SolveStatus::kTooLarge);
    CHECK_THAT(r.message, Catch::Contains("MiB"));
    CHECK(attempt(kind, {.memory_bytes = 1 << 30, .tolerance = 1e-4, .max_iterations = 5000, .order = 2},
                  p.system.matrix, b)
              .status == SolveStatus::kSolved);
  }
}

TEST_CASE("solver: a tolerance of nothing is refused", "[unit]") {
  CHECK_THROWS_AS(make_solver(SolverKind::kMultigrid, {.tolerance = 0.0}), UsageError);
}

TEST_CASE("solver: the automatic choice keeps to the cap and gives its reason", "[memory]") {
  const Problem p = problem(200, 2);
  const auto need = [&](Ordering ordering) {
    return make_solver(SolverKind::kFronts, {.ordering = ordering})->analyse(p.system.matrix).peak_bytes;
  };
  const std::uint64_t degree = need(Ordering::kMinimumDegree), dissection = need(Ordering::kNestedDissection);
  REQUIRE(dissection < degree);
  std::vector<double> free_of_cap, x(p.b.size());
  for (const std::uint64_t cap :
       {std::uint64_t{0}, degree + 1000, (degree + dissection) / 2, dissection - 1000}) {
    CAPTURE(cap, degree, dissection);
    SolverOptions o = multigrid_options(p, 2, MultigridCycle::kFull);
    o.memory_bytes = cap;
    o.tolerance = 1e-8;
    const auto solver = make_solver(SolverKind::kAutomatic, o);
    const FactorReport plan = solver->analyse(p.system.matrix);
    REQUIRE(plan.status == SolveStatus::kSolved);
    CHECK_THAT(plan.choice, Catch::Contains("order 2"));
    if (cap > 0) CHECK(plan.peak_bytes <= cap);
    const FactorReport made = solver->factor(p.system.matrix);
    REQUIRE(made.status == SolveStatus::kSolved);
    if (cap > 0) CHECK(made.peak_bytes <= cap);
    const SolveReport r = solver->solve(p.b, x, 3);
    CHECK(r.status == SolveStatus::kSolved);
    if (cap == 0) CHECK(r.iterations == 0);
    if (cap > 0 && cap < dissection) CHECK(r.iterations > 0);
    if (free_of_cap.empty()) free_of_cap = x;
    CHECK((test::dense(x, 3) - test::dense(free_of_cap, 3)).norm() < 1e-3 * test::dense(x, 3).norm());
  }
  SolverOptions tiny = multigrid_options(p, 2, MultigridCycle::kFull);
  tiny.memory_bytes = 1 << 16;
  CHECK(make_solver(SolverKind::kAutomatic, tiny)->analyse(p.system.matrix).status == SolveStatus::kTooLarge);
}

TEST_CASE("sparse matrix: product, sum, transpose and selection are those of dense matrices", "[property]") {
  const Problem p = problem(9, 1);
  const SparseMatrix &a = p.operators.stiffness, b = laplacian_power(p.operators, 2);
  const Eigen::MatrixXd da = test::dense(a), db = test::dense(b);
  CHECK((test::dense(product(a, b)) - da * db).norm() < 1e-12 * db.norm() * da.norm());
  CHECK((test::dense(product(a, b, p.operators.mass)) -
         da * test::dense(p.operators.mass, 1).col(0).asDiagonal() * db)
            .norm() < 1e-12 * db.norm());
  CHECK((test::dense(sum(2.0, a, -0.5, b)) - (2.0 * da - 0.5 * db)).norm() < 1e-12 * db.norm());
  CHECK((test::dense(transpose(p.system.coupling)) - test::dense(p.system.coupling).transpose()).norm() ==
        0.0);
  const std::vector<double> u = p.mesh.target;
  std::vector<double> v(u.size());
  multiply(a, u, v, 3);
  CHECK((test::dense(v, 3) - da * test::dense(u, 3)).norm() < 1e-12 * da.norm());
}

}  // namespace linear_solver_test
