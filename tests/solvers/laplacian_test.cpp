// Laplace-Beltrami operators against what is known exactly.
#include "solvers/laplacian.h"

#include <catch2/catch.hpp>
#include <cmath>
#include <limits>
#include <numeric>

#include "octree/error.h"
#include "solvers/intrinsic_delaunay.h"
#include "tests/helpers/icosphere.h"
#include "tests/helpers/irregular_mesh.h"
#include "tests/solvers/dense.h"

namespace laplacian_test {

namespace {

using namespace tessera;

TriangleSpan span_of(const test::IrregularMesh& m) {
  return {m.positions, m.faces};
}

/// Delta f = M^-1 L f
std::vector<double> apply_laplacian(const Laplacian& operators, std::span<const double> f) {
  std::vector<double> out(f.size());
  multiply(operators.stiffness, f, out);
  for (std::size_t i = 0; i < out.size(); ++i) out[i] /= operators.mass[i];
  return out;
}

/// Largest |Delta f| at vertices away from the border, times the mean area, over the range of f.
double laplacian_of_linear(const test::IrregularMesh& mesh, LaplacianWeights weights) {
  const Laplacian l = laplacian(span_of(mesh), {.weights = weights});
  std::vector<double> f;
  for (const auto& p : mesh.positions) f.push_back(3.0 * p[0] - 2.0 * p[1] + 0.5);
  const std::vector<double> d = apply_laplacian(l, f);
  double worst = 0.0;
  for (std::size_t i = 0; i < d.size(); ++i)
    if (!mesh.fixed[i]) worst = std::max(worst, std::fabs(d[i]) * l.mass[i]);
  return worst;
}

}  // namespace

TEST_CASE("laplacian: exact for linear functions on an irregular flat mesh", "[unit]") {
  const test::IrregularMesh mesh = test::irregular_mesh({.side = 40, .height = 0.0});
  CHECK(laplacian_of_linear(mesh, LaplacianWeights::kCotangent) < 1e-13);
  CHECK(laplacian_of_linear(mesh, LaplacianWeights::kIntrinsicDelaunay) < 1e-12);
  // The umbrella operator is not, and this is why it is not the default.
  CHECK(laplacian_of_linear(mesh, LaplacianWeights::kUniform) > 1e-3);
}

TEST_CASE("laplacian: symmetric to the bit, constants in the null space, never positive", "[property]") {
  const auto weights = GENERATE(LaplacianWeights::kCotangent, LaplacianWeights::kClampedCotangent,
                                LaplacianWeights::kIntrinsicDelaunay, LaplacianWeights::kUniform);
  const auto stretch = GENERATE(1.0, 8.0);
  const test::IrregularMesh mesh = test::irregular_mesh({.side = 16, .stretch = stretch});
  const Laplacian l = laplacian(span_of(mesh), {.weights = weights});
  CHECK(test::asymmetry(l.stiffness) == 0.0);
  const std::vector<double> ones(l.mass.size(), 1.0);
  std::vector<double> zero(ones.size());
  multiply(l.stiffness, ones, zero);
  for (std::size_t i = 0; i < zero.size(); ++i) {
    const auto row = static_cast<std::int32_t>(i);
    CHECK(std::fabs(zero[i]) <= 1e-14 * std::fabs(entry(l.stiffness, row, row)));
    CHECK(l.mass[i] > 0.0);
  }
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> eigen(test::dense(l.stiffness),
                                                             Eigen::EigenvaluesOnly);
  const Eigen::VectorXd& values = eigen.eigenvalues();
  CHECK(values(values.size() - 1) < 1e-10);
  CHECK(values(values.size() - 2) < -1e-6);  // constants are all there is: the mesh is connected
}

TEST_CASE("laplacian: eigenvalues of the sphere are l (l + 1), with second order", "[unit]") {
  std::vector<double> error;
  for (const int level : {2, 3}) {
    const test::Icosphere s = test::icosphere(level);
    const Laplacian l = laplacian({s.positions, s.faces});
    const Eigen::MatrixXd mass =
        Eigen::Map<const Eigen::VectorXd>(l.mass.data(), static_cast<Eigen::Index>(l.mass.size()))
            .asDiagonal();
    const Eigen::GeneralizedSelfAdjointEigenSolver<Eigen::MatrixXd> eigen(-test::dense(l.stiffness), mass,
                                                                          Eigen::EigenvaluesOnly);
    double worst = 0.0;
    int index = 0;
    for (int degree = 0; degree <= 4; ++degree)
      for (int m = 0; m < 2 * degree + 1; ++m, ++index) {
        const double exact = degree * (degree + 1);
        worst = std::max(worst, std::fabs(eigen.eigenvalues()(index) - exact) / std::max(1.0, exact));
      }
    error.push_back(worst);
  }
  INFO("relative errors " << error[0] << " " << error[1]);
  CHECK(error[1] < 0.03);
  CHECK(error[0] / error[1] > 3.3);
}

TEST_CASE("laplacian: spherical harmonics are eigenfunctions, areas sum to the surface", "[unit]") {
  std::vector<double> error;
  for (const int level : {3, 4, 5}) {
    const test::Icosphere s = test::icosphere(level);
    const Laplacian l = laplacian({s.positions, s.faces});
    std::vector<double> f;
    for (const auto& p : s.positions) f.push_back(p[0] * p[1] + 0.5 * (3.0 * p[2] * p[2] - 1.0));  // degree 2
    const std::vector<double> d = apply_laplacian(l, f);
    double difference = 0.0, norm = 0.0;
    for (std::size_t i = 0; i < f.size(); ++i) {
      difference += l.mass[i] * (d[i] + 6.0 * f[i]) * (d[i] + 6.0 * f[i]);
      norm += l.mass[i] * 36.0 * f[i] * f[i];
    }
    error.push_back(std::sqrt(difference / norm));
    double area = 0.0;
    for (const auto& face : s.faces) {
      std::array<double, 3> length;
      for (int k = 0; k < 3; ++k) {
        const auto &p = s.positions[face[(k + 1) % 3]], &q = s.positions[face[(k + 2) % 3]];
        length[k] = std::hypot(p[0] - q[0], p[1] - q[1], p[2] - q[2]);
      }
      area += triangle_area(length);
    }
    CHECK(std::accumulate(l.mass.begin(), l.mass.end(), 0.0) == Approx(area).epsilon(1e-12));
  }
  INFO("errors " << error[0] << " " << error[1] << " " << error[2]);
  CHECK(error[2] < 0.02);
  CHECK(error[0] > 1.5 * error[1]);
}

TEST_CASE("laplacian: faces without area are left out and counted", "[unit]") {
  test::IrregularMesh mesh = test::irregular_mesh({.side = 12});
  const Laplacian before = laplacian(span_of(mesh));
  CHECK(before.report.degenerate_faces == 0);
  const auto n = static_cast<std::uint32_t>(mesh.positions.size());
  mesh.positions.push_back(mesh.positions[30]);  // a vertex on top of another, held by a needle of no area
  mesh.faces.push_back({30, n, 31});
  mesh.faces.push_back({5, 5, 6});
  const Laplacian after = laplacian(span_of(mesh));
  CHECK(after.report.degenerate_faces == 2);
  CHECK(after.report.first_degenerate == static_cast<std::int64_t>(mesh.faces.size()) - 2);
  CHECK(after.report.massless_vertices == 1);
  for (std::int32_t i = 0; i < before.stiffness.rows; ++i)
    CHECK(entry(after.stiffness, i, i) == entry(before.stiffness, i, i));
  CHECK(all_finite(after.stiffness.value));
  CHECK(all_finite(after.mass));
  // Intrinsic triangles have area, so the needle holds its vertex.
  const Laplacian healed = laplacian(span_of(mesh), {.weights = LaplacianWeights::kIntrinsicDelaunay});
  CHECK(all_finite(healed.stiffness.value));
  CHECK(entry(healed.stiffness, static_cast<std::int32_t>(n), static_cast<std::int32_t>(n)) < 0.0);
}

TEST_CASE("laplacian: negative weights vanish by clamping and by intrinsic flips", "[property]") {
  const test::IrregularMesh mesh = test::irregular_mesh({.side = 30, .stretch = 6.0});
  CHECK(laplacian(span_of(mesh)).report.negative_weights > 500);
  const Laplacian clamped = laplacian(span_of(mesh), {.weights = LaplacianWeights::kClampedCotangent});
  const Laplacian delaunay = laplacian(span_of(mesh), {.weights = LaplacianWeights::kIntrinsicDelaunay});
  CHECK(delaunay.report.flips > 300);
  CHECK(delaunay.report.unflippable == 0);
  for (const Laplacian* l : {&clamped, &delaunay}) {
    std::size_t border = 0;
    for (std::int32_t i = 0; i < l->stiffness.rows; ++i)
      for (std::int32_t e = l->stiffness.start[i]; e < l->stiffness.start[i + 1]; ++e)
        if (l->stiffness.column[e] != i && l->stiffness.value[e] < -1e-9) {
          // An obtuse angle may face the border, where no flip is possible.
          ++border;
          CHECK(l == &delaunay);
          CHECK(mesh.fixed[i]);
        }
    CHECK(border < 200);
  }
  CHECK(std::accumulate(delaunay.mass.begin(), delaunay.mass.end(), 0.0) ==
        Approx(std::accumulate(clamped.mass.begin(), clamped.mass.end(), 0.0)).epsilon(1e-9));
}

TEST_CASE("laplacian: what cannot be used is named", "[unit]") {
  test::IrregularMesh mesh = test::irregular_mesh({.side = 8});
  SECTION("an index out of range") {
    mesh.faces[7][1] = 64;
    CHECK_THROWS_WITH(laplacian(span_of(mesh)), Catch::Contains("face 7: vertex index 64"));
  }
  SECTION("NaN") {
    mesh.positions[20][1] = std::numeric_limits<double>::quiet_NaN();
    CHECK_THROWS_WITH(laplacian(span_of(mesh)), Catch::Contains("vertex 20 of face"));
  }
  SECTION("nothing but slivers") {
    for (auto& p : mesh.positions) p = {p[0], 0.0, 0.0};
    CHECK_THROWS_AS(laplacian(span_of(mesh)), InputError);
  }
}

}  // namespace laplacian_test
