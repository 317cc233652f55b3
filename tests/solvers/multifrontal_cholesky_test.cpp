// Factors whose bits no machine decides: dense fronts, whole systems, what is kept in a store.
#include "solvers/multifrontal_cholesky.h"

#include <Eigen/Cholesky>
#include <catch2/catch.hpp>
#include <cmath>
#include <limits>

#include "solvers/dense_front.h"
#include "solvers/laplacian_system.h"
#include "solvers/multifrontal_solver.h"
#include "tests/helpers/irregular_mesh.h"
#include "tests/solvers/dense.h"
#include "tests/solvers/fronts.h"

namespace multifrontal_cholesky_test {

namespace {

using namespace tessera;

SparseMatrix system_of(std::size_t side, int order) {
  const test::IrregularMesh mesh = test::irregular_mesh({.side = side});
  return laplacian_system(laplacian({mesh.positions, mesh.faces}, {}), order, mesh.fixed).matrix;
}

/// Says how often it was given something.
class CountingStore final : public FactorStore {
 public:
  std::uint64_t size() const override { return memory_.size(); }
  void reserve(std::uint64_t size) override { memory_.reserve(size); }
  void append(std::span<const double> values) override {
    ++appended;
    memory_.append(values);
  }
  std::span<const double> read(std::uint64_t first, std::span<double> buffer) override {
    return memory_.read(first, buffer);
  }
  int appended = 0;

 private:
  MemoryFactorStore memory_;
};

}  // namespace

TEST_CASE("dense front: columns and rest are those of Eigen, at every edge of tiles and panels",
          "[property]") {
  const auto [size, eliminated] = GENERATE(from_range(test::front_sizes()));
  CAPTURE(size, eliminated);
  const auto n = static_cast<Eigen::Index>(size), e = static_cast<Eigen::Index>(eliminated);
  Eigen::MatrixXd random(n, n);
  for (Eigen::Index j = 0; j < n; ++j)
    for (Eigen::Index i = 0; i < n; ++i) random(i, j) = std::sin(static_cast<double>(7 * i * i + 13 * j));
  const Eigen::MatrixXd a =
      random * random.transpose() + Eigen::MatrixXd::Identity(n, n) * (0.5 * static_cast<double>(size));
  std::vector<double> value(a.data(), a.data() + a.size()), packed;
  // The upper triangle is scratch.
  for (std::size_t j = 0; j < size; ++j)
    for (std::size_t i = 0; i < j; ++i) value[j * size + i] = 1e300;
  DenseFront front{value, size, eliminated};
  const std::vector<double> smallest(eliminated, 0.0);
  REQUIRE(eliminate(front, smallest, packed) == -1);
  CHECK(packed.size() * sizeof(double) <= eliminate_bytes(size));
  const Eigen::MatrixXd l = a.topLeftCorner(e, e).llt().matrixL();
  Eigen::MatrixXd columns(n, e);
  columns.topRows(e) = l;
  Eigen::MatrixXd rest(n - e, n - e);
  if (e < n) {
    columns.bottomRows(n - e) =
        l.triangularView<Eigen::Lower>().solve(a.topRightCorner(e, n - e)).transpose();
    rest =
        a.bottomRightCorner(n - e, n - e) - columns.bottomRows(n - e) * columns.bottomRows(n - e).transpose();
  }
  double worst = 0.0;
  for (Eigen::Index j = 0; j < n; ++j)
    for (Eigen::Index i = j; i < n; ++i)
      worst = std::max(worst, std::abs(value[static_cast<std::size_t>(j * n + i)] -
                                       (j < e ? columns(i, j) : rest(i - e, j - e))));
  CHECK(worst < 1e-12 * a.norm());
}

TEST_CASE("multifrontal Cholesky: solutions are those of a dense factor", "[property]") {
  const int order = GENERATE(1, 2, 3), width = GENERATE(1, 2, 3, 8, 13);
  const std::size_t side = GENERATE(8, 24);
  CAPTURE(order, width, side);
  const SparseMatrix a = system_of(side, order);
  const MultifrontalCholesky factor(a);
  MemoryFactorStore store;
  REQUIRE(factor.factor(a, store) == -1);
  CHECK(store.size() == factor.entries());
  const std::vector<double> b = test::load_of(a, width);
  std::vector<double> x = b;
  factor.solve(store, x, width);
  const Eigen::MatrixXd expected = test::dense(a).llt().solve(test::dense(b, width));
  CHECK((test::dense(x, width) - expected).norm() < 1e-9 * expected.norm());
}

TEST_CASE("multifrontal Cholesky: many fronts, wider than a panel", "[property]") {
  const SparseMatrix a = system_of(160, 2);
  const MultifrontalCholesky factor(a);
  MemoryFactorStore store;
  REQUIRE(factor.factor(a, store) == -1);
  const std::vector<double> b = test::load_of(a, 3);
  std::vector<double> x = b;
  factor.solve(store, x, 3);
  CHECK(relative_residual(a, x, b, 3) < 1e-12);
  // What waits in memory is little beside the factor.
  CHECK(factor.factor_bytes() < 4 * factor.entries());
}

TEST_CASE("multifrontal Cholesky: a pivot that vanishes is named by its unknown", "[unit]") {
  // Two pieces; the second has the row sums of a Laplacian without a fixed vertex.
  const SparseMatrix a{4, 4, {0, 2, 4, 6, 8}, {0, 1, 0, 1, 2, 3, 2, 3}, {2, -1, -1, 2, 1, -1, -1, 1}};
  MemoryFactorStore store;
  CHECK(MultifrontalCholesky(a).factor(a, store) >= 2);
  SparseMatrix negative = a;
  negative.value[0] = -1;
  MemoryFactorStore other;
  CHECK(MultifrontalCholesky(negative).factor(negative, other) == 0);
}

TEST_CASE("multifrontal solver: a factor in the store serves again", "[unit]") {
  const SparseMatrix a = system_of(20, 1);
  const std::vector<double> b = test::load_of(a, 3);
  CountingStore store;
  std::vector<double> first(b.size()), second(b.size());
  for (std::vector<double>* x : {&first, &second}) {
    const auto solver = make_multifrontal_solver({.tolerance = 1e-10}, store);
    const FactorReport report = solver->analyse(a);
    REQUIRE(report.status == SolveStatus::kSolved);
    CHECK(report.flops > 0.0);
    REQUIRE(solver->factor(a).status == SolveStatus::kSolved);
    CHECK(store.size() == report.factor_entries);
    const int appended = store.appended;
    CHECK(solver->solve(b, *x, 3).status == SolveStatus::kSolved);
    CHECK(store.appended == appended);
  }
  CHECK(first == second);
  // A store that holds the factor of twice the matrix halves the solution: it was not factored again.
  SparseMatrix twice = a;
  for (double& v : twice.value) v *= 2.0;
  CountingStore of_twice;
  REQUIRE(MultifrontalCholesky(twice).factor(twice, of_twice) == -1);
  const int appended = of_twice.appended;
  const auto solver = make_multifrontal_solver({.tolerance = 0.3}, of_twice);
  solver->analyse(a);
  solver->factor(a);
  std::vector<double> refined(b.size());
  // A half, and a half of what is left: the residual is a quarter.
  CHECK(solver->solve(b, refined, 3).residual == Approx(0.25).epsilon(1e-6));
  CHECK(of_twice.appended == appended);
}

TEST_CASE("multifrontal solver: the same bits with a store and without, by either ordering", "[unit]") {
  const SparseMatrix a = system_of(40, 2);
  const std::vector<double> b = test::load_of(a, 3);
  const Ordering ordering = GENERATE(Ordering::kMinimumDegree, Ordering::kNestedDissection);
  const SolverOptions options{.ordering = ordering, .tolerance = 1e-10};
  const bool lu = GENERATE(false, true);
  MemoryFactorStore store;
  std::vector<double> held(b.size()), stored(b.size());
  std::uint64_t entries[2], bytes[2];
  for (const bool in_store : {false, true}) {
    const auto solver = in_store
                            ? lu ? make_lu_solver(options, store) : make_multifrontal_solver(options, store)
                        : lu ? make_lu_solver(options)
                             : make_fronts_solver(options);
    const FactorReport report = solver->analyse(a);
    REQUIRE(report.status == SolveStatus::kSolved);
    entries[in_store] = report.factor_entries;
    bytes[in_store] = report.peak_bytes;
    REQUIRE(solver->factor(a).status == SolveStatus::kSolved);
    REQUIRE(solver->solve(b, in_store ? stored : held, 3).status == SolveStatus::kSolved);
  }
  CHECK(entries[0] == entries[1]);
  CHECK(store.size() == entries[1]);
  CHECK(bytes[0] == bytes[1] + sizeof(double) * entries[1]);
  CHECK(held == stored);
}

TEST_CASE("multifrontal solver: what it cannot do is said", "[unit]") {
  const SparseMatrix a = system_of(20, 1);
  MemoryFactorStore store;
  const auto small = make_multifrontal_solver({.memory_bytes = 1000}, store);
  CHECK(small->analyse(a).status == SolveStatus::kTooLarge);
  const auto solver = make_multifrontal_solver({}, store);
  REQUIRE(solver->analyse(a).status == SolveStatus::kSolved);
  REQUIRE(solver->factor(a).status == SolveStatus::kSolved);
  std::vector<double> b = test::load_of(a, 1), x(b.size());
  b[3] = std::numeric_limits<double>::quiet_NaN();
  CHECK(solver->solve(b, x, 1).status == SolveStatus::kNotFinite);
  SparseMatrix negative = a;
  for (double& v : negative.value) v = -v;
  MemoryFactorStore other;
  const auto singular = make_multifrontal_solver({}, other);
  REQUIRE(singular->analyse(negative).status == SolveStatus::kSolved);
  CHECK(singular->factor(negative).status == SolveStatus::kSingular);
}

}  // namespace multifrontal_cholesky_test
