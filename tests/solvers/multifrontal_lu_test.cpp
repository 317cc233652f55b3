// LU factors on fronts: dense ones, whole systems that are not symmetric, pivots.
#include "solvers/multifrontal_lu.h"

#include <Eigen/LU>
#include <catch2/catch.hpp>
#include <cmath>

#include "solvers/dense_front.h"
#include "solvers/laplacian_system.h"
#include "tests/helpers/irregular_mesh.h"
#include "tests/solvers/dense.h"
#include "tests/solvers/fronts.h"

namespace multifrontal_lu_test {

namespace {

using namespace tessera;

/// A system of order 3 whose two scales differ here and there: not symmetric.
SparseMatrix uneven_system(std::size_t side) {
  const test::IrregularMesh mesh = test::irregular_mesh({.side = side});
  const Laplacian lap = laplacian({mesh.positions, mesh.faces}, {});
  std::vector<std::vector<double>> scale(2);
  for (std::size_t v = 0; v < lap.mass.size(); ++v) {
    scale[0].push_back(1.0 / lap.mass[v]);
    scale[1].push_back(mesh.fixed[v] && v % 3 != 0 ? 0.0 : 1.0 / lap.mass[v]);
  }
  return damped_laplacian_system(lap.stiffness, scale, mesh.fixed).matrix;
}

}  // namespace

TEST_CASE("dense front: rows and columns of LU are a factor, at every edge of tiles and panels",
          "[property]") {
  const auto [size, eliminated] = GENERATE(from_range(test::front_sizes()));
  CAPTURE(size, eliminated);
  const auto n = static_cast<Eigen::Index>(size), e = static_cast<Eigen::Index>(eliminated);
  Eigen::MatrixXd a(n, n);
  for (Eigen::Index j = 0; j < n; ++j)
    for (Eigen::Index i = 0; i < n; ++i)
      a(i, j) = std::sin(static_cast<double>(7 * i * i + 13 * j * j + i * j + 1));
  std::vector<double> value(a.data(), a.data() + a.size()), packed;
  DenseFront front{value, size, eliminated};
  const std::vector<double> smallest(eliminated, 0.0);
  std::vector<std::int32_t> swapped(eliminated);
  REQUIRE(eliminate_lu(front, smallest, swapped, packed) == -1);
  CHECK(packed.size() * sizeof(double) <= eliminate_lu_bytes(size));
  Eigen::MatrixXd moved = a, lower = Eigen::MatrixXd::Identity(n, n), upper = Eigen::MatrixXd::Zero(n, n);
  for (Eigen::Index j = 0; j < e; ++j) moved.row(j).swap(moved.row(swapped[static_cast<std::size_t>(j)]));
  for (Eigen::Index j = 0; j < n; ++j)
    for (Eigen::Index i = 0; i < n; ++i)
      (i > j && j < e ? lower : upper)(i, j) = value[static_cast<std::size_t>(j * n + i)];
  double growth = 1.0;
  for (const double v : value) growth = std::max(growth, std::abs(v));
  CHECK((lower * upper - moved).norm() < 1e-13 * static_cast<double>(size) * growth * a.norm());
}

TEST_CASE("multifrontal LU: solutions are those of a dense factor, few and many at a time", "[property]") {
  const int width = GENERATE(1, 3, 8, 15, 16);
  const std::size_t side = GENERATE(8, 24);
  const Ordering ordering = GENERATE(Ordering::kMinimumDegree, Ordering::kNestedDissection);
  CAPTURE(width, side);
  const SparseMatrix a = uneven_system(side);
  const Eigen::MatrixXd whole = test::dense(a);
  REQUIRE((whole - whole.transpose()).norm() > 1e-3 * whole.norm());
  MultifrontalLu factor(a, ordering);
  MemoryFactorStore store;
  REQUIRE(factor.factor(a, store) == -1);
  CHECK(store.size() == factor.entries());
  const std::vector<double> b = test::load_of(a, width);
  std::vector<double> x = b;
  factor.solve(store, x, width);
  const Eigen::MatrixXd expected = whole.partialPivLu().solve(test::dense(b, width));
  CHECK((test::dense(x, width) - expected).norm() < 1e-8 * expected.norm());
}

TEST_CASE("multifrontal LU: many fronts, wider than a panel", "[property]") {
  const SparseMatrix a = uneven_system(120);
  MultifrontalLu factor(a);
  MemoryFactorStore store;
  REQUIRE(factor.factor(a, store) == -1);
  const std::vector<double> b = test::load_of(a, 9);
  std::vector<double> x = b;
  factor.solve(store, x, 9);
  CHECK(relative_residual(a, x, b, 9) < 1e-9);
}

TEST_CASE("multifrontal LU: a pivot comes from another row, and none is told", "[unit]") {
  // Nothing on the diagonal, and a pattern that is not symmetric.
  const SparseMatrix a{3, 3, {0, 3, 5, 7}, {0, 1, 2, 0, 1, 1, 2}, {0, 2, 1, 3, 0, 1, 4}};
  MultifrontalLu factor(a);
  MemoryFactorStore store;
  REQUIRE(factor.factor(a, store) == -1);
  std::vector<double> x = {7, 3, 14};  // a (1, 2, 3)
  factor.solve(store, x, 1);
  CHECK(x[0] == Approx(1.0));
  CHECK(x[1] == Approx(2.0));
  CHECK(x[2] == Approx(3.0));
  const SparseMatrix singular{2, 2, {0, 2, 4}, {0, 1, 0, 1}, {1, 2, 2, 4}};
  MemoryFactorStore other;
  CHECK(MultifrontalLu(singular).factor(singular, other) >= 0);
}

}  // namespace multifrontal_lu_test
